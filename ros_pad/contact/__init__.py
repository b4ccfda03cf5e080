# SPDX-License-Identifier: Apache-2.0
"""Contact of one inflated pad with the floor (thesis chapter 3)."""

from ros_pad.contact.bridge import Bridge, bridge
from ros_pad.contact.design import DESIGN_WATER, Design, design, pads_in, rise_height
from ros_pad.contact.dome import Inflated, Pressed, inflate, press
from ros_pad.contact.film import Film, film_thickness
from ros_pad.contact.limits import force_limit, pressure_for
from ros_pad.contact.material import Material
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.meniscus import (
    THESIS_LIQUID,
    WATER,
    Liquid,
    Meniscus,
    capillary_pull,
    contact_angle,
    hysteresis_force,
    meniscus,
)
from ros_pad.contact.pad import LARGE_PAD, SMALL_PAD, MeasuredLimit, Pad
from ros_pad.contact.resistance import Foot, tangential_resistance
from ros_pad.contact.squeeze import HalfSpace, Membrane, Squeezed, squeeze, trapped_film

__all__ = [
    'DESIGN_WATER',
    'LARGE_PAD',
    'SMALL_PAD',
    'THESIS_LIQUID',
    'WATER',
    'Bridge',
    'Design',
    'Film',
    'Foot',
    'HalfSpace',
    'Inflated',
    'Liquid',
    'Material',
    'MeasuredLimit',
    'Measurements',
    'Membrane',
    'Meniscus',
    'Pad',
    'Pressed',
    'Squeezed',
    'bridge',
    'capillary_pull',
    'contact_angle',
    'design',
    'film_thickness',
    'force_limit',
    'hysteresis_force',
    'inflate',
    'meniscus',
    'pads_in',
    'press',
    'pressure_for',
    'rise_height',
    'squeeze',
    'tangential_resistance',
    'trapped_film',
]

# SPDX-License-Identifier: Apache-2.0
"""Contact of one inflated pad with the floor (thesis chapter 3)."""

from ros_pad.contact.bridge import Bridge
from ros_pad.contact.bridge import bridge
from ros_pad.contact.design import DESIGN_WATER
from ros_pad.contact.design import Design
from ros_pad.contact.design import design
from ros_pad.contact.design import design_pressure
from ros_pad.contact.design import foot_force
from ros_pad.contact.design import pads_in
from ros_pad.contact.design import rise_height
from ros_pad.contact.dome import Inflated
from ros_pad.contact.dome import Pressed
from ros_pad.contact.dome import inflate
from ros_pad.contact.dome import press
from ros_pad.contact.fibre import fibre_meniscus
from ros_pad.contact.film import Film
from ros_pad.contact.film import film_thickness
from ros_pad.contact.limits import force_limit
from ros_pad.contact.limits import pressure_for
from ros_pad.contact.material import Material
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.meniscus import THESIS_LIQUID
from ros_pad.contact.meniscus import WATER
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.meniscus import Meniscus
from ros_pad.contact.meniscus import capillary_pull
from ros_pad.contact.meniscus import contact_angle
from ros_pad.contact.meniscus import hysteresis_force
from ros_pad.contact.meniscus import meniscus
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import SMALL_PAD
from ros_pad.contact.pad import MeasuredLimit
from ros_pad.contact.pad import Pad
from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import tangential_resistance
from ros_pad.contact.squeeze import HalfSpace
from ros_pad.contact.squeeze import Membrane
from ros_pad.contact.squeeze import Squeezed
from ros_pad.contact.squeeze import squeeze
from ros_pad.contact.squeeze import trapped_film

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
    'design_pressure',
    'fibre_meniscus',
    'film_thickness',
    'foot_force',
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

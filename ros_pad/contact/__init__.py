# SPDX-License-Identifier: Apache-2.0
"""Contact of one inflated pad with the floor (thesis chapter 3)."""

from ros_pad.contact.dome import Inflated
from ros_pad.contact.dome import Pressed
from ros_pad.contact.dome import inflate
from ros_pad.contact.dome import press
from ros_pad.contact.limits import force_limit
from ros_pad.contact.limits import pressure_for
from ros_pad.contact.meniscus import THESIS_LIQUID
from ros_pad.contact.meniscus import WATER
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.meniscus import Meniscus
from ros_pad.contact.meniscus import contact_angle
from ros_pad.contact.meniscus import meniscus
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import SMALL_PAD
from ros_pad.contact.pad import Pad

__all__ = [
    'LARGE_PAD',
    'SMALL_PAD',
    'THESIS_LIQUID',
    'WATER',
    'Inflated',
    'Liquid',
    'Meniscus',
    'Pad',
    'Pressed',
    'contact_angle',
    'force_limit',
    'inflate',
    'meniscus',
    'press',
    'pressure_for',
]

# SPDX-License-Identifier: Apache-2.0
"""How a foot is made: moulds, parts and silicone from a foot file.

The recipe, its sources and what is not sure of it: docs/moulds.md.
"""

from ros_pad.making.plan import SETTINGS, Plan, plan
from ros_pad.making.solids import Part, build

__all__ = ['SETTINGS', 'Part', 'Plan', 'build', 'plan']

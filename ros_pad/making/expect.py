# SPDX-License-Identifier: Apache-2.0
"""What to expect of a foot as it is made: by its model, for a sheet a little off its thickness."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from ros_pad.contact import Material, Pad, force_limit, inflate
from ros_pad.contact.foot_file import foot_text
from ros_pad.contact.limits import DEFAULT_CRITERION, largest_pressure
from ros_pad.contact.pad import with_constant
from ros_pad.contact.resistance import DOMED
from ros_pad.making.plan import Plan
from ros_pad.making.solids import Part

DENSITY = {'filament': 1040.0, 'resin': 1150.0, 'film': 1380.0}
"""Density of printed ABS, cured resin and polyester film, kg/m³."""


class Batch(NamedTuple):
    """What to weigh of a silicone: the mass that stays in the foot, and both parts, kg."""

    material: Material
    casting: dict[str, Any]
    mass: float
    mixed: float


def expected(made: Plan) -> list[tuple[str, ...]]:
    """Return what to expect of the thinnest, the designed and the thickest sheet, as texts.

    The first row has the heads. Above the end of the model a pad balloons, or nothing is known.
    """
    foot, pressure, ceiling = made.foot, DOMED * made.foot.ceiling, ceiling_of(made)
    # A limit that was measured holds for its own pad alone.
    criterion = DEFAULT_CRITERION if foot.limit == 'measured' else foot.limit
    head = 'sheet, mm', 'stiffness, N/m', 'for the same dome, Pa', f'dome at {pressure:.0f} Pa, mm'
    rows: list[tuple[str, ...]] = [
        (*head, f'limit of a pad at {ceiling:.0f} Pa, N', 'balloons or model ends, Pa')
    ]
    for off in (-1e-3, 0.0, 1e-3):
        thickness = 1e-3 * made.z['sheet'] + off * made.set['tolerance']
        pad, share = _with_sheet(foot.pad, thickness), 1e3 * thickness / made.z['sheet']
        # Arrays have NaN above the end of a model.
        height = 1e3 * float(inflate(pad, [pressure]).height[0])
        limit = float(force_limit(pad, [ceiling], criterion)[0])
        values = ('balloons' if math.isnan(each) else f'{each:.3g}' for each in (height, limit))
        # Of one shape, tension and pressure are in proportion to the thickness.
        first = f'{1e3 * thickness:.3f}', f'{pad.stiffness:.3g}', f'{share * pressure:.0f}'
        rows.append((*first, *values, f'{largest_pressure(pad):.0f}'))
    return rows


def _with_sheet(pad: Pad, thickness: float) -> Pad:
    """Return a pad with another thickness, and so another stiffness."""
    if pad.material is not None:
        return with_constant(pad, 'thickness', thickness)
    assert pad.thickness is not None
    share = thickness / pad.thickness
    return replace(pad, stiffness=share * pad.stiffness, thickness=thickness, measured_limit=None)


def ceiling_of(made: Plan) -> float:
    """Return the ceiling, Pa, up to which no pad balloons in the worst case; at most the foot's.

    All pads share one plenum: the thinnest takes all the air once it balloons.
    """
    pad = _with_sheet(made.foot.pad, 1e-3 * (made.z['sheet'] - made.set['tolerance']))
    if pad.material is not None and pad.material.factor_range is not None:
        pad = with_constant(pad, 'factor', pad.material.factor_range[0])
    return min(made.foot.ceiling, 100.0 * math.floor(0.0099 * largest_pressure(pad)))


def batches(made: Plan, parts: Mapping[str, Part]) -> list[Batch]:
    """Return what to weigh of the silicone, or of sheet and body, with waste: a fifth or 5 g."""
    rows = []
    for name, material in (('silicone', made.sheet), ('sheet', made.sheet), ('body', made.body)):
        if name in parts:
            assert material.casting is not None
            mass = 1e-9 * parts[name].solid.volume() * material.casting['density']
            rows.append(Batch(material, material.casting, mass, max(1.2 * mass, mass + 5e-3)))
    return rows


def as_made(made: Plan, parts: Mapping[str, Part]) -> str:
    """Return the foot file of the foot as it is made, which ``pad calibrate`` fills."""
    foot = made.foot
    foot = replace(
        foot,
        ceiling=ceiling_of(made),
        chamber_volume=1e-9 * parts['air'].solid.volume(),
        sole_thickness=1e-3 * (made.z['bone'] if made.process == 'large' else made.z['top']),
    )
    head = [
        f'Made by pad mould from {made.foot.source}: volume of air, silicone under the sole and',
        'ceiling are those of its moulds; everything else is of that foot.',
        'Measure, then: pad calibrate measurements.csv --foot as_made.yaml',
    ]
    comments = {'sole_thickness': 'under the bone' if made.process == 'large' else 'of the body'}
    return foot_text(foot, f'{made.foot.source}, as made', head, comments)

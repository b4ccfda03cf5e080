# SPDX-License-Identifier: Apache-2.0
"""Compare the criteria of the force limit, on one pad and with other pads.

Prints the force limits of two pads by every criterion beside the three that were measured; by
which power of stiffness, radius and pressure each of them grows; and what a pad of another sheet
or radius carries. Stiffness is changed alone, at the same thickness. Writes force_limits.json and
.png.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from ros_pad.contact import LARGE_PAD, Material, Pad, force_limit
from ros_pad.contact.limits import CRITERIA, criteria, largest_pressure
from ros_pad.errors import NoEquilibrium
from studies import command
from studies.drawing import STYLE

MEASURED = {65e3: 0.15, 75e3: 0.30, 85e3: 0.40}
"""Force limits that the thesis measured on its large pad, N, by pressure, Pa."""

FACTOR = 1.88
"""On the parameters of Dragon Skin 10, so that the membrane has the heights of the large pad."""

PRESSURES = (5e3, 20e3, 50e3, *MEASURED)
STIFFER = (0.8, 1.0, 1.2, 1.5, 2.0, 3.0)
RADII = (0.5e-3, 0.75e-3, 1.0e-3, 1.25e-3, 1.5e-3)
AT = 75e3  # Pa, pressure at which pads are compared


def dragon_skin() -> Pad:
    """Return the large pad as a membrane of Dragon Skin 10 with the heights that were measured."""
    rubber = Material.load('dragon_skin_10')
    parameters = tuple(FACTOR * each for each in rubber.parameters)
    assert LARGE_PAD.thickness is not None
    stiffened = replace(rubber, parameters=parameters)
    return Pad.of(stiffened, LARGE_PAD.radius, LARGE_PAD.thickness)


PADS = {'cap': LARGE_PAD, 'membrane': dragon_skin()}


def like(pad: Pad, stiffer: float = 1.0, radius: float = 1.0) -> Pad:
    """Return a pad of the same thickness, its material stiffer and itself wider by factors."""
    if pad.material is None:
        return replace(pad, radius=radius * pad.radius, stiffness=stiffer * pad.stiffness)
    parameters = tuple(stiffer * each for each in pad.material.parameters)
    assert pad.thickness is not None
    return Pad.of(replace(pad.material, parameters=parameters), radius * pad.radius, pad.thickness)


def limit(pad: Pad, pressure: float, criterion: str) -> float | None:
    """Return a force limit, N; None where the pad has none."""
    try:
        known = criterion in criteria(pad) and pressure <= largest_pressure(pad)
        return float(force_limit(pad, pressure, criterion)) if known else None
    except NoEquilibrium:
        return None


def power(pad: Pad, criterion: str, change: str) -> float | None:
    """Return by which power of stiffness, radius or pressure a limit grows, at 75 kPa."""
    found = []
    for factor in (0.99, 1.01):
        changes = {} if change == 'pressure' else {change: factor}
        pressure = AT * factor if change == 'pressure' else AT
        force = limit(like(pad, **changes), pressure, criterion)
        if not force:
            return None
        found.append(math.log(force) / math.log(1.01 / 0.99))
    return found[1] - found[0]


def pads() -> dict[str, Any]:
    """Return all limits of single pads."""
    sheets = {
        name: {
            'limits': {c: [limit(pad, p, c) for p in PRESSURES] for c in criteria(pad)},
            'powers': {
                c: [power(pad, c, change) for change in ('stiffer', 'radius', 'pressure')]
                for c in criteria(pad)
                if c != 'measured'
            },
            'stiffer': {
                c: [limit(like(pad, stiffer=k), AT, c) for k in STIFFER]
                for c in criteria(pad)
                if c != 'measured'
            },
        }
        for name, pad in PADS.items()
    }
    small = [like(LARGE_PAD, radius=r / LARGE_PAD.radius) for r in RADII]
    return {
        'pressures': PRESSURES,
        'pads': sheets,
        'radii': {
            c: [(limit(each, AT, c) or 0.0) / (math.pi * each.radius**2) for each in small]
            for c in criteria(small[0])
        },
    }


def table(document: dict[str, Any]) -> str:
    """Return the tables of docs/model/force_limit.md."""
    lines = []
    for part, heads in (
        ('limits', [f'{p / 1e3:g} kPa' for p in PRESSURES]),
        ('powers', ['stiffness', 'radius', 'pressure']),
        ('stiffer', [f'{k:g} k' for k in STIFFER]),
    ):
        rows = [
            {'pad': name, 'criterion': c, **dict(zip(heads, values, strict=True))}
            for name, each in document['pads'].items()
            for c, values in each[part].items()
        ]
        lines.append(command.listed(rows, part))
    heads = [f'{1e3 * r:g} mm' for r in RADII]
    radii = document['radii'].items()
    rows = [{'criterion': c, **dict(zip(heads, values, strict=True))} for c, values in radii]
    lines.append(command.listed(rows, 'load over area, Pa'))
    return '\n\n'.join(lines)


def draw() -> Figure:
    """Draw every criterion over the pressure beside the measurements, and over the stiffness."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.4), layout='constrained')
        panels = figure.subplots(1, 3, sharey=True)
        for panel, (name, pad) in zip(panels[:2], PADS.items(), strict=True):
            pressures = np.linspace(1e3, 0.999 * min(91e3, largest_pressure(pad)), 120)
            for criterion in criteria(pad):
                colour = f'C{CRITERIA.index(criterion)}'
                found = force_limit(pad, pressures, criterion)
                panel.plot(1e-3 * pressures, found, color=colour, label=criterion)
            panel.plot(1e-3 * np.array([*MEASURED]), [*MEASURED.values()], 'ko', label='points')
            panel.set(title=f'Large pad as a {name}', xlabel='gauge pressure, kPa')
        stiffer = np.linspace(0.9, 3.0, 90)
        for criterion in ('thickness', 'flattening'):
            forces = [limit(like(PADS['membrane'], stiffer=k), AT, criterion) for k in stiffer]
            colour = f'C{CRITERIA.index(criterion)}'
            panels[2].plot(stiffer, np.array(forces, dtype=float), color=colour)
        panels[2].set(title='Stiffer membranes at 75 kPa', xlabel='modulus, times')
        panels[0].set_ylabel('force limit of one pad, N')
        panels[0].legend(frameon=False, fontsize=7)
    return figure


def main(words: Sequence[str]) -> int:
    """Run the study; return the exit status."""
    part = command.parser('force_limits', __doc__)
    command.add_out(part)
    options = part.parse_args(words)
    document = pads()
    command.write(options.out, 'force_limits', document, {'force_limits': draw()})
    command.show(options, document, table(document))
    return 0

# SPDX-License-Identifier: Apache-2.0
"""Compare the criteria of the force limit: on one pad, with other pads, and in walks.

Prints the force limits of two pads by every criterion beside the three that were measured; by
which power of stiffness, radius and pressure each of them grows; what a pad of another sheet or
radius carries; and walks with the default criterion and with the measured line. Stiffness is
changed alone, at the same thickness. Writes force_limits.json and .png.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from ros_pad.contact import LARGE_PAD, Material, Pad, force_limit
from ros_pad.contact.limits import CRITERIA, criteria, largest_pressure
from ros_pad.errors import NoEquilibrium
from ros_pad.simulation import Scene
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop import loops
from studies.drawing import STYLE

MEASURED = {65e3: 0.15, 75e3: 0.30, 85e3: 0.40}
"""Force limits that the thesis measured on its large pad, N, by pressure, Pa."""

FACTOR = 1.88
"""On the parameters of Dragon Skin 10, so that the membrane has the heights of the large pad."""

PRESSURES = (5e3, 20e3, 50e3, *MEASURED)
STIFFER = (0.8, 1.0, 1.2, 1.5, 2.0, 3.0)
RADII = (0.5e-3, 0.75e-3, 1.0e-3, 1.25e-3, 1.5e-3)
AT = 75e3  # Pa, pressure at which pads are compared

WALKS = {
    'hexapod_patches': ('adaptive', 'dome'),
    'quadruped_patches': ('adaptive', 'dome'),
    'hexapod_smooth_wet_dome': ('dome',),
    'hexapod_rough_wet_dome': ('dome',),
    'leg_wet_dome_40': ('dome',),
    'leg_wet_dome_60': ('dome',),
    'leg_wet_dome_75': ('dome',),
}
"""Scenes with domes, and their policies."""
LIMITS = ('measured', 'thickness')


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


def walk(scene: str, policy: str, criterion: str, seed: int) -> dict[str, Any]:
    """Walk a scene with feet of a criterion."""
    world = Scene.load(scene)
    world = replace(world, foot=replace(world.foot, limit=criterion))
    loop = ClosedLoop(world, policy, seed)
    domed, samples = [], 0
    for _ in loops.samples(loop, world):
        samples += len(world.legs)
        domed += [p for p in map(loop.controller.setpoint, world.legs) if p > 0.0]
    cycles = (loop.robot.time - world.settle) / world.gait.cycle
    return {
        'mm_a_cycle': 1e3 * loop.robot.body[0] / cycles,
        'domed': len(domed) / samples,
        'kpa': 1e-3 * statistics.fmean(domed) if domed else 0.0,
        'verdict': loop.robot.verdict,
    }


def walks(seeds: int, processes: int) -> list[dict[str, Any]]:
    """Return what walks of every scene, policy and criterion do, mean over seeds."""
    keys = [(s, p, c) for s, policies in WALKS.items() for p in policies for c in LIMITS]
    cases = [(*key, seed) for key in keys for seed in range(seeds)]
    found = command.in_processes(walk, cases, processes, 'force limits')
    rows = []
    for index, key in enumerate(keys):
        own = found[index * seeds : (index + 1) * seeds]
        rows.append(
            dict(zip(('scene', 'policy', 'criterion'), key, strict=True))
            | {name: statistics.fmean(each[name] for each in own) for name in list(own[0])[:3]}
            | {'each_mm': [round(each['mm_a_cycle'], 2) for each in own]}
            | {'verdicts': sorted({each['verdict'] for each in own if each['verdict']})}
        )
    return rows


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
    return '\n\n'.join([*lines, command.listed(document['walks'])])


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
    command.add_count(part, '--seeds', 3, 'walks of each kind; 0 for pads alone', least=0)
    command.add_processes(part)
    options = part.parse_args(words)
    found = walks(options.seeds, options.processes) if options.seeds else []
    document = pads() | {'walks': found}
    command.write(options.out, 'force_limits', document, {'force_limits': draw()})
    command.show(options, document, table(document))
    return 0

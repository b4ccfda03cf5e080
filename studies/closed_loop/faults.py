# SPDX-License-Identifier: Apache-2.0
"""Measure the distance that faults of the air cost, with and without the monitor of the pads.

Walks ``hexapod_patches`` with the adaptive policy, without faults and with each fault, and prints
the distance a cycle in mm: the mean over floors, and each floor.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.trial import Trial
from studies import command
from studies.closed_loop import loops

LEG = 2
# 'stuck flat' begins with the walk; 'stuck domed' begins 0.4 s after the pad first becomes a dome
# in the walk without faults; the others begin at 8 s.
FAULTS = {
    'stuck flat': '{kind: stuck_valve, legs: [2]}',
    'stuck domed': '{kind: stuck_valve, legs: [2], start: %g}',
    'leak of 2.8 mm': '{kind: leak, legs: [2], start: 8.0, conductance: 1.0e-8}',
    'silent': '{kind: silence, legs: [2], start: 8.0}',
    'supply lost, all': '{kind: supply_loss, start: 8.0}',
    'supply lost for 20 s, all': '{kind: supply_loss, start: 8.0, end: 28.0}',
}
COLUMNS = ('no fault', 'without monitor', 'with monitor')


def walked(scene: Scene, seed: int, fidelity: str, monitored: bool = True) -> Trial:
    """Walk with the adaptive policy; unless ``monitored``, without pressures for the monitor."""
    loop = ClosedLoop(scene, 'adaptive', seed, fidelity)
    if not monitored:
        loop.controller.observe = lambda *_: None  # type: ignore[method-assign]
    loops.walk(loop)
    return loop.trial()


def advance(trial: Trial) -> float:
    """Return the distance a cycle, mm; raise ArithmeticError for a walk that is not valid."""
    assert trial.metrics is not None
    if trial.metrics.verdict:
        raise ArithmeticError(
            f'the walk with seed {trial.seed} is not valid: {trial.metrics.verdict}'
        )
    return 1e3 * trial.metrics.distance_per_cycle_m


def on_floor(seed: int, fidelity: str, cycles: int) -> dict[str, list[float]]:
    """Return for each fault the distances of :data:`COLUMNS` on one floor, mm a cycle."""
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=cycles)
    sound = walked(scene, seed, fidelity)
    domed = sound.slow_time[np.argmax(sound.slow['dome'][:, LEG - 1])] + 0.4
    found = {}
    for name, text in FAULTS.items():
        fault = Fault.parse(text % domed if '%' in text else text)
        broken = dataclasses.replace(scene, faults=(fault,))
        trials = [sound, *(walked(broken, seed, fidelity, each) for each in (False, True))]
        found[name] = [advance(trial) for trial in trials]
    return found


def table(document: dict[str, Any]) -> str:
    """Return the distances as text: means over floors, and each floor."""
    rows = [
        {'fault': name, **dict(zip(COLUMNS, np.mean(floors, axis=0).tolist(), strict=True)),
         'floors': floors}
        for name, floors in document['faults'].items()
    ]  # fmt: skip
    title = f'{document["fidelity"]}, {document["cycles"]} cycles, mm a cycle'
    return command.listed(rows, title)


def main(words: Sequence[str]) -> int:
    """Walk, and print the table."""
    parser = command.parser('faults', __doc__)
    parser.add_argument('--fidelity', choices=('L1', 'L2'), default='L2', help='(default: L2)')
    command.add_count(parser, '--floors', 4, 'number of floors, with seeds from 0')
    command.add_count(parser, '--cycles', 60, 'gait cycles of a walk')
    command.add_processes(parser)
    options = parser.parse_args(words)
    seeds = list(range(options.floors))
    walks = [(seed, options.fidelity, options.cycles) for seed in seeds]
    floors = command.in_processes(on_floor, walks, options.processes, 'faults', 'floor')
    document = {
        'fidelity': options.fidelity,
        'cycles': options.cycles,
        'seeds': seeds,
        'faults': {name: [floor[name] for floor in floors] for name in FAULTS},
    }
    command.show(options, document, table(document))
    return 0

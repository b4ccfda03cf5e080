# SPDX-License-Identifier: Apache-2.0
"""What a fault of the air costs a walk, and what a slow hose does, with remedies and without.

``python bench/faults.py`` walks hexapod_patches and prints the tables of docs/model.md, "When a
pad fails"; about ten minutes.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence

import numpy as np
from tqdm import tqdm

from ros_pad.control import Choice
from ros_pad.control import LiftOff
from ros_pad.control import adaptive
from ros_pad.control.morphology import Policy
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.trial import Trial

SEEDS = range(4)
LEG = 2
# From the eighth second on; a pad that sticks domed does so from its first dome of the sound walk.
FAULTS = {
    'stuck flat': '{kind: stuck_valve, legs: [2]}',
    'stuck domed': '{kind: stuck_valve, legs: [2], start: %g}',
    'leak of 2.8 mm': '{kind: leak, legs: [2], start: 8.0, conductance: 1.0e-8}',
    'silent': '{kind: silence, legs: [2], start: 8.0}',
    'supply lost, all': '{kind: supply_loss, start: 8.0}',
    'supply lost for 20 s, all': '{kind: supply_loss, start: 8.0, end: 28.0}',
}
# Sonic conductance of the line, m³/(s Pa), by the time to 90 % that it gives with 2 mm x 1 m.
HOSES = {0.57: 7.7e-11, 1.25: 3.32e-11}


def early(policy: Policy) -> Policy:
    """Return a policy that fills a slow pad as many steps ahead as it needs."""

    def choose(step: LiftOff) -> Choice:
        likeliest = max(step.wet_ahead, step.wet_beyond)
        return policy(dataclasses.replace(step, wet_ahead=likeliest))

    return choose


def walked(
    scene: Scene, seed: int, fidelity: str, watched: bool = True, ahead: bool = False
) -> Trial:
    """Walk with adaptive feet; unwatched, the controller hears nothing of the pads."""
    loop = ClosedLoop(scene, 'adaptive', seed, fidelity)
    if not watched:
        loop.controller.observe = lambda *_: None  # type: ignore[method-assign]
    if ahead:
        loop.controller._policy = early(adaptive())
    log = TrialLog(scene, 'adaptive', seed, fidelity)
    for _ in range(round(scene.duration * 1e9) // loop.period_ns):
        loop.tick(log)
        if loop.robot.verdict:
            break
    loop.close()
    return log.finish(loop.robot, loop.controller, loop.floor, None)


def advance(trial: Trial) -> float:
    """Return the way a cycle, mm."""
    assert trial.metrics is not None
    if trial.metrics.verdict:
        raise ArithmeticError(f'seed {trial.seed}: {trial.metrics.verdict}')
    return 1e3 * trial.metrics.distance_per_cycle_m


def faults(scene: Scene, seeds: Sequence[int], fidelity: str) -> None:
    """Print the table of faults."""
    ways: dict[str, list[tuple[float, float, float]]] = {name: [] for name in FAULTS}
    found: dict[str, list[float]] = {name: [] for name in FAULTS}
    for seed in tqdm(seeds, unit='floor'):
        sound = walked(scene, seed, fidelity)
        domed = sound.slow_time[np.argmax(sound.dome[:, LEG - 1])] + 0.4
        for name, text in FAULTS.items():
            fault = Fault.parse(text % domed if '%' in text else text)
            broken = dataclasses.replace(scene, faults=(fault,))
            with_watch, without = (walked(broken, seed, fidelity, each) for each in (True, False))
            ways[name].append((advance(sound), advance(without), advance(with_watch)))
            assert with_watch.metrics is not None
            found[name] += [each['start'] for each in with_watch.metrics.faults[:1]]
    print(f'\n{fidelity}, {len(seeds)} floors, mm a cycle: sound, unwatched, watched; by floor')
    for name, rows in ways.items():
        sound, without, with_watch = np.mean(rows, axis=0)
        apart = ' '.join(f'{w:.0f}/{u:.0f}/{s:.0f}' for s, u, w in rows)
        print(
            f'{name:26} {sound:6.1f} {without:6.1f} {with_watch:6.1f}'
            f'  {100.0 * (with_watch / sound - 1.0):+5.1f} %  {apart}'
        )


def hoses(scene: Scene, seeds: Sequence[int], fidelity: str) -> None:
    """Print the table of slow hoses."""
    print(f'\n{fidelity}, {len(seeds)} floors, mm a cycle: as it is, filled early; by floor')
    for filling, conductance in HOSES.items():
        regulator = {
            'hose_diameter': 2e-3, 'hose_length': 1.0, 'hose_conductance': conductance,
        }  # fmt: skip
        slow = dataclasses.replace(scene, regulator=regulator)
        rows, lacking = [], []
        for seed in tqdm(seeds, unit='floor'):
            pair = []
            for ahead in (False, True):
                trial = walked(slow, seed, fidelity, ahead=ahead)
                assert trial.metrics is not None
                pair.append(advance(trial))
                lacking.append(sum(trial.metrics.underpressure))
                if trial.metrics.faults:
                    print(f'accused: {trial.metrics.faults}')
            rows.append(pair)
        before, after = np.mean(rows, axis=0)
        apart = ' '.join(f'{a:.0f}/{b:.0f}' for a, b in rows)
        print(
            f't90 {filling:4.2f} s  {before:6.1f} {after:6.1f}  {apart}  underpressure'
            f' {np.mean(lacking[::2]):.1f} {np.mean(lacking[1::2]):.1f}'
        )


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--only', choices=('faults', 'hoses'))
    parser.add_argument('--fidelity', choices=('L1', 'L2'), default='L2')
    parser.add_argument('--seeds', type=int, nargs='+', default=list(SEEDS))
    chosen = parser.parse_args()
    scene = Scene.load('hexapod_patches')
    if chosen.only != 'hoses':
        faults(scene, chosen.seeds, chosen.fidelity)
    if chosen.only != 'faults':
        hoses(scene, chosen.seeds, chosen.fidelity)
    return 0


if __name__ == '__main__':
    sys.exit(main())

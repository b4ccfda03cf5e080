# SPDX-License-Identifier: Apache-2.0
"""What a fault of the air costs a walk, and what a slow hose does, with remedies and without.

``python bench/faults.py`` walks hexapod_patches and prints the tables of docs/model.md, "When a
pad fails"; eight minutes on two cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
from concurrent.futures import ProcessPoolExecutor

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


def fault_ways(seed: int, fidelity: str) -> dict[str, tuple[float, float, float]]:
    """Return for each fault the advance sound, unwatched and watched, mm a cycle."""
    scene = Scene.load('hexapod_patches')
    sound = walked(scene, seed, fidelity)
    domed = sound.slow_time[np.argmax(sound.dome[:, LEG - 1])] + 0.4
    found = {}
    for name, text in FAULTS.items():
        fault = Fault.parse(text % domed if '%' in text else text)
        broken = dataclasses.replace(scene, faults=(fault,))
        with_watch, without = (walked(broken, seed, fidelity, each) for each in (True, False))
        assert with_watch.metrics is not None and with_watch.metrics.faults
        found[name] = advance(sound), advance(without), advance(with_watch)
    return found


def hose_ways(seed: int, fidelity: str) -> dict[str, tuple[float, float]]:
    """Return for each hose the advance as it is, and where pads are filled early."""
    scene = Scene.load('hexapod_patches')
    found = {}
    for filling, conductance in HOSES.items():
        regulator = {
            'hose_diameter': 2e-3, 'hose_length': 1.0, 'hose_conductance': conductance,
        }  # fmt: skip
        slow = dataclasses.replace(scene, regulator=regulator)
        pair = [walked(slow, seed, fidelity, ahead=ahead) for ahead in (False, True)]
        for trial in pair:
            assert trial.metrics is not None and not trial.metrics.faults  # slow is not faulty
        found[f'full to 90 % in {filling:g} s'] = advance(pair[0]), advance(pair[1])
    return found


def table(head: str, floors: list[dict[str, tuple[float, ...]]]) -> None:
    """Print means over floors, and each floor."""
    print(f'\n{head}')
    for name in floors[0]:
        rows = [floor[name] for floor in floors]
        means = '  '.join(f'{mean:6.1f}' for mean in np.mean(rows, axis=0))
        apart = ' '.join('/'.join(f'{each:.0f}' for each in row) for row in rows)
        print(f'{name:28} {means}   {apart}')


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--only', choices=('faults', 'hoses'))
    parser.add_argument('--fidelity', choices=('L1', 'L2'), default='L2')
    parser.add_argument('--seeds', type=int, nargs='+', default=list(SEEDS))
    chosen = parser.parse_args()
    means = f'{chosen.fidelity}, mm a cycle, means and floors {chosen.seeds}'
    tasks = {
        'faults': (fault_ways, f'{means}: sound, with the fault unwatched, watched'),
        'hoses': (hose_ways, f'{means}: as it is, pads filled early'),
    }
    fidelities = itertools.repeat(chosen.fidelity)
    with ProcessPoolExecutor(2) as pool:
        for name, (task, head) in tasks.items():
            if chosen.only in (None, name):
                floors = pool.map(task, chosen.seeds, fidelities)
                total = len(chosen.seeds)
                table(head, list(tqdm(floors, desc=name, total=total, unit='floor')))
    return 0


if __name__ == '__main__':
    sys.exit(main())

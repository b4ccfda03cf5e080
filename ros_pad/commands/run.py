# SPDX-License-Identifier: Apache-2.0
"""``pad run``: walk a scene in closed loop."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import pathlib
from collections.abc import Iterator
from typing import Any

from ros_pad.commands.bench import run_bench
from ros_pad.commands.command import INTERRUPTED
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.contact import Foot
from ros_pad.control import POLICIES
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.simulation import bench
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials import Trial
from ros_pad.trials import label as labels
from ros_pad.trials import loop
from ros_pad.trials import report
from ros_pad.trials.bag import annotate
from ros_pad.trials.trial import told

_DISCOVERY = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'run',
        run,
        'Walk a scene in closed loop on ROS 2 nodes, record a bag and write a report; of a bench '
        'scene, draw the figures of the thesis.',
        'pad run hexapod_patches --seed 3',
    )
    part.add_argument('scene', metavar='SCENE', help='name of a scene, or path of a YAML file')
    part.add_argument(
        '--foot', help="a foot other than the scene's: a name in config/feet or a YAML file"
    )
    part.add_argument(
        '--policy', choices=POLICIES, help="how shapes are chosen (default: the scene's own way)"
    )
    part.add_argument('--seed', type=int, default=0, help='of floor and noise (default 0)')
    part.add_argument('--cycles', type=int, help="gait cycles (default: the scene's own)")
    part.add_argument(
        '--fidelity',
        choices=ladder.FIDELITIES,
        default='auto',
        help='L0 is the leg on its rail, L1 the hexapod in the plane, L2 the hexapod with joints '
        '(MuJoCo); auto (default) takes the cheapest that is accurate enough for the scene',
    )
    part.add_argument('--no-ros', action='store_true', help='without nodes and bag, much faster')
    part.add_argument(
        '--no-compare',
        action='store_true',
        help='do not run the other policies on the same ground (an adaptive run does)',
    )
    part.add_argument(
        '--live',
        action='store_true',
        help='let other processes on this machine hear the topics, and be heard: '
        'real regulators in the same ROS domain would obey',
    )
    part.add_argument(
        '--out', type=pathlib.Path, metavar='DIR', help='new folder (default: runs/<scene>_...)'
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Walk the scene, or work out the bench; return the exit status."""
    scene = bench.load(options.scene)
    if isinstance(scene, bench.BenchScene):
        return run_bench(options, options.scene)
    if options.cycles is not None:
        if not 1 <= options.cycles <= 100000:
            raise InvalidInput(f'--cycles {options.cycles}: from 1 to 100000 are needed')
        scene = dataclasses.replace(scene, cycles=options.cycles)
    if options.foot is not None:
        scene = _on_foot(scene, Foot.load(options.foot))
    if not 0 <= options.seed < 2**31:
        raise InvalidInput(
            f'--seed {options.seed}: a whole number from 0 to {2**31 - 1} is needed'
        )
    policy = options.policy or scene.policy
    rung = ladder.rung(scene, options.fidelity, policy)
    folder = new_folder(options.out, f'{scene.name}_{policy}_seed{options.seed}')
    try:
        return _run_in(folder, options, scene, policy, rung)
    except KeyboardInterrupt:
        bag = folder / 'bag'
        if not bag.exists():
            raise
        return complain(
            f'stopped: the bag is complete, pad report {bag} makes its page', INTERRUPTED
        )
    finally:
        with contextlib.suppress(OSError):  # nothing came of it: the name stays free
            folder.rmdir()


def _on_foot(scene: Scene, foot: Foot) -> Scene:
    if scene.dome_pressure is not None and scene.dome_pressure > foot.ceiling:
        raise InvalidInput(
            f'--foot {foot.source}: its ceiling of {foot.ceiling:g} Pa is below the dome_pressure'
            f' of {scene.name}, {scene.dome_pressure:g} Pa'
        )
    return dataclasses.replace(scene, foot=foot)


def _run_in(
    folder: pathlib.Path, options: argparse.Namespace, scene: Scene, policy: str, rung: str
) -> int:
    if options.no_ros:
        trial, bag = _walk(scene, policy, options.seed, rung, f'{policy}, without ROS'), None
    else:
        bag = folder / 'bag'
        trial = _walk_on_nodes(scene, policy, options.seed, rung, bag, options.live)
        if trial.settings['interrupted']:
            return complain(
                f'stopped at {trial.metrics.duration_s:.1f} s of {scene.duration:.1f} s:'  # type: ignore[union-attr]
                f' pads vented, bag closed: {bag}',
                INTERRUPTED,
            )
    others = []
    if policy == 'adaptive' and not options.no_compare:
        others = [
            _walk(scene, other, options.seed, rung, f'{other:8} on the same ground')
            for other in POLICIES
            if other != policy
        ]
    assert trial.metrics is not None
    trial.settings['comparison'] = [
        {'policy': other.policy, **other.metrics.as_dict()}
        for other in others
        if other.metrics is not None
    ]
    if bag is not None:
        annotate(
            bag,
            labels.label(
                scene,
                policy,
                options.seed,
                rung,
                metrics=trial.metrics,
                real_time_factor=trial.real_time_factor,
                comparison=trial.settings['comparison'],
            ),
        )
    page = folder / 'report.html'
    with bar('report', 1.0, 'page') as progress:
        report.write(trial, page, progress=progress)
    summary = _summary(trial, bag, page)
    (folder / 'summary.json').write_text(json.dumps(summary, indent=1), encoding='utf-8')
    if options.json:
        print(json.dumps(summary))
    else:
        _show(trial, bag, page)
    if trial.metrics.verdict:
        return complain(f'the walk ended early: {trial.metrics.verdict}', 1)
    return 0


def _walk(scene: Scene, policy: str, seed: int, rung: str, text: str) -> Trial:
    with bar(text, scene.duration) as progress:
        return loop.run(scene, policy, seed, rung, progress)


def _walk_on_nodes(
    scene: Scene, policy: str, seed: int, rung: str, bag: pathlib.Path, live: bool
) -> Trial:
    try:
        from ros_pad.nodes import composed
    except ModuleNotFoundError as error:
        raise PadError(
            f'ROS 2 is not here ({error}): source it, or pip install "ros_pad[ros]",'
            ' or walk without it: --no-ros'
        ) from error
    with (
        contextlib.nullcontext() if live else _alone(),
        bar(f'{policy}, on ROS 2 nodes', scene.duration) as progress,
    ):
        return composed.run(scene, policy, seed, rung, bag=bag, progress=progress)


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """Let this process talk to itself alone: no real regulator hears its set-points."""
    before = os.environ.get(_DISCOVERY)
    os.environ[_DISCOVERY] = 'OFF'
    try:
        yield
    finally:
        if before is None:
            del os.environ[_DISCOVERY]
        else:
            os.environ[_DISCOVERY] = before


def _summary(trial: Trial, bag: pathlib.Path | None, page: pathlib.Path) -> dict[str, Any]:
    own = trial.metrics
    assert own is not None
    return {
        'scene': trial.scene,
        'policy': trial.policy,
        'seed': trial.seed,
        'fidelity': trial.fidelity,
        'fidelity_bound': None if own.verdict else trial.settings['fidelity_bound'],
        'fidelity_note': labels.promise(trial),
        'foot': trial.settings['foot'],
        'faults': trial.settings['faults'],
        **own.as_dict(),
        'real_time_factor': trial.real_time_factor,
        'bag': str(bag) if bag else None,
        'report': str(page),
        'omitted': trial.settings['omitted'],
        'comparison': trial.settings['comparison'],
    }


def _show(trial: Trial, bag: pathlib.Path | None, page: pathlib.Path) -> None:
    own = trial.metrics
    assert own is not None
    print(
        f'\n{trial.scene}, seed {trial.seed}, {trial.fidelity}: {own.distance_m:.2f} m in'
        f' {own.cycles:.3g} cycles, {trial.real_time_factor:.1f} times real time'
    )
    print(f'fidelity: {labels.promise(trial)}\n')
    rows = [{'policy': trial.policy, **own.as_dict()}, *trial.settings['comparison']]
    for row in rows:
        if row.get('goal_m') is not None:
            seconds = row['time_to_goal_s']
            after = 'not reached' if seconds is None else f'after {seconds:.1f} s'
            print(f'{row["policy"]}: goal of {row["goal_m"]:g} m {after}')
    print(f'policy      mm/cycle  against {trial.policy:8}   slip path per foot   switches')
    for row in rows:
        advance = row['distance_per_cycle_m']
        gain = (
            f'{round(100.0 * (advance / own.distance_per_cycle_m - 1.0)):+d} %'
            if row is not rows[0] and own.distance_per_cycle_m
            else ''
        )
        slip = sum(row['slip_path_m']) / len(row['slip_path_m'])
        print(
            f'{row["policy"]:10} {1e3 * advance:9.1f}  {gain:>16}'
            f' {slip:18.2f} m {sum(row["switches"]):10d}'
        )
    for refusal in own.refusals:
        print(f'stayed flat: {refusal}')
    for fault in told(own.faults):
        print(f'fault: {fault}')
    for omission in trial.settings['omitted']:
        bound = omission['bound']
        most = 'no bound known' if bound is None else f'at most {100.0 * bound:.1f} %'
        print(f'left out: {omission["term"]} ({most})')
    if bag:
        print(f'bag:      {bag}')
    print(f'report:   {page}')

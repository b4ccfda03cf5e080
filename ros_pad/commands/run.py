# SPDX-License-Identifier: Apache-2.0
"""Walk a scene in closed loop on ROS 2 nodes, record a bag and write a report.

For a bench scene, draw the figures of the thesis.

For example:
  pad run hexapod_patches --seed 3
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import os
import pathlib
from collections.abc import Callable, Iterator
from typing import Any

from ros_pad.commands.command import FILE, FOLDER, Commands, add_command, complain, print_table
from ros_pad.commands.folder import kept_if_filled, new_folder
from ros_pad.commands.progress import bar
from ros_pad.commands.study import run_study
from ros_pad.configuration import integer, number
from ros_pad.contact import Foot
from ros_pad.control import POLICIES
from ros_pad.errors import ConfigError, InvalidInput, PadError
from ros_pad.estimation.tuning import SOURCES, Tuning
from ros_pad.signals import INTERRUPTED, STOP
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.robot import check_reach
from ros_pad.simulation.scene import Scene, is_bench
from ros_pad.trials import Metrics, Trial, bag_notes, learnt, loop, other_policies
from ros_pad.trials.node_settings import tuning_for
from ros_pad.trials.trial import fault_lines

_DISCOVERY = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'run', run, __doc__)
    add = part.add_argument
    add('scene', metavar='SCENE', help='name of a scene, or path of a YAML file')
    add('--foot', help="other than the scene's: a name in config/feet or a YAML file")
    add('--out', help='new folder for the results (default: runs/<scene>_...)', **FOLDER)
    add('--json', action='store_true', help='print one JSON object')
    add = part.add_argument_group('walk').add_argument
    levels_text = (
        'L0: leg on a rail, L1: in the plane, L2: with joints; auto: cheapest that will do'
    )
    sensing_text = (
        'what slip is estimated from: motion capture of the feet, or IMU, joints and forces (L2)'
    )
    compare_text = 'walk this policy alone, and not the others on the same ground as well'
    live_text = 'share the topics with the whole subnet, where real regulators get set-points'
    policy_text = "always flat or dome, by estimates, or by the true ground (default: the scene's)"
    of_a_walk = [
        add('--policy', choices=POLICIES, help=policy_text),
        add('--cycles', type=int, help="gait cycles (default: the scene's)"),
        add('--seed', type=int, default=0, help='seed of floor and noise (default 0)'),
        add('--fidelity', choices=levels.FIDELITIES, default='auto', help=levels_text),
        add('--sensing', choices=SOURCES, default='markers', help=sensing_text),
        add('--learnt', help='begin with the friction of learnt.yaml of an earlier trial', **FILE),
        add('--no-ros', action='store_true', help='walk without nodes and bag; much faster'),
        add('--no-compare', action='store_true', help=compare_text),
        add('--live', action='store_true', help=live_text),
    ]
    part.set_defaults(of_a_walk=of_a_walk)


def run(options: argparse.Namespace) -> int:
    """Walk the scene, or run the study of a bench scene; return the exit status."""
    if is_bench(options.scene):
        _refuse_walk(options, f'{options.scene} is a bench scene, in which nothing walks')
        given = {name: getattr(options, name) for name in ('foot', 'out', 'json')}
        return run_study('bench', options.scene, **given)
    scene = Scene.load(options.scene)
    if options.cycles is not None:
        cycles = integer('--cycles', options.cycles, 1, 100000)
        scene = dataclasses.replace(scene, cycles=cycles)
    if options.foot is not None:
        foot = Foot.load(options.foot)
        if scene.dome_pressure is not None:
            what = f'--foot {foot.source}: dome_pressure of {scene.name}'
            number(what, scene.dome_pressure, 'Pa', high=foot.ceiling)
        scene = dataclasses.replace(scene, foot=foot)
    options.tuning = tuning_for(scene, options.sensing)
    if options.learnt is not None:
        known = learnt.load(options.learnt, scene.foot.source)
        options.tuning = Tuning.of(options.tuning.values | known)
    integer('--seed', options.seed, 0, 2**31 - 1)
    policy = options.policy or scene.policy
    joints = options.sensing == 'joints'
    if options.fidelity == 'auto' and not joints and (promise := levels.answer(scene, policy)):
        return _answer(options, scene, policy, promise)
    level = levels.level(scene, options.fidelity, policy, joints)
    if level != 'L0':
        check_reach(scene)  # before there is a folder
    suffix = '_joints' if joints else ''
    folder = new_folder(options.out, f'{scene.name}_{policy}_seed{options.seed}{suffix}')
    policies = () if options.no_compare or policy != 'adaptive' else POLICIES
    compared = [each for each in policies if each != policy]
    try:
        # Real regulators may wait for set-points: nothing else takes their time.
        with (
            kept_if_filled(folder),
            other_policies.beside(
                scene, compared, options.seed, level, options.sensing, options.tuning, options.live
            ) as compare,
        ):
            return _walk(compare, folder, options, (scene, policy, options.seed, level))
    except KeyboardInterrupt:
        bag = folder / 'bag'
        if not bag.exists():
            raise
        return complain(
            f'stopped: the bag is complete, pad report {bag} writes its report', INTERRUPTED
        )


def _refuse_walk(options: argparse.Namespace, why: str, *allowed: str) -> None:
    """Raise InvalidInput for an option of a walk that is not at its default."""
    for each in options.of_a_walk:
        if each.dest not in allowed and getattr(options, each.dest) != each.default:
            raise InvalidInput(f'{each.option_strings[0]} is not allowed: {why}')


def _answer(
    options: argparse.Namespace, scene: Scene, policy: str, known: levels.ChosenLevel
) -> int:
    """Print the distance of a scene that needs no walk; refuse options of a walk."""
    walks = f'--fidelity {levels.level(scene, policy=policy)} walks it'
    why = f'{scene.name} requires its {scene.metric} alone, for which nothing is simulated'
    _refuse_walk(options, f'{why}; {walks}', 'policy', 'cycles')
    if options.out:
        raise InvalidInput(f'--out is not allowed: {why}; {walks}')
    far = levels.sticking_distance(scene)
    if options.json:
        found = {'distance_m': far, 'bound': known.bound, 'note': known.note}
        print(json.dumps({'scene': scene.source, 'fidelity': known.level} | found))
        return 0
    print(f'{scene.name}, {known.level}: {far:.3g} m in {scene.cycles} cycles')
    print(f'fidelity: {known.note}; {walks}')
    return 0


def _walk(
    compare: Callable[[other_policies.Bar], dict[str, Metrics]],
    folder: pathlib.Path,
    options: argparse.Namespace,
    given: tuple[Scene, str, int, str],
) -> int:
    """Walk scene, policy, seed and level of ``given``; write report and summary."""
    scene, policy = given[:2]
    bag = None if options.no_ros else folder / 'bag'
    if bag is None:
        with bar(f'{policy}, without ROS', scene.duration) as progress:
            trial = loop.run(*given, progress, options.tuning, sensing=options.sensing)
    else:
        trial = _walk_on_nodes(given, bag, options)
    assert trial.metrics is not None
    if bag is not None and trial.settings['interrupted']:
        return complain(
            f'stopped at {trial.metrics.duration_s:.1f} s of {scene.duration:.1f} s:'
            f' pads vented, bag closed: {bag}',
            INTERRUPTED,
        )
    learnt.save(folder / learnt.FILE, trial.settings['learnt'], scene.foot)
    trial.settings['comparison'] = [
        {'policy': other, **metrics.as_dict()} for other, metrics in compare(bar).items()
    ]
    if bag is not None:
        bag_notes.note(bag, trial)
    page = _write_report(trial, folder / 'report.html')
    summary = _summary(trial, bag, page)
    (folder / 'summary.json').write_text(json.dumps(summary, indent=1), encoding='utf-8')
    if options.json:
        print(json.dumps(summary))
    else:
        _show(trial, trial.metrics)
        if bag:
            print(f'bag:      {bag}')
        print(f'report:   {page or "none: without Matplotlib there are no pictures"}')
    if trial.metrics.verdict:
        return complain(f'the walk ended early: {trial.metrics.verdict}', 1)
    return 0


def _walk_on_nodes(
    given: tuple[Scene, str, int, str], bag: pathlib.Path, options: argparse.Namespace
) -> Trial:
    scene, policy, _, _ = given
    try:
        with STOP.deferred():  # an exception in the midst of imports may be dropped
            from ros_pad.nodes import composed
    except ModuleNotFoundError as error:
        raise PadError(
            f'ROS 2 is not found ({error}): source its setup.bash, or'
            ' pip install "ros_pad[ros]", or run without ROS: --no-ros'
        ) from error
    with (
        contextlib.nullcontext() if options.live else _alone(),
        bar(f'{policy}, on ROS 2 nodes', scene.duration) as progress,
    ):
        return composed.run(
            *given, bag=bag, progress=progress, sensing=options.sensing, tuning=options.tuning
        )


def _write_report(trial: Trial, page: pathlib.Path) -> pathlib.Path | None:
    """Write the report and return its path; without Matplotlib return None."""
    try:
        with STOP.deferred():
            from ros_pad.reports import report
    except ConfigError as error:
        complain(error, 0)
        return None
    with bar('report', 1.0, 'page'):
        report.write(trial, page)
    return page


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """Hide the topics of this process, so that no real regulator receives the set-points."""
    before = os.environ.get(_DISCOVERY)
    os.environ[_DISCOVERY] = 'OFF'
    try:
        yield
    finally:
        del os.environ[_DISCOVERY]
        if before is not None:
            os.environ[_DISCOVERY] = before


def _summary(trial: Trial, bag: pathlib.Path | None, page: pathlib.Path | None) -> dict[str, Any]:
    own, settings = trial.metrics, trial.settings
    assert own is not None
    return {
        **{name: getattr(trial, name) for name in ('scene', 'policy', 'seed', 'fidelity')},
        'fidelity_bound': None if own.verdict else settings['fidelity_bound'],
        'fidelity_note': bag_notes.promise(trial),
        **{name: settings[name] for name in ('sensing', 'foot')},
        **own.as_dict(),
        # After the metrics, whose faults are those that the controller found.
        **{name: settings[name] for name in ('learnt', 'omitted', 'taken', 'comparison')},
        'real_time_factor': trial.real_time_factor,
        'bag': str(bag) if bag else None,
        'report': str(page) if page else None,
    }


def _show(trial: Trial, own: Metrics) -> None:
    settings = trial.settings
    accuracy, bound = bag_notes.promise(trial), settings['fidelity_bound']
    if bound is not None and not own.verdict:
        most = f'at most {math.ceil(1e3 * bound) / 10.0:.1f} % beside the finest simulation'
        accuracy = f'{most}, in 95 of 100 scenes like this one'
    print(
        f'\n{trial.scene}, seed {trial.seed}, simulated on level {trial.fidelity}:'
        f' {own.distance_m:.2f} m in {own.cycles:.3g} gait cycles\nnumerical error: {accuracy}\n'
    )
    table: list[list[str]] = []
    for row in ({'policy': trial.policy, **own.as_dict()}, *settings['comparison']):
        advance, seconds = row['distance_per_cycle_m'], row.get('time_to_goal_s')
        gain = ''
        if table and own.distance_per_cycle_m:
            gain = f'{100.0 * (advance / own.distance_per_cycle_m - 1.0):+z.0f} %'
        slip = sum(row['slip_path_m']) / len(row['slip_path_m'])
        changes = sum(row['switches'])
        feet = _FEET[row['policy']] + (f', {changes} changes' if changes else '')
        if row.get('goal_m') is not None:
            after = 'not reached' if seconds is None else f'after {seconds:.1f} s'
            feet += f'; goal of {row["goal_m"]:g} m {after}'
        table.append([row['policy'], f'{1e3 * advance:.1f} mm', gain, f'{slip:.2f} m', feet])
    print_table(['policy', 'a gait cycle', f'beside {trial.policy}', 'slip of a foot', ''], table)
    matters = [each for each in settings['omitted'] if each['exceeds']]
    text = 'left out, and it matters: {term}, about {effect:.1%} of the result'
    print(
        *(f'stayed flat: {refusal}' for refusal in own.refusals),
        *(f'fault: {fault}' for fault in fault_lines(own.faults)),
        *(text.format(**each).replace('%', ' %') for each in matters),
        sep='\n',
    )


_FEET = {
    'adaptive': 'by what feet felt',
    'flat': 'always flat',
    'dome': 'always domes',
    'oracle': 'sees the ground ahead',
}

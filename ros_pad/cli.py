# SPDX-License-Identifier: Apache-2.0
"""The ``pad`` command."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pathlib
import signal
import sys
import threading
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import suppress
from typing import Any

from tqdm import tqdm

import ros_pad
from ros_pad import configuration
from ros_pad import contact
from ros_pad.control import POLICIES
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium
from ros_pad.errors import PadError
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials import Trial
from ros_pad.trials import label as labels
from ros_pad.trials import loop
from ros_pad.trials import recorded
from ros_pad.trials import report
from ros_pad.trials.bag import BagReader
from ros_pad.trials.bag import annotate

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status.

    Returns
    -------
    int
        0 done, 1 a failure at run time, 2 bad usage or input, 130 stopped by Ctrl-C.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _stop)
    try:
        return int(options.command(options))
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python must not complain of it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ConfigError, InvalidInput) as error:
        return _complain(error, 2)
    except (PadError, OSError) as error:
        return _complain(error, 1)
    except KeyboardInterrupt:
        return _complain('stopped', INTERRUPTED)


def _stop(number: int, frame: Any) -> None:
    raise KeyboardInterrupt


def _complain(error: object, status: int) -> int:
    print(f'pad: {error}', file=sys.stderr)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='pad',
        description='Shape-changing feet for legged robots: simulate, record, look. '
        'All values are in SI units; pressures are gauge.',
    )
    parser.add_argument('--version', action='version', version=f'ros_pad {ros_pad.__version__}')
    commands = parser.add_subparsers(title='commands', required=True, metavar='COMMAND')

    def command(
        name: str, run: Callable[[argparse.Namespace], int], text: str, example: str
    ) -> argparse.ArgumentParser:
        part = commands.add_parser(
            name,
            help=text,
            description=text,
            epilog=f'example: {example}',
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        part.set_defaults(command=run)
        return part

    part = command(
        'run',
        _run,
        'Walk a scene in closed loop on ROS 2 nodes, record a bag and write a report.',
        'pad run hexapod_patches --seed 3',
    )
    part.add_argument('scene', metavar='SCENE', help='name of a scene, or path of a YAML file')
    part.add_argument('--policy', choices=POLICIES, help="default: the scene's own")
    part.add_argument('--seed', type=int, default=0, help='of floor and noise (default 0)')
    part.add_argument('--cycles', type=int, help="gait cycles (default: the scene's own)")
    part.add_argument('--fidelity', choices=ladder.FIDELITIES, default='auto')
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

    part = command('scenes', _scenes, 'List the scenes.', 'pad scenes')
    part.add_argument('--json', action='store_true', help='print one JSON object')

    part = command(
        'report', _report, 'Write the HTML report of a bag.', 'pad report runs/first/bag'
    )
    part.add_argument('bag', metavar='BAG', type=pathlib.Path, help='folder of a bag')
    part.add_argument(
        '--out', type=pathlib.Path, metavar='FILE', help='default: report.html beside the bag'
    )
    part.add_argument('--force', action='store_true', help='replace a report that is there')

    part = command('bag', _bag_info, 'Say what is in a bag.', 'pad bag info runs/first/bag')
    part.add_argument('action', choices=('info',))
    part.add_argument('bag', metavar='BAG', type=pathlib.Path, help='folder of a bag')
    part.add_argument('--json', action='store_true', help='print one JSON object')

    part = command(
        'contact',
        _contact,
        'Shape of a pad at a pressure, free or pressed, and its force limits.',
        'pad contact --pressure 75000 --force 0.1',
    )
    part.add_argument('--pressure', type=float, required=True, metavar='PA', help='gauge, Pa')
    part.add_argument('--force', type=float, default=0.0, metavar='N', help='on the pad, N')
    part.add_argument('--pad', choices=('large', 'small'), default='large')
    part.add_argument('--liquid', choices=('water', 'thesis'), default='water')
    part.add_argument('--json', action='store_true', help='print one JSON object')
    return parser


@contextmanager
def _bar(text: str, total: float, unit: str = 's') -> Iterator[Callable[[float], None]]:
    """Show a progress bar on stderr; yield what tells it how far things are."""
    shape = '{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} [{elapsed}<{remaining}]'
    with tqdm(total=total, desc=text, unit=unit, bar_format=shape, file=sys.stderr) as bar:

        def reach(place: float) -> None:
            bar.update(place - bar.n)

        yield reach
        reach(total)


def _run(options: argparse.Namespace) -> int:
    scene = Scene.load(options.scene)
    if options.cycles is not None:
        if not 1 <= options.cycles <= 100000:
            raise InvalidInput(f'--cycles {options.cycles}: from 1 to 100000 are needed')
        scene = dataclasses.replace(scene, cycles=options.cycles)
    if not 0 <= options.seed < 2**31:
        raise InvalidInput(
            f'--seed {options.seed}: a whole number from 0 to {2**31 - 1} is needed'
        )
    policy = options.policy or scene.policy
    rung = ladder.rung(scene, options.fidelity)
    folder = _new_folder(options.out, f'{scene.name}_{policy}_seed{options.seed}')
    try:
        return _run_in(folder, options, scene, policy, rung)
    except KeyboardInterrupt:
        bag = folder / 'bag'
        if not bag.exists():
            raise
        return _complain(
            f'stopped: the bag is complete, pad report {bag} makes its page', INTERRUPTED
        )
    finally:
        with suppress(OSError):  # nothing came of it: the name stays free
            folder.rmdir()


def _run_in(
    folder: pathlib.Path, options: argparse.Namespace, scene: Scene, policy: str, rung: str
) -> int:
    if options.no_ros:
        trial, bag = _walk(scene, policy, options.seed, f'{policy}, without ROS'), None
    else:
        bag = folder / 'bag'
        trial = _walk_on_nodes(scene, policy, options.seed, bag, options.live)
        if trial.settings['interrupted']:
            return _complain(
                f'stopped at {trial.metrics.duration_s:.1f} s of {scene.duration:.1f} s:'  # type: ignore[union-attr]
                f' pads vented, bag closed: {bag}',
                INTERRUPTED,
            )
    others = []
    if policy == 'adaptive' and not options.no_compare:
        others = [
            _walk(scene, other, options.seed, f'{other:8} on the same ground')
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
    with _bar('report', 1.0, 'page') as progress:
        report.write(trial, page, progress=progress)
    summary = _summary(trial, bag, page)
    (folder / 'summary.json').write_text(json.dumps(summary, indent=1), encoding='utf-8')
    if options.json:
        print(json.dumps(summary))
    else:
        _show(trial, bag, page)
    if trial.metrics.verdict:
        return _complain(f'the walk ended early: {trial.metrics.verdict}', 1)
    return 0


def _new_folder(wanted: pathlib.Path | None, name: str) -> pathlib.Path:
    """Make the folder that is wanted, or the next free one below ``runs``."""
    if wanted is not None:
        try:
            wanted.mkdir(parents=True)
        except FileExistsError:
            raise InvalidInput(
                f'--out {wanted}: exists already, and nothing is ever overwritten'
            ) from None
        return wanted
    number = 1
    while True:
        folder = pathlib.Path('runs') / (name if number == 1 else f'{name}_{number}')
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
        else:
            return folder


def _walk(scene: Scene, policy: str, seed: int, text: str) -> Trial:
    with _bar(text, scene.duration) as progress:
        return loop.run(scene, policy, seed, progress=progress)


def _walk_on_nodes(scene: Scene, policy: str, seed: int, bag: pathlib.Path, live: bool) -> Trial:
    if not live:
        # One process talks to itself: no other node, and no real regulator, hears a set-point.
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    try:
        from ros_pad.nodes import composed
    except ModuleNotFoundError as error:
        raise PadError(
            f'ROS 2 is not here ({error}): source it, or pip install "ros_pad[ros]",'
            ' or walk without it: --no-ros'
        ) from error
    with _bar(f'{policy}, on ROS 2 nodes', scene.duration) as progress:
        return composed.run(scene, policy, seed, bag=bag, progress=progress)


def _summary(trial: Trial, bag: pathlib.Path | None, page: pathlib.Path) -> dict[str, Any]:
    assert trial.metrics is not None
    return {
        'scene': trial.scene,
        'policy': trial.policy,
        'seed': trial.seed,
        'fidelity': trial.fidelity,
        **trial.metrics.as_dict(),
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
        f' {own.cycles:.0f} cycles, {trial.real_time_factor:.1f} times real time\n'
    )
    print('policy      mm/cycle  against adaptive   slip path per foot   switches')
    rows = [{'policy': trial.policy, **own.as_dict()}, *trial.settings['comparison']]
    for row in rows:
        advance = row['distance_per_cycle_m']
        gain = (
            f'{100.0 * (advance / own.distance_per_cycle_m - 1.0):+.0f} %'
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
    for omission in trial.settings['omitted']:
        bound = '' if omission['bound'] is None else f' (at most {100 * omission["bound"]:.1f} %)'
        print(f'left out: {omission["term"]}{bound}')
    if bag:
        print(f'bag:      {bag}')
    print(f'report:   {page}')


def _scenes(options: argparse.Namespace) -> int:
    scenes = [Scene.load(name) for name in configuration.names('scenes')]
    if options.json:
        print(
            json.dumps(
                {
                    scene.name: {
                        'description': scene.description,
                        'policy': scene.policy,
                        'fidelity': ladder.rung(scene),
                        'duration_s': scene.duration,
                    }
                    for scene in scenes
                }
            )
        )
        return 0
    width = max(len(scene.name) for scene in scenes)
    for scene in scenes:
        print(
            f'{scene.name:{width}}  {ladder.rung(scene)}  {scene.policy:8}'
            f' {scene.duration:4.0f} s  {scene.description}'
        )
    return 0


def _report(options: argparse.Namespace) -> int:
    page = options.out or options.bag / '..' / 'report.html'
    page = pathlib.Path(os.path.normpath(page))
    if not options.bag.exists():
        raise BagError(f'{options.bag}: no such bag')
    if page.exists() and not options.force:
        raise InvalidInput(f'{page}: exists already; --force replaces it, --out names another')
    with _bar('reading', 1.0, 'bag') as progress:
        trial = recorded.load(options.bag, progress=progress)
    with _bar('report', 1.0, 'page') as progress:
        report.write(trial, page, force=options.force, progress=progress)
    print(page)
    return 0


def _bag_info(options: argparse.Namespace) -> int:
    reader = BagReader(options.bag)
    about = json.loads(reader.custom_data.get(labels.KEY, '{}'))
    if options.json:
        print(
            json.dumps(
                {
                    'bag': str(options.bag),
                    'start_ns': reader.start,
                    'duration_s': (reader.end - reader.start) * 1e-9,
                    'messages': reader.message_count,
                    'topics': {
                        name: {'type': kind, 'messages': reader.counts[name]}
                        for name, kind in reader.topics.items()
                    },
                    'problem': reader.problem,
                    'trial': about,
                }
            )
        )
        return 0
    print(f'{options.bag}: {reader.message_count} messages in', end=' ')
    print(f'{(reader.end - reader.start) * 1e-9:.2f} s')
    if about:
        print(f'scene {about["scene"]}, policy {about["policy"]}, seed {about["seed"]}')
    for name in sorted(reader.topics):
        print(f'{reader.counts[name]:8d}  {name}  {reader.topics[name]}')
    if reader.problem:
        return _complain(reader.problem, 1)
    return 0


def _contact(options: argparse.Namespace) -> int:
    pad = contact.LARGE_PAD if options.pad == 'large' else contact.SMALL_PAD
    liquid = contact.WATER if options.liquid == 'water' else contact.THESIS_LIQUID
    pressure, force = options.pressure, options.force
    values: dict[str, Any] = {'pad': options.pad, 'pressure_pa': pressure, 'force_n': force}
    try:
        free = contact.inflate(pad, pressure)
        values['free'] = {
            'height_m': free.height,
            'sphere_radius_m': free.sphere_radius,
            'volume_m3': free.volume,
        }
        pressed = contact.press(pad, pressure, force)
        values['pressed'] = {
            'height_m': pressed.height,
            'depth_m': pressed.depth,
            'contact_radius_m': pressed.contact_radius,
            'sphere_radius_m': pressed.sphere_radius,
            'gap_m': pressed.gap,
            'status': pressed.status,
        }
        if force > 0.0:  # the ring of a dome that only touches has no size to speak of
            wet = contact.meniscus(pressed, liquid)
            values['meniscus'] = {
                'height_m': wet.height,
                'ring_radius_m': wet.ring_radius,
                'tangential_force_n': wet.tangential_force,
                'status': wet.status,
            }
        else:
            values['meniscus'] = {'status': 'no_contact'}
        values['force_limit_n'] = {
            criterion: contact.force_limit(pad, pressure, criterion)
            for criterion in ('measured', 'max_depth', 'flattening')
        }
    except NoEquilibrium as error:
        return _complain(f'{error} (status {error.status})', 1)
    if options.json:
        print(json.dumps(values))
        return 0
    print(f'{options.pad} pad, {pressure:g} Pa gauge, {force:g} N')
    for part in ('free', 'pressed', 'meniscus', 'force_limit_n'):
        print(part.replace('_n', ' / N').replace('_', ' '))
        for name, value in values[part].items():
            shown = value if isinstance(value, str) else f'{value:.6g}'
            print(f'  {name:20} {shown}')
    return 0


if __name__ == '__main__':
    sys.exit(main())

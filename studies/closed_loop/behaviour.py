# SPDX-License-Identifier: Apache-2.0
"""Compare the metrics of every scene and of a replay before and after a change of the code.

Runs every shipped scene without ROS, walks with seed 3 (``pad run``), and replays the shipped bag
(``pad replay``). Writes behaviour.json with all numbers in SI units, without texts and the speed
of the run. With ``--against FILE``, it lists every number that differs from an older file, and the
exit status is 1 if there are differences. Compare only files from one machine and one set of
packages.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

from ros_pad.errors import PadError
from ros_pad.simulation.fidelity import answer
from ros_pad.simulation.scene import Scene
from studies import command

SCENES = sorted(path.stem for path in command.ROOT.glob('config/scenes/*.yaml'))
REPLAY, BAG = 'replay', command.ROOT / 'bags' / 'hexapod_patches' / 'bag'
OPTIONS = ('--no-ros', '--no-compare', '--seed', '3')  # for walks; bench scenes take none of them
DROPPED = ('real_time_factor',)


def behaviour(case: str, cycles: int | None) -> Any:
    """Return the numbers that ``pad`` prints for a scene, or for the replay.

    Raises
    ------
    PadError
        When ``pad`` prints nothing, or ends with another status than 0 or 1.
    """
    words = ['replay', str(BAG)] if case == REPLAY else ['run', case]
    with tempfile.TemporaryDirectory() as folder:
        out = ['--out', str(pathlib.Path(folder) / 'out')]
        if case != REPLAY and not case.startswith('bench_'):
            scene = Scene.load(case)
            scene = dataclasses.replace(scene, cycles=cycles or scene.cycles)
            if answer(scene, scene.policy):
                out = []  # nothing is simulated, so seed and folder are refused
            else:
                words += OPTIONS
            words += ['--cycles', str(scene.cycles)]
        words += ['--json', *out]
        found = subprocess.run(
            [sys.executable, '-m', 'ros_pad', *words],
            capture_output=True, text=True, cwd=command.ROOT,
        )  # fmt: skip
    if found.returncode not in (0, 1) or not found.stdout:
        raise PadError(
            f'"pad {" ".join(words)}" ended with status {found.returncode} and printed'
            f' {len(found.stdout)} characters: status 0 or 1 and JSON are needed; end of stderr:'
            f' {found.stderr[-500:]}'
        )
    return numbers(json.loads(found.stdout))


def numbers(value: Any) -> Any:
    """Return a JSON value without texts and the real-time factor, which differs between runs."""
    if isinstance(value, dict):
        kept = {key: each for key, each in value.items() if key not in DROPPED}
        return {key: numbers(each) for key, each in kept.items() if not isinstance(each, str)}
    if isinstance(value, list):
        return [numbers(each) for each in value if not isinstance(each, str)]
    return value


def differences(old: Any, new: Any, place: str = '') -> Iterator[str]:
    """Yield a line ``place: old -> new`` for each difference between two JSON values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted({*old, *new}):
            yield from differences(old.get(key), new.get(key), f'{place}/{key}')
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, f'{place}/{index}')
    elif old != new:
        yield f'{place}: {old} -> {new}'


def main(words: Sequence[str]) -> int:
    """Run everything, save the numbers, and compare; return the exit status."""
    parser = command.parser('behaviour', __doc__)
    parser.add_argument('--against', type=pathlib.Path, metavar='FILE', help='an older file')
    parser.add_argument(
        '--only', nargs='+', choices=[*SCENES, REPLAY], default=[*SCENES, REPLAY], metavar='NAME',
        help=f'some of: {", ".join(SCENES)}, {REPLAY} (default: all)',
    )  # fmt: skip
    command.add_count(parser, '--cycles', 0, 'gait cycles of a walk; 0: those of the scene', 0)
    command.add_processes(parser)
    command.add_out(parser, command.ROOT / 'runs')
    options = parser.parse_args(words)
    old = json.loads(options.against.read_text()) if options.against else None
    cases = [(case, options.cycles) for case in options.only]
    found = command.in_processes(behaviour, cases, options.processes, 'behaviour', 'run')
    document = {'cycles': options.cycles, 'runs': dict(zip(options.only, found, strict=True))}
    kept = command.write(options.out, 'behaviour', document)
    changed = [] if old is None else list(differences(old['runs'], document['runs']))
    lines = [f'{options.out / "behaviour.json"}: {len(found)} runs']
    lines += [f'{len(changed)} differences from {options.against}', *changed] if old else []
    command.show(options, kept if old is None else changed, '\n'.join(lines))
    return int(bool(changed))

# SPDX-License-Identifier: Apache-2.0
"""``pad replay``: what was recorded of feet, through estimators and controller once more."""

from __future__ import annotations

import argparse
import json
import math
import pathlib

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.commands.progress import bar
from ros_pad.commands.sweep import parameters
from ros_pad.control import POLICIES
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.trials import replay as replays
from ros_pad.trials import replayed_bag
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.node_settings import Settings
from ros_pad.trials.node_settings import Value

UNITS = {'slip': ' m/s', 'pressure_setpoint': ' Pa'}  # of what is no probability, share or number
WORDS = {
    'equal': 'equal to the bit',
    'rounding': 'equal but for rounding: recorded on another kind of processor',
    'different': 'different',
    'gap': 'equal up to a gap in what was recorded; what differs after it, nobody can judge',
    'nothing': 'nothing to compare: no estimates and no decisions were recorded',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'replay',
        run,
        'Feed recorded wrenches (N), positions (m) and pressures (Pa) through estimators and '
        'controller once more, and compare with what they said then; try other parameters.',
        'pad replay bags/hexapod_patches/bag --set estimator.wet_prior=0.3 --figure prior.png\n'
        '         pad replay my_bag --remap leg_{leg}/wrench:=/foot_{leg}/ft',
    )
    part.description = (
        f'{part.description}\nThe robot walks as it walked: only what is estimated and decided may'
        ' change. Exit status: 0 equal, or nothing\nthat can be compared differs; 1 different;'
        ' 2 bad input.'
    )
    part.add_argument(
        'bag', metavar='BAG', type=pathlib.Path, help='folder of a bag, or one MCAP file'
    )
    part.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='a value other than that of the bag, in SI units: expected_load (N), dome_pressure '
        '(Pa gauge), margin, ambient_pressure (Pa), publish_rate (Hz), estimator.KEY '
        '(estimator.force_noise, N) or policy.KEY (policy.wet_above); may be given more than once',
    )
    part.add_argument(
        '--policy', choices=POLICIES, help="how shapes are chosen (default: the bag's own way)"
    )
    part.add_argument(
        '--foot', help="a foot other than the bag's: a name in config/feet or a YAML file"
    )
    part.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='NAME:=TOPIC',
        help='topic of the bag that takes the place of one of ros_pad, for one leg '
        "(leg_1/wrench:=/left/ft) or all, '{leg}' being its number "
        "('leg_{leg}/wrench:=/foot_{leg}/ft'); may be given more than once",
    )
    part.add_argument(
        '--namespace', help='of the robot, such as /robot_1 (default: the only one of the bag)'
    )
    part.add_argument(
        '--figure',
        type=pathlib.Path,
        metavar='FILE',
        help='draw P(wet) and set-points (kPa) of every leg, as recorded and as replayed, into a '
        'new .png, .svg or .pdf',
    )
    part.add_argument(
        '--out', type=pathlib.Path, metavar='DIR', help='new bag, for the replayed topics'
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Replay the bag; return the exit status."""
    remaps = _remaps(options.remap)
    values = _values(options.set)
    for path in (options.figure, options.out):
        if path is not None and path.exists():
            raise InvalidInput(f'{path}: exists already, and nothing is ever overwritten')
    try:
        bag = replays.open_bag(options.bag)
        settings = Settings.of(bag).changed(values, options.policy, options.foot)
        with bar('replay', bag.message_count, 'messages') as reach:
            replay = replays.replay(
                bag,
                settings,
                options.namespace,
                remaps,
                lambda share: reach(share * bag.message_count),
            )
    except BagError as error:
        return complain(error, 2)  # of this command, a bag is the input
    if options.figure is not None:
        from ros_pad.figures.replay import draw

        draw(options.figure, replay)
    if options.out is not None:
        replayed_bag.write(replay, options.out, options.namespace)
    if options.json:
        print(
            json.dumps(
                replay.as_dict()
                | {
                    'figure': None if options.figure is None else str(options.figure),
                    'out': None if options.out is None else str(options.out),
                }
            )
        )
    else:
        _show(replay)
        for path in (options.figure, options.out):
            if path is not None:
                print(path)
    return 1 if replay.verdict == 'different' else 0


def _remaps(texts: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts:
        own, sign, other = text.partition(':=')
        if not own or not sign or not other:
            raise InvalidInput(f'--remap {text}: NAME:=TOPIC is needed')
        if own in found:
            raise InvalidInput(f'--remap {text}: {own} is there twice')
        found[own] = other
    return found


def _values(texts: list[str]) -> dict[str, Value]:
    for text in texts:  # before they are read as those of a sweep, which advises lists and ranges
        name, _, value = text.partition('=')
        if not name or not value:
            raise InvalidInput(f'--set {text}: NAME=VALUE is needed')
        if ',' in value or ':' in value:
            raise InvalidInput(f'--set {text}: one value is needed, and no list or range')
    return {name: values[0] for name, values in parameters(texts).items()}


def _show(replay: replays.Replay) -> None:
    legs = ', '.join(map(str, replay.legs))
    print(f'\n{replay.bag}: {replay.duration_s:.2f} s, legs {legs}')
    for note in replay.notes:
        print(f'note: {note}')
    if replay.comparisons:
        print()
        rows = [_row(each) for each in _gathered(replay.comparisons)]
        _table(
            ['topic', 'compared', 'equal', 'largest difference', 'parts at', 'not replayed',
             'not recorded'],
            rows,
        )  # fmt: skip
    print()
    _table(
        ['leg', 'stances', 'wet at their end', 'slips', 'switches'],
        [
            [str(each.leg), str(each.stance_ends), *(
                _pair(pair) for pair in (each.wet_ends, each.slips, each.switches)
            )]
            for each in replay.outcomes
        ],
    )  # fmt: skip
    print('(recorded > replayed, where they are not the same; - where nobody recorded it)')
    print(f'\n{WORDS[replay.verdict]}')


def _gathered(comparisons: list[Comparison]) -> list[tuple[str, list[Comparison]]]:
    """Return topics that are equal on several legs as one, and all others by themselves."""
    found: dict[str, list[Comparison]] = {}
    for each in comparisons:
        name = each.topic
        if each.compared and each.verdict in ('equal', 'rounding'):
            name = each.topic.replace(str(each.leg), '*', 1)
        found.setdefault(name, []).append(each)
    return sorted(found.items())


def _row(gathered: tuple[str, list[Comparison]]) -> list[str]:
    name, topics = gathered
    apart = [each.first_difference_s for each in topics if each.first_difference_s is not None]
    largest = [each.largest_difference for each in topics if each.largest_difference is not None]
    after = ' (after a gap)' if any(each.verdict == 'gap' for each in topics) else ''
    return [
        name,
        str(sum(each.compared for each in topics)),
        str(sum(each.equal for each in topics)),
        _largest(max(largest), topics[0].kind) if largest else 'text',
        f'{min(apart):.3f} s{after}' if apart else '-',
        str(sum(each.missing for each in topics)),
        str(sum(each.not_recorded for each in topics)),
    ]


def _largest(value: float, kind: str) -> str:
    return 'number or none' if value == math.inf else f'{value:.3g}{UNITS.get(kind, "")}'


def _pair(pair: tuple[int | None, int]) -> str:
    before, after = pair
    if before == after:
        return str(after)
    return f'{"-" if before is None else before} > {after}'


def _table(heads: list[str], rows: list[list[str]]) -> None:
    widths = [max(len(row[i]) for row in [heads, *rows]) for i in range(len(heads))]
    for row in [heads, *rows]:
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        print('  '.join(cells).rstrip())


__all__ = ['add', 'run']

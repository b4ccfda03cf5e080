# SPDX-License-Identifier: Apache-2.0
"""``pad replay``: pass a bag through estimators and controller again, and compare."""

from __future__ import annotations

import argparse
import json
import math
import pathlib

from ros_pad.commands.command import Commands, add_command, complain, print_table
from ros_pad.commands.folder import PICTURES, check_pictures, refuse_existing
from ros_pad.commands.progress import bar
from ros_pad.commands.sweep import parameters
from ros_pad.control import POLICIES
from ros_pad.errors import BagError, InvalidInput
from ros_pad.trials import Replay, open_bag, replay, replayed_bag
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.node_settings import NodeSettings, Value

WORDS = {
    'equal': 'equal to the bit',
    'rounding': 'equal except for rounding: recorded on another kind of processor',
    'different': 'different',
    'gap': 'equal up to a gap in the recording; differences after the gap are not judged',
    'nothing': 'nothing to compare: no estimates and no decisions were recorded',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'replay',
        run,
        'Pass recorded wrenches (N), positions (m) and pressures (Pa) through estimators and '
        'controller again, and compare the results with the recorded ones; try other parameters.\n'
        'The motion stays as recorded: only estimates and decisions may change.\nExit status: 0 no'
        ' difference except for rounding or after a gap in the recording; 1 another difference; 2 '
        'bad input.',
        'pad replay bags/hexapod_patches/bag --set wet_prior=0.3 --figure prior.png\n'
        '         pad replay my_bag --remap leg_{leg}/wrench:=/foot_{leg}/ft',
    )
    part.add_argument(
        'bag', metavar='BAG', type=pathlib.Path, help='folder of a bag, or one MCAP file'
    )
    part.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help='another value, in SI units, for a parameter of the estimator or controller node: '
        'such as force_noise (N), expected_load (N), dome_pressure (Pa gauge) or policy.dwell '
        '(steps); may be given more than once',
    )
    part.add_argument(
        '--policy', choices=POLICIES, help="rule that chooses morphologies (default: the bag's)"
    )
    part.add_argument(
        '--foot', help="a foot other than the bag's: a name in config/feet or a YAML file"
    )
    _add_topics(part)
    part.add_argument(
        '--figure',
        type=pathlib.Path,
        metavar='FILE',
        help='draw P(wet) and set-points (kPa) of every leg, as recorded and as replayed, into a '
        'new .png, .svg or .pdf',
    )
    part.add_argument(
        '--out', type=pathlib.Path, metavar='DIR', help='write the replayed topics into a new bag'
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def _add_topics(part: argparse.ArgumentParser) -> None:
    part.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='NAME:=TOPIC',
        help='read NAME of ros_pad from this TOPIC of the bag, for one leg '
        "(leg_1/wrench:=/left/ft) or for all legs, with '{leg}' for the number "
        "('leg_{leg}/wrench:=/foot_{leg}/ft'); may be given more than once",
    )
    part.add_argument(
        '--namespace', help='namespace of the robot, such as /robot_1 (default: the only one)'
    )


def run(options: argparse.Namespace) -> int:
    """Replay the bag; return the exit status."""
    remaps = _remaps(options.remap)
    values = _values(options.set)
    refuse_existing('--figure', options.figure, PICTURES)
    check_pictures(options.figure)
    refuse_existing('--out', options.out)
    try:
        with bar('opening', 1.0, 'bag', delay=1.0) as show:
            bag = open_bag(options.bag, show)
        settings = NodeSettings.of(bag).changed(values, options.policy, options.foot)
        with bar('replay', bag.message_count, 'messages') as show:
            found = replay(
                bag,
                settings,
                options.namespace,
                remaps,
                lambda share: show(share * bag.message_count),
            )
    except BagError as error:
        return complain(error, 2)  # the bag is an input of this command
    if options.figure is not None:
        from ros_pad.reports.replay import draw

        with bar('drawing', 1.0, 'figure'):
            draw(options.figure, found)
    if options.out is not None:
        with bar('writing', 1.0, 'bag') as show:
            replayed_bag.write(found, options.out, options.namespace, show)
    if options.json:
        print(
            json.dumps(
                found.as_dict()
                | {
                    'figure': None if options.figure is None else str(options.figure),
                    'out': None if options.out is None else str(options.out),
                }
            )
        )
    else:
        _show(found)
        for path in (options.figure, options.out):
            if path is not None:
                print(path)
    return 1 if found.verdict == 'different' else 0


def _remaps(texts: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts:
        own, sign, other = text.partition(':=')
        if not own or not sign or not other:
            raise InvalidInput(f'--remap {text}: NAME:=TOPIC is needed')
        if own in found:
            raise InvalidInput(f'--remap {text}: {own} is given twice')
        found[own] = other
    return found


def _values(texts: list[str]) -> dict[str, Value]:
    for text in texts:  # parameters() would also accept lists and ranges
        name, _, value = text.partition('=')
        if not name or not value:
            raise InvalidInput(f'--set {text}: NAME=VALUE is needed')
        if ',' in value or ':' in value:
            raise InvalidInput(f'--set {text}: one value is needed, not a list or range')
    return {name: values[0] for name, values in parameters(texts).items()}


def _show(replay: Replay) -> None:
    legs = ', '.join(map(str, replay.legs))
    print(f'\n{replay.bag}: {replay.duration_s:.2f} s, legs {legs}')
    for note in replay.notes:
        print(f'note: {note}')
    if replay.comparisons:
        print()
        rows = [_row(*each) for each in _gathered(replay.comparisons)]
        print_table(
            ['quantity', 'compared', 'equal', 'largest difference', 'first at', 'not replayed',
             'not recorded'],
            rows,
        )  # fmt: skip
    print()
    print_table(
        ['leg', 'stances', 'wet at their end', 'slips', 'switches'],
        [
            [str(each.leg), str(each.stance_ends), *(
                _pair(pair) for pair in (each.wet_ends, each.slips, each.switches)
            )]
            for each in replay.outcomes
        ],
    )  # fmt: skip
    print('(recorded > replayed where the two differ; - for not recorded)')
    print(f'\n{WORDS[replay.verdict]}')


def _gathered(comparisons: list[Comparison]) -> list[tuple[str, list[Comparison]]]:
    """Return the rows of the table; a quantity that is equal on several legs shares a row."""
    found: dict[str, list[Comparison]] = {}
    for each in comparisons:
        leg = '*' if each.compared and each.verdict in ('equal', 'rounding') else each.leg
        name = f'leg_{leg}/{each.quantity}' if each.leg >= 0 else each.quantity
        if not each.topic.endswith(('/estimate', '/command')):  # of the body estimator
            name = f'{each.topic}: {name}'
        found.setdefault(name, []).append(each)
    return list(found.items())


def _row(name: str, found: list[Comparison]) -> list[str]:
    apart = [each.first_difference_s for each in found if each.first_difference_s is not None]
    largest = max(each.largest_difference for each in found)
    after = ' (after a gap)' if any(each.verdict == 'gap' for each in found) else ''
    return [
        name,
        str(sum(each.compared for each in found)),
        str(sum(each.equal for each in found)),
        'number or none' if largest == math.inf else f'{largest:.3g} {found[0].unit}'.rstrip(),
        f'{min(apart):.3f} s{after}' if apart else '-',
        str(sum(each.missing for each in found)),
        str(sum(each.not_recorded for each in found)),
    ]


def _pair(pair: tuple[int | None, int]) -> str:
    before, after = pair
    if before == after:
        return str(after)
    return f'{"-" if before is None else before} > {after}'

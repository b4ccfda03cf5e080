# SPDX-License-Identifier: Apache-2.0
"""Pass a bag through estimators and controller again, and compare the results with those recorded.

The motion stays as recorded: only estimates and decisions may change, as with other parameters
(--set), such as force_noise (N), expected_load (N), dome_pressure (Pa gauge) or policy.dwell
(steps). --remap is for one leg (leg_1/wrench:=/left/ft) or for all, with {leg} for the number.
Exit status: 0 no difference except for rounding or after a gap in the recording; 1 another
difference; 2 bad input.

For example:
  pad replay bags/hexapod_patches/bag --set wet_prior=0.3 --figure prior.png
  pad replay my_bag --remap leg_{leg}/wrench:=/foot_{leg}/ft
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
from typing import Any

from ros_pad.bags import BagReader
from ros_pad.commands.command import FILE, FOLDER, Commands, add_command, complain, print_table
from ros_pad.commands.folder import check_picture, refuse_existing
from ros_pad.commands.progress import bar
from ros_pad.commands.sweep import pairs, typed
from ros_pad.control import POLICIES
from ros_pad.errors import BagError
from ros_pad.trials import Replay, replay, replayed_bag
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.node_settings import NodeSettings

WORDS = {
    'equal': 'equal to the bit',
    'rounding': 'equal except for rounding: recorded on another kind of processor',
    'different': 'different',
    'gap': 'equal up to a gap in the recording; differences after the gap are not judged',
    'nothing': 'nothing to compare: no estimates and no decisions were recorded',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'replay', run, __doc__)
    add = part.add_argument
    add('bag', metavar='BAG', type=pathlib.Path, help='folder of a bag, or one MCAP file')
    several: dict[str, Any] = {'action': 'append', 'default': []}
    text = 'another value of a parameter of estimator or controller, SI; may be repeated'
    add('--set', metavar='NAME=VALUE', help=text, **several)
    add('--policy', choices=POLICIES, help="chooses morphologies (default: the bag's)")
    add('--foot', help="other than the bag's: a name in config/feet or a YAML file")
    text = 'read NAME of ros_pad from this TOPIC of the bag, see above; may be repeated'
    add('--remap', metavar='NAME:=TOPIC', help=text, **several)
    add('--namespace', help='of the robot, such as /robot_1 (default: the only one)')
    text = 'draw P(wet) and set-points, recorded and replayed, into a new .png, .svg or .pdf'
    add('--figure', help=text, **FILE)
    add('--out', help='write the replayed topics into a new bag', **FOLDER)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Replay the bag; return the exit status."""
    remaps = pairs('--remap', options.remap, ':=')
    values = {name: typed(text) for name, text in pairs('--set', options.set, '=').items()}
    check_picture(options.figure)
    refuse_existing('--out', options.out)
    try:
        with bar('opening', 1.0, 'bag') as show:
            bag = BagReader(options.bag, show)
        settings = NodeSettings.of(bag).changed(values, options.policy, options.foot)
        with bar('replay', 1.0, 'bag') as show:
            found = replay(bag, settings, options.namespace, remaps, show)
    except BagError as error:
        return complain(error, 2)  # the bag is an input of this command
    if options.figure is not None:
        from ros_pad.reports.files import write_picture
        from ros_pad.reports.replay import draw

        write_picture(options.figure, lambda: draw(found))
    if options.out is not None:
        replayed_bag.write(found, options.out, options.namespace)
    written = {'figure': options.figure, 'out': options.out}
    paths = {name: path and str(path) for name, path in written.items()}
    if options.json:
        print(json.dumps(found.as_dict() | paths))
    else:
        _show(found)
        for path in filter(None, paths.values()):
            print(path)
    return 1 if found.verdict == 'different' else 0


def _show(replay: Replay) -> None:
    legs = ', '.join(map(str, replay.legs))
    print(f'\n{replay.bag}: {replay.duration_s:.2f} s, legs {legs}')
    print(*(f'note: {note}' for note in replay.notes), sep='\n')
    # A quantity that is equal on several legs shares a row.
    rows: dict[str, list[Comparison]] = {}
    for each in replay.comparisons:
        leg = '*' if each.compared and each.verdict in ('equal', 'rounding') else each.leg
        name = f'leg_{leg}/{each.quantity}' if each.leg >= 0 else each.quantity
        if not each.topic.endswith(('/estimate', '/command')):  # of the body estimator
            name = f'{each.topic}: {name}'
        rows.setdefault(name, []).append(each)
    if rows:
        head = ['quantity', 'compared', 'equal', 'largest difference', 'first at']
        table = [_row(*each) for each in rows.items()]
        print_table([*head, 'not replayed', 'not recorded'], table)
    print()
    head = ['leg', 'stances', 'wet at their end', 'slips', 'switches']
    table = []
    for own in replay.outcomes:
        cells = [str(own.leg), str(own.stance_ends)]
        for before, after in (own.wet_ends, own.slips, own.switches):
            changed = f'{"-" if before is None else before} > {after}'
            cells.append(str(after) if before == after else changed)
        table.append(cells)
    print_table(head, table)
    print('(recorded > replayed where the two differ; - for not recorded)')
    print(f'\n{WORDS[replay.verdict]}')


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

# SPDX-License-Identifier: Apache-2.0
"""``pad bag``: what is in a bag."""

from __future__ import annotations

import argparse
import json
import pathlib

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.trials import label as labels
from ros_pad.trials.bag import BagReader


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'bag',
        run,
        'Say what is in a bag.',
        'pad bag info runs/hexapod_patches_adaptive_seed0/bag',
    )
    part.add_argument('action', choices=('info',), help='topics, types, numbers of messages')
    part.add_argument('bag', metavar='BAG', type=pathlib.Path, help='folder of a bag')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Tell of the bag; return the exit status."""
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
        return complain(reader.problem, 1)
    return 0

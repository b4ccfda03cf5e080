# SPDX-License-Identifier: Apache-2.0
"""Emulate a pressure regulator on a pseudo-terminal until Ctrl-C; print its path.

For example:
  pad emulate alicat --unit-ids ABCDEF --link /tmp/regulators --fault silence:10:12
"""

from __future__ import annotations

import argparse
import inspect
from typing import Any

from ros_pad.commands.command import Commands, add_command
from ros_pad.configuration import choice
from ros_pad.regulators.emulate import EMULATORS, Emulator

OPTIONS = (
    ('unit-ids', str, 'alicat: one letter for each device (default A)'),
    ('units', str, 'alicat: unit of its pressures (default kPa)'),
    ('firmware', str, 'alicat: firmware, such as 7v09 (default 10v20)'),
    ('channels', int, 'serial_text: number of channels (default 6)'),
    ('full-scale', float, 'highest pressure, Pa gauge (default 100000; alicat 150000)'),
)


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'emulate', run, __doc__)
    faults = (f'faults of {name}: {", ".join(each.FAULTS)}' for name, each in EMULATORS.items())
    part.epilog = '\n'.join([*faults, '', str(part.epilog)])
    part.add_argument('device', choices=sorted(EMULATORS), help='backend whose device is emulated')
    part.add_argument(
        '--link', metavar='PATH', help='new symbolic link to the port, which may change its name'
    )
    part.add_argument(
        '--fault',
        action='append',
        default=[],
        metavar='KIND[@ADDRESS][:START[:END]]',
        help='fault, with start and end in s from now; may be given more than once',
    )
    for name, kind, text in OPTIONS:
        part.add_argument(f'--{name}', type=kind, help=text, metavar='VALUE')


def run(options: argparse.Namespace) -> int:
    """Answer commands until interrupted; return the exit status."""
    kind = EMULATORS[options.device]
    known = [name.replace('_', '-') for name in inspect.signature(kind).parameters]
    given: dict[str, Any] = {}
    for name, _, _ in OPTIONS:
        value = getattr(options, name.replace('-', '_'))
        if value is not None:
            choice(f'--{name}: option of {options.device}', name, known)
            given[name.replace('-', '_')] = value
    with Emulator(kind(schedule=options.fault, **given), options.link) as emulator:
        print(emulator.path, flush=True)
        emulator.wait()
    return 0

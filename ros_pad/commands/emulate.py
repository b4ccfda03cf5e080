# SPDX-License-Identifier: Apache-2.0
"""``pad emulate``: a regulator that is not there, on a pseudo-terminal."""

from __future__ import annotations

import argparse
import inspect
from typing import Any

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.errors import InvalidInput
from ros_pad.regulators.channel import UNITS
from ros_pad.regulators.emulate import EMULATORS
from ros_pad.regulators.emulate import LINE_FAULTS
from ros_pad.regulators.emulate import Emulator


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'emulate',
        run,
        'Emulate a pressure regulator on a pseudo-terminal until Ctrl-C; print its path.',
        'pad emulate alicat --unit-ids ABCDEF --link /tmp/regulators --fault silence:10:12',
    )
    part.epilog = '\n'.join(
        [
            f'faults of all: {", ".join(LINE_FAULTS)}',
            *(
                f'faults of {name}: {", ".join(device.FAULTS[len(LINE_FAULTS) :])}'
                for name, device in EMULATORS.items()
            ),
            '',
            str(part.epilog),
        ]
    )
    part.add_argument('device', choices=sorted(EMULATORS), help='which backend it is for')
    part.add_argument(
        '--link',
        metavar='PATH',
        help='name for the port that stays when it is unplugged; nothing may be there yet, '
        'and what takes its place meanwhile stays: then this ends with status 1',
    )
    part.add_argument(
        '--fault',
        action='append',
        default=[],
        metavar='KIND[@ADDRESS][:START[:END]]',
        help='what goes wrong, when, s from now; may be repeated',
    )
    part.add_argument('--unit-ids', metavar='IDS', help='alicat: one letter for each (A)')
    part.add_argument('--units', choices=tuple(UNITS), help='alicat: its units (kPa)')
    part.add_argument('--firmware', metavar='V', help='alicat: such as 7v09 (10v20)')
    part.add_argument('--channels', type=int, metavar='N', help='serial_text: how many (6)')
    part.add_argument(
        '--full-scale', type=float, metavar='PA', help='Pa gauge (100000; alicat 150000)'
    )
    part.add_argument('--time-constant', type=float, metavar='S', help='of the pressure, s (0.1)')


def run(options: argparse.Namespace) -> int:
    """Answer on the line until it is interrupted; return the exit status."""
    given: dict[str, Any] = {
        name: getattr(options, name)
        for name in ('unit_ids', 'units', 'firmware', 'channels', 'full_scale', 'time_constant')
        if getattr(options, name) is not None
    }
    for name in given:
        if name not in inspect.signature(EMULATORS[options.device]).parameters:
            raise InvalidInput(f'--{name.replace("_", "-")} is not for {options.device}')
    device = EMULATORS[options.device](schedule=options.fault, **given)
    with Emulator(device, options.link) as emulator:
        print(emulator.path, flush=True)
        emulator.wait()
    return 0

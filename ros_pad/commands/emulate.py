# SPDX-License-Identifier: Apache-2.0
"""``pad emulate``: emulate a regulator on a pseudo-terminal."""

from __future__ import annotations

import argparse
import inspect
from typing import Any

from ros_pad.commands.command import Commands, add_command
from ros_pad.errors import InvalidInput
from ros_pad.regulators.emulate import EMULATORS, LINE_FAULTS, Emulator
from ros_pad.regulators.serial_device import UNITS


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
            f'faults of all devices: {", ".join(LINE_FAULTS)}',
            *(
                f'faults of {name}: {", ".join(device.FAULTS[len(LINE_FAULTS) :])}'
                for name, device in EMULATORS.items()
            ),
            '',
            str(part.epilog),
        ]
    )
    part.add_argument('device', choices=sorted(EMULATORS), help='backend whose device is emulated')
    part.add_argument(
        '--link',
        metavar='PATH',
        help='new symbolic link to the port; its path stays the same when the port has another '
        'name after it was unplugged. If another file takes that path, this ends with status 1',
    )
    part.add_argument(
        '--fault',
        action='append',
        default=[],
        metavar='KIND[@ADDRESS][:START[:END]]',
        help='fault, with start and end in s from now; may be given more than once',
    )
    part.add_argument(
        '--unit-ids', metavar='IDS', help='alicat: one letter for each device (default A)'
    )
    part.add_argument(
        '--units', choices=tuple(UNITS), help='alicat: unit of its pressures (default kPa)'
    )
    part.add_argument(
        '--firmware', metavar='V', help='alicat: firmware, such as 7v09 (default 10v20)'
    )
    part.add_argument(
        '--channels', type=int, metavar='N', help='serial_text: number of channels (default 6)'
    )
    part.add_argument(
        '--full-scale',
        type=float,
        metavar='PA',
        help='highest pressure, Pa gauge (default 100000; alicat 150000)',
    )
    part.add_argument(
        '--time-constant',
        type=float,
        metavar='S',
        help='time constant of the pressure, s (default 0.1)',
    )


def run(options: argparse.Namespace) -> int:
    """Answer commands until interrupted; return the exit status."""
    given: dict[str, Any] = {
        name: getattr(options, name)
        for name in ('unit_ids', 'units', 'firmware', 'channels', 'full_scale', 'time_constant')
        if getattr(options, name) is not None
    }
    for name in given:
        if name not in inspect.signature(EMULATORS[options.device]).parameters:
            raise InvalidInput(f'--{name.replace("_", "-")} is no option of {options.device}')
    device = EMULATORS[options.device](schedule=options.fault, **given)
    with Emulator(device, options.link) as emulator:
        print(emulator.path, flush=True)
        emulator.wait()
    return 0

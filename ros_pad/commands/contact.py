# SPDX-License-Identifier: Apache-2.0
"""``pad contact``: shape, meniscus and force limits of one pad."""

from __future__ import annotations

import argparse
import json
from typing import Any

from ros_pad import contact
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.errors import NoEquilibrium


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'contact',
        run,
        'Shape of a pad at a pressure, free or pressed, and its force limits.',
        'pad contact --pressure 75000 --force 0.1',
    )
    part.add_argument('--pressure', type=float, required=True, metavar='PA', help='gauge, Pa')
    part.add_argument('--force', type=float, default=0.0, metavar='N', help='on the pad, N')
    part.add_argument('--pad', choices=('large', 'small'), default='large')
    part.add_argument('--liquid', choices=('water', 'thesis'), default='water')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Print what is known of the pad; return the exit status."""
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
        return complain(f'{error} (status {error.status})', 1)
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

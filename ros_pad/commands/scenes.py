# SPDX-License-Identifier: Apache-2.0
"""List the scenes.

For example:
  pad scenes
"""

from __future__ import annotations

import argparse
import json
from typing import Any

from ros_pad import configuration
from ros_pad.commands.command import Commands, add_command
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.scene import Scene, is_bench


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'scenes', run, __doc__)
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """List the scenes; return the exit status."""
    rows = {name: _row(name) for name in configuration.names('scenes')}
    if options.json:
        print(json.dumps(rows))
        return 0
    width = max(map(len, rows))
    for name, row in rows.items():
        seconds = '' if row['duration_s'] is None else f'{row["duration_s"]:.0f} s'
        print(
            f'{name:{width}}  {row["fidelity"]:8}  {row["policy"] or "":8} {seconds:>5}'
            f'  {row["description"]}'
        )
    return 0


def _row(name: str) -> dict[str, Any]:
    if is_bench(name):
        table = configuration.Table.load(configuration.locate('scenes', name))
        nothing = {'policy': None, 'fidelity': 'analytic', 'duration_s': None}
        return {'description': table.text('description', default='')} | nothing
    scene = Scene.load(name)
    return {
        'description': scene.description,
        'policy': scene.policy,
        'fidelity': levels.level(scene),
        'duration_s': scene.duration,
    }

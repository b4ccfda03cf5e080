# SPDX-License-Identifier: Apache-2.0
"""``pad scenes``: what there is to run."""

from __future__ import annotations

import argparse
import json
from typing import Any

from ros_pad import configuration
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.simulation import bench
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials.bench import FIDELITY


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'scenes', run, 'List the scenes.', 'pad scenes')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """List the scenes; return the exit status."""
    scenes = [bench.load(name) for name in configuration.names('scenes')]
    rows = {scene.name: _row(scene) for scene in scenes}
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


def _row(scene: Scene | bench.BenchScene) -> dict[str, Any]:
    if isinstance(scene, bench.BenchScene):
        nothing = {'policy': None, 'fidelity': FIDELITY, 'duration_s': None}
        return {'description': scene.description} | nothing
    return {
        'description': scene.description,
        'policy': scene.policy,
        'fidelity': ladder.rung(scene),
        'duration_s': scene.duration,
    }

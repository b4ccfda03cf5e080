# SPDX-License-Identifier: Apache-2.0
"""``pad scenes``: what there is to run."""

from __future__ import annotations

import argparse
import json

from ros_pad import configuration
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'scenes', run, 'List the scenes.', 'pad scenes')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """List the scenes; return the exit status."""
    scenes = [Scene.load(name) for name in configuration.names('scenes')]
    if options.json:
        print(
            json.dumps(
                {
                    scene.name: {
                        'description': scene.description,
                        'policy': scene.policy,
                        'fidelity': ladder.rung(scene),
                        'duration_s': scene.duration,
                    }
                    for scene in scenes
                }
            )
        )
        return 0
    width = max(len(scene.name) for scene in scenes)
    for scene in scenes:
        print(
            f'{scene.name:{width}}  {ladder.rung(scene)}  {scene.policy:8}'
            f' {scene.duration:4.0f} s  {scene.description}'
        )
    return 0

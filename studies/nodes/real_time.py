# SPDX-License-Identifier: Apache-2.0
"""Measure how much faster than real time hexapod_patches runs, without ROS and on nodes.

The two kinds of walk run in turn on the same machine. The table gives the median speed of each
kind, and its ratio to the speed without ROS.
"""

from __future__ import annotations

import dataclasses
import pathlib
import statistics
import tempfile
from collections.abc import Sequence

from ros_pad.commands.run import alone
from ros_pad.nodes import composed
from ros_pad.simulation.scene import Scene
from ros_pad.trials import run
from studies import command


def main(words: Sequence[str]) -> int:
    """Run the walks, and print the table."""
    parser = command.parser('real_time', __doc__)
    command.add_count(parser, '--cycles', 20, 'gait cycles of a walk')
    command.add_count(parser, '--repeats', 3, 'walks of each kind')
    options = parser.parse_args(words)
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=options.cycles)
    factors: dict[str, list[float]] = {'without ROS': [], 'nodes, recorded': []}
    with alone(), tempfile.TemporaryDirectory() as folder:
        for repeat in command.each(range(options.repeats), 'real_time', 'pair'):
            bag = pathlib.Path(folder) / f'bag{repeat}'
            trials = (run(scene), composed.run(scene, bag=bag))
            for values, trial in zip(factors.values(), trials, strict=True):
                assert trial.real_time_factor is not None
                values.append(trial.real_time_factor)
    rows = {name: statistics.median(values) for name, values in factors.items()}
    lines = [f'{"walk of hexapod_patches":24} times real time   ratio']
    for name, factor in rows.items():
        lines.append(f'{name:24} {factor:15.1f} {factor / rows["without ROS"]:7.2f}')
    command.show(options, rows, '\n'.join(lines))
    return 0

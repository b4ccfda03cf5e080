# SPDX-License-Identifier: Apache-2.0
"""How much faster than real time hexapod_patches runs, without ROS and on recorded nodes.

Run ``python bench/real_time.py [--cycles 20] [--repeats 3] [--json]``. Both are run in turn on
the same machine; the table gives medians, and the ratio to the loop without ROS.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pathlib
import statistics
import sys
import tempfile

from tqdm import tqdm

from ros_pad.simulation.scene import Scene
from ros_pad.trials import run

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'

from ros_pad.nodes import composed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--cycles', type=int, default=20, help='gait cycles of a walk')
    parser.add_argument('--repeats', type=int, default=3)
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    options = parser.parse_args()
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=options.cycles)
    factors: dict[str, list[float]] = {'without ROS': [], 'nodes, recorded': []}
    with tempfile.TemporaryDirectory() as folder:
        for repeat in tqdm(range(options.repeats), file=sys.stderr, unit='pair'):
            plain = run(scene)
            bag = pathlib.Path(folder) / f'bag{repeat}'
            for name, trial in (
                ('without ROS', plain),
                ('nodes, recorded', composed.run(scene, bag=bag)),
            ):
                assert trial.real_time_factor is not None
                factors[name].append(trial.real_time_factor)
    rows = {name: statistics.median(values) for name, values in factors.items()}
    if options.json:
        print(json.dumps(rows))
        return 0
    print(f'{"walk of hexapod_patches":24} times real time   ratio')
    for name, factor in rows.items():
        print(f'{name:24} {factor:15.1f} {factor / rows["without ROS"]:7.2f}')
    return 0


if __name__ == '__main__':
    sys.exit(main())

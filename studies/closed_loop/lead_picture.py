# SPDX-License-Identifier: Apache-2.0
"""Draw the picture at the top of the README, and write figures of the README to readme.json.

The picture has one walk from above, and the distance by policy.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact import LARGE_PAD, force_limit, inflate
from ros_pad.contact.resistance import expected_friction
from ros_pad.control import POLICIES
from ros_pad.reports.files import save
from ros_pad.reports.pictures import draw_comparison
from ros_pad.reports.style import STYLE, rendered
from ros_pad.reports.view import view_of
from ros_pad.simulation import Scene
from ros_pad.simulation.margin import mid_stance_grip, reserve
from ros_pad.trials import Trial, run
from studies import command
from studies.closed_loop import walk_map

SCENE, SEED = 'hexapod_patches', 0


def lead_picture(trials: Sequence[Trial], path: pathlib.Path) -> None:
    """Draw where feet became domes, and beside this the distance a cycle by policy.

    Parameters
    ----------
    trials : sequence of Trial
        One for each policy, of one scene and seed. The map shows the adaptive one.
    path : Path
        PNG file that is written, 1600 pixels wide.
    """
    drawn = next(trial for trial in trials if trial.policy == 'adaptive')
    view = view_of(drawn, [trial for trial in trials if trial is not drawn])
    rows = max(2, walk_map.rows_of(drawn))
    wide, map_width = 16.0, 9.7
    tall = walk_map.height(drawn, rows, map_width) + 1.55
    with matplotlib.rc_context(STYLE | {'font.size': 13.0}):
        figure = Figure(figsize=(wide, tall), dpi=100)
        walk_map.draw(figure, drawn, view.load_gate, rows, 0.95, 0.6, map_width, size=8.0)
        bars = walk_map.panel(figure, 12.35, 0.6, 3.45, tall - 1.15)
        draw_comparison(bars, view, size=14.0)
        bars.tick_params(axis='y', labelsize=14.0)
        for x, title in (
            (0.95, 'Feet feel the ground and turn into domes where it is wet'),
            (11.1, 'One walk, a floor used for tuning'),
        ):
            figure.text(
                x / wide, 1.0 - 0.12 / tall, title, va='top', fontsize=16.0, fontweight='bold'
            )
        figure.legend(
            handles=walk_map.handles(),
            loc='upper left',
            bbox_to_anchor=(0.85 / wide, 1.0 - 0.4 / tall),
            ncols=3,
        )
        save(path, rendered(figure, 'png', dpi=100))


def figures(trials: Sequence[Trial], processor_s: float) -> dict[str, Any]:
    """Return the figures of the README that no other study has, in SI units."""
    scene = Scene.load(trials[0].scene)
    dry = dataclasses.replace(scene, floor=dataclasses.replace(scene.floor, kind='dry'))
    friction = expected_friction(scene.foot, scene.expected_load)
    return {
        'command': 'python -m studies lead_picture',
        'scene': scene.name,
        'seeds': [trials[0].seed],
        'cycles': scene.cycles,
        'walks': {trial.policy: _walk(trial) for trial in trials},
        'run_processor_s': processor_s,
        'over_weight': {
            'demand, dry': mid_stance_grip(dry, dome=True, wet=False) / reserve(dry, 'dome'),
            'dome': friction.dome,
            'flat, dry': friction.flat_dry,
            'flat, wet': friction.flat_wet,
        },
        'pad': {
            'height_m': inflate(LARGE_PAD, 75e3).height,
            'force_limit_n': force_limit(LARGE_PAD, 75e3),
        },
    }


def _walk(trial: Trial) -> dict[str, Any]:
    assert trial.metrics is not None
    return {
        'mm_a_cycle': 1e3 * trial.metrics.distance_per_cycle_m,
        'slip_m_a_foot': float(np.mean(trial.metrics.slip_path_m)),
        'switches': sum(trial.metrics.switches),
        'times_real_time': trial.real_time_factor,
    }


def main(words: Sequence[str]) -> int:
    """Run the scene under each policy, draw the picture, write the figures; return the status."""
    parser = command.parser('lead_picture', __doc__)
    command.add_out(parser)
    command.add_count(parser, '--cycles', Scene.load(SCENE).cycles, 'gait cycles of a walk')
    options = parser.parse_args(words)
    scene = dataclasses.replace(Scene.load(SCENE), cycles=options.cycles)
    trials = [run(scene, policy, SEED) for policy in POLICIES]
    with tempfile.TemporaryDirectory() as folder:
        pad = pathlib.Path(sys.executable).with_name('pad')
        quiet = subprocess.DEVNULL
        subprocess.run([pad, 'run', SCENE], cwd=folder, stdout=quiet, stderr=quiet, check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor_s = used.ru_utime + used.ru_stime
    lead_picture(trials, options.out / f'{SCENE}.png')
    document = command.write(options.out, 'readme', figures(trials, processor_s))
    command.show(options, document, json.dumps(document, indent=1))
    return 0

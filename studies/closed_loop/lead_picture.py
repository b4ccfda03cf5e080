# SPDX-License-Identifier: Apache-2.0
"""Draw the picture at the top of the README: one walk from above, and the distance by policy."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence

import matplotlib
from matplotlib.figure import Figure

from ros_pad.control import POLICIES
from ros_pad.errors import InvalidInput
from ros_pad.reports import path_map
from ros_pad.reports.files import refuse
from ros_pad.reports.files import save
from ros_pad.reports.pictures import draw_comparison
from ros_pad.reports.style import STYLE
from ros_pad.reports.style import rendered
from ros_pad.reports.view import view_of
from ros_pad.trials import Trial
from ros_pad.trials import run
from studies import command


def lead_picture(
    trials: Sequence[Trial], path: str | os.PathLike[str], force: bool = False
) -> None:
    """Draw where feet became domes, and beside this the distance a cycle by policy.

    Parameters
    ----------
    trials : sequence of Trial
        One for each policy, of one scene and seed. The map shows the adaptive one, or else the
        first.
    path : path
        PNG file to write, 1600 pixels wide.
    force : bool
        Replace an existing file.

    Raises
    ------
    InvalidInput
        Without trials, or when their scenes or seeds differ.
    PadError
        When the file exists or cannot be written.
    """
    if len({(trial.scene, trial.seed) for trial in trials}) != 1:
        raise InvalidInput(
            f'trials = {[(trial.scene, trial.seed) for trial in trials]} (scene, seed) are not'
            ' allowed: one or more are needed, all of one scene and seed'
        )
    refuse(path, force)
    drawn = next((trial for trial in trials if trial.policy == 'adaptive'), trials[0])
    view = view_of(drawn, [trial for trial in trials if trial is not drawn])
    rows = max(2, path_map.rows_of(view))
    wide, map_width = 16.0, 9.7
    tall = path_map.height(view, rows, map_width) + 1.55
    with matplotlib.rc_context(STYLE | {'font.size': 13.0}):
        figure = Figure(figsize=(wide, tall), dpi=100)
        path_map.draw(figure, view, rows, 0.95, 0.6, map_width, size=8.0)
        bars = path_map.panel(figure, 12.35, 0.6, 3.45, tall - 1.15)
        draw_comparison(bars, view, size=14.0)
        bars.tick_params(axis='y', labelsize=14.0)
        for x, title in (
            (0.95, 'Feet feel the ground and turn into domes where it is wet'),
            (11.1, 'What that is worth'),
        ):
            figure.text(
                x / wide, 1.0 - 0.12 / tall, title, va='top', fontsize=16.0, fontweight='bold'
            )
        figure.legend(
            handles=path_map.handles(view, slide=False),
            loc='upper left',
            bbox_to_anchor=(0.85 / wide, 1.0 - 0.4 / tall),
            ncols=3,
        )
        save(path, rendered(figure, 'png', dpi=100))


def main(words: Sequence[str]) -> int:
    """Run the scene under each policy and draw the picture; return the exit status."""
    parser = command.parser('lead_picture', __doc__)
    parser.add_argument('path', nargs='?', default='docs/charts/hexapod_patches.png')
    parser.add_argument('--scene', default='hexapod_patches')
    parser.add_argument('--seed', type=int, default=0, help='seed of floor and noise (default: 0)')
    parser.add_argument('--force', action='store_true', help='replace an existing file')
    options = parser.parse_args(words)
    refuse(options.path, options.force)
    trials = [run(options.scene, policy, options.seed) for policy in POLICIES]
    lead_picture(trials, options.path, options.force)
    print(json.dumps({'picture': options.path}) if options.json else options.path)
    return 0

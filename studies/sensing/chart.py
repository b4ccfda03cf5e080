# SPDX-License-Identifier: Apache-2.0
"""Picture of the study of sensing: time against error, and the error while no foot stands."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from studies.drawing import BLACK
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import ORANGE
from studies.drawing import STYLE
from studies.drawing import VERMILION

COLOURS = (BLUE, GREEN, VERMILION, ORANGE, BLACK)
MARKERS = {'dry': 'o', 'patches': 's', 'ice': '^', 'hexapod': 'D'}


def picture(
    rows: Sequence[Mapping[str, Any]], methods: Sequence[str], blind: Mapping[str, Sequence[float]]
) -> Figure:
    """Return time an update against errors of velocity and drift, and errors without feet."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.2), layout='constrained')
        axes = figure.subplots(1, 3)
        columns = (
            ('velocity_error', 1e3, 'error of velocity x y, mm/s'),
            ('drift', 1e2, 'drift, %'),
        )
        for axis, (key, factor, label) in zip(axes, columns, strict=False):
            for method, colour in zip(methods, COLOURS, strict=True):
                for walk, marker in MARKERS.items():
                    some = [r for r in rows if (r['method'], r['course']) == (method, walk)]
                    if some:
                        x = 1e6 * np.mean([row['seconds'] for row in some])
                        y = factor * np.mean([row[key] for row in some])
                        axis.loglog(x, y, marker, color=colour, markersize=6)
            axis.set_xlabel('time an update, µs')
            axis.set_ylabel(label)
            axis.grid(True, which='both', alpha=0.3)
        for method, colour in zip(methods, COLOURS, strict=True):
            axes[0].plot([], [], 'o', color=colour, label=method)
        for walk, marker in MARKERS.items():
            axes[1].plot([], [], marker, color='grey', label=walk)
        for axis in axes[:2]:
            axis.legend(fontsize=8)
        since = np.array(blind['time'])
        for key, style, label in (
            ('error', '-', 'estimator'),
            ('law', '--', 'predicted deviation'),
            ('held', ':', 'last true velocity, kept'),
        ):
            axes[2].plot(since, 1e3 * np.array(blind[key]), style, color=BLACK, label=label)
        axes[2].set_xlabel('time since no foot is seen to stand, s')
        axes[2].set_ylabel('error of velocity x y, mm/s')
        axes[2].set_yscale('log')
        axes[2].grid(True, which='both', alpha=0.3)
        axes[2].legend(fontsize=8)
        return figure

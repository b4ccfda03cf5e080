# SPDX-License-Identifier: Apache-2.0
"""Picture of the study of sensing: time against error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE

COLOURS = {
    'estimator': BLUE,
    'no rejection': GREEN,
    'invariant': PURPLE,
    'invariant, χ²': SKY,
    'odometry': ORANGE,
    'odometry, r = 0': BLACK,
}
MARKERS = {'dry': 'o', 'patches': 's', 'ice': '^', 'hexapod': 'D'}


def picture(rows: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Figure:
    """Return time an update against errors of velocity and drift."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout='constrained')
        axes = figure.subplots(1, 2)
        columns = (
            ('velocity_error', 1e3, 'error of velocity x y, mm/s'),
            ('drift', 1e2, 'drift, %'),
        )
        for axis, (key, factor, label) in zip(axes, columns, strict=True):
            for method in methods:
                for walk, marker in MARKERS.items():
                    some = [r for r in rows if (r['method'], r['course']) == (method, walk)]
                    if some:
                        x = 1e6 * np.mean([row['seconds'] for row in some])
                        y = factor * np.mean([row[key] for row in some])
                        axis.loglog(x, y, marker, color=COLOURS[method], markersize=6)
            axis.set_xlabel('time an update, µs')
            axis.set_ylabel(label)
            for along in (axis.xaxis, axis.yaxis):
                along.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                along.set_major_formatter('{x:g}')
            axis.minorticks_off()
            axis.grid(True, alpha=0.3)
        for method in methods:
            axes[0].plot([], [], 'o', color=COLOURS[method], label=method)
        for walk, marker in MARKERS.items():
            axes[1].plot([], [], marker, color='grey', label=walk)
        for axis in axes:
            axis.legend(fontsize=8)
        return figure

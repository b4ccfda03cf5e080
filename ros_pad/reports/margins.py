# SPDX-License-Identifier: Apache-2.0
"""Histograms for standing feet: friction margin, and load of domes over their force limit."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact import force_limit
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.reports.style import BLACK, GREEN, PALE, VERMILION, WIDE, Drawn
from ros_pad.reports.view import View


def limit_use(view: View) -> np.ndarray | None:
    """Return the load of each standing dome over its force limit.

    Returns
    -------
    ndarray (m, legs) or None
        Load over the force limit of all pads of the foot at each control step; above 1 is
        overload. NaN where no dome stands, or load or pressure is unknown. None where the foot is
        unknown or there are no samples.
    """
    trial = view.trial
    if view.foot is None or not len(trial.time):
        return None
    rows = np.clip(np.searchsorted(trial.time, trial.slow_time + 1e-9) - 1, 0, None)
    load = trial.force[rows, :, 2]
    standing = trial.standing(view.load_gate)[rows]
    domed = standing & (trial.pressure > DOME_PRESSURE)
    pressure = np.where(domed, np.minimum(trial.pressure, view.foot.ceiling), view.foot.ceiling)
    limit = view.foot.pads * np.asarray(force_limit(view.foot.pad, pressure, view.foot.limit))
    with np.errstate(divide='ignore'):  # at low pressures the limit is 0
        return np.where(domed, load / limit, np.nan)


def standing_margins(view: View) -> np.ndarray:
    """Return the friction margin of each foot at each control step, NaN in the air: (m, legs)."""
    trial = view.trial
    if not len(trial.time):
        return np.full_like(trial.margin, np.nan)
    rows = np.clip(np.searchsorted(trial.time, trial.slow_time + 1e-9) - 1, 0, None)
    return np.where(trial.standing(view.load_gate)[rows], trial.margin, np.nan)


def _figure(view: View, margins: np.ndarray, used: np.ndarray | None) -> Figure:
    """Draw the distributions of friction margin and load over force limit for each leg."""
    panels = [(margins, 0.0, 'below', 'friction margin, 5 % quantile', GREEN)]
    if used is not None and np.isfinite(used).any():
        panels.append((used, 1.0, 'above', 'load of a dome over its force limit', VERMILION))
    figure = Figure(figsize=(WIDE, 0.42 * len(view.order) + 0.75), layout='constrained')
    axes = figure.subplots(len(view.order), len(panels), sharex='col', squeeze=False)
    for panel, (values, edge, side, title, colour) in enumerate(panels):
        known = values[np.isfinite(values)]
        low, high = np.percentile(known, [0.5, 99.5]) if len(known) else (0.0, 1.0)
        low, high = min(low, edge - 0.1), max(high, edge + 0.1)
        edges = np.linspace(low, high, 61)
        for row, column in enumerate(view.order):
            ax = axes[row, panel]
            own = values[:, column]
            own = own[~np.isnan(own)]
            if len(own):
                counts, _ = np.histogram(np.clip(own, low, high), edges)
                ax.stairs(counts / counts.max(), edges, fill=True, color=colour, alpha=0.55)
                ax.plot(np.median(own), 1.12, 'v', color=BLACK, markersize=3.0)
                beyond = np.mean(own < edge if side == 'below' else own > edge)
                # Place the text on the side with fewer values.
                left = np.median(own) > 0.5 * (low + high)
                ax.annotate(
                    f'{100.0 * beyond:.1f} % {side} {edge:g}', (0.0 if left else 1.0, 0.98),
                    xycoords='axes fraction', ha='left' if left else 'right', va='top',
                    bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.8}, fontsize=7.0,
                    zorder=4,
                )  # fmt: skip
            else:
                ax.annotate(
                    'no sample', (0.5, 0.4), xycoords='axes fraction', ha='center', color=PALE
                )
            ax.axvline(edge, color=BLACK, linestyle='--', linewidth=0.8)
            ax.set_ylim(0.0, 1.35)
            ax.set_yticks([])
            ax.spines['left'].set_visible(False)
            if panel == 0:
                ax.set_ylabel(f'leg {view.trial.legs[column]}')
        axes[-1, panel].set_xlabel(title)
        axes[-1, panel].set_xlim(low, high)
    return figure


def picture(view: View, margins: np.ndarray, used: np.ndarray | None) -> Drawn:
    """Draw :func:`standing_margins` and :func:`limit_use` as histograms, with texts."""
    caption = (
        'How often each value occurred while the foot stood, leg by leg; triangles are medians, '
        'and the outermost bars include all values beyond them. Friction margin: 5 % quantile of '
        'friction less the ratio of tangential to normal force; below 0 the foot may slip.'
    )
    if used is None:
        caption += ' The foot is not on record, so its force limit is unknown.'
    elif np.isfinite(used).any():
        caption += (
            ' Force limit: largest load of all pads of the foot at the measured pressure; above 1 '
            'the sole carries the rest.'
        )
    else:
        caption += ' No dome stood, so no force limit was used.'
    return Drawn(
        _figure(view, margins, used),
        'Friction margin and force limit',
        'Histograms for each leg of the friction margin and of the load over the force limit',
        caption,
    )


__all__ = ['limit_use', 'picture', 'standing_margins']

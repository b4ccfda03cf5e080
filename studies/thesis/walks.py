# SPDX-License-Identifier: Apache-2.0
"""Draw figures 38, 39 and 41 to 44 of the thesis: walks of the rail leg and of the hexapod.

The thesis gives no data points of these walks, so they are compared with its text.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.pace import Progress
from ros_pad.reports.style import (
    BLACK,
    BLUE,
    GREEN,
    PALE,
    PAPER_STYLE,
    VERMILION,
    WET,
    WIDE,
    legend,
)
from ros_pad.reports.view import view_of
from ros_pad.trials import loop
from ros_pad.trials.trial import Trial
from studies.thesis.explained import MINIMAL, Explained, claim, explained, worded

# Scene, text, colour and line style of each case, in the thesis' order.
RAIL: dict[str, tuple[str, str, Any]] = {
    'leg_dry_flat': ('dry, flat', BLACK, '-'),
    'leg_wet_flat': ('wet, flat', VERMILION, '-'),
    'leg_wet_dome_40': ('wet, 40 kPa', '#CC79A7', (0, (1, 1.2))),
    'leg_wet_dome_60': ('wet, 60 kPa', GREEN, (0, (6, 1.5, 1, 1.5))),
    'leg_wet_dome_75': ('wet, 75 kPa', BLUE, (0, (5, 1.5))),
}
CASES: dict[str, tuple[str, str, Any]] = {
    'dry_flat': ('dry, flat', BLACK, '-'),
    'wet_flat': ('wet, flat', VERMILION, '-'),
    'wet_dome': ('wet, dome', BLUE, (0, (5, 1.5))),
}
SEEDS = (0, 1, 2)  # of the hexapod's floors; the floors of the rail leg are uniform
FLOOR_OF = {41: 'rough', 42: 'smooth', 43: 'rough', 44: 'smooth'}
NUMBERS = (38, 39, *FLOOR_OF)

# Numbers assumed for statements of the thesis without numbers.
ABOUT = 0.2  # relative error up to which a ratio is "approximately five times"
STRAIGHT = 0.02  # "straight": m aside for each metre of distance; "firmly": slip over stroke


Walks = Mapping[tuple[str, int], Trial]


def scenes(numbers: Collection[int]) -> list[tuple[str, int]]:
    """Return scene and seed of the walks that given figures need."""
    found = [(name, 0) for name in RAIL] if {38, 39} & set(numbers) else []
    for floor in ('smooth', 'rough'):
        if any(FLOOR_OF.get(number) == floor for number in numbers):
            found += [(f'hexapod_{floor}_{case}', seed) for case in CASES for seed in SEEDS]
    return found


def walk(
    numbers: Collection[int], progress: Progress | None = None
) -> dict[tuple[str, int], Trial]:
    """Run the walks of given figures, at the fidelity level of each scene; about 2 s a scene."""
    wanted = scenes(numbers)
    found = {}
    for done, (name, seed) in enumerate(wanted, start=1):
        found[name, seed] = loop.run(name, seed=seed)
        if progress:
            progress(done / len(wanted))
    return found


def draw(walks: Walks, numbers: Collection[int] = NUMBERS) -> list[Explained]:
    """Draw some of the figures from the walks that they need."""
    makers: dict[int, Callable[[Walks, int], Explained]] = {38: _figure_38, 39: _figure_39}
    makers |= {41: _feet, 42: _feet, 43: _paths, 44: _paths}
    with matplotlib.rc_context(PAPER_STYLE):
        return [makers[number](walks, number) for number in NUMBERS if number in numbers]


def _part(trial: Trial, first: int, cycles: int) -> np.ndarray:
    """Return which samples are of some gait cycles."""
    start, cycle = trial.settings['settle_s'], trial.settings['cycle_s']
    start += first * cycle
    return (trial.time >= start) & (trial.time <= start + cycles * cycle)


# --- the leg on its rail -------------------------------------------------------------------------


def _figure_38(walks: Walks, number: int) -> Explained:
    shown = ('leg_dry_flat', 'leg_wet_flat', 'leg_wet_dome_75')
    figure = Figure(figsize=(WIDE, 1.9), layout='constrained')
    axes = figure.subplots(1, 3, sharey=True)
    for ax, letter, name in zip(axes, 'abc', shown, strict=True):
        trial = walks[name, 0]
        rows = _part(trial, 2, 4)
        x, _, z = 1e3 * trial.position[rows, 0].T
        standing = trial.standing(view_of(trial).load_gate)[rows, 0]
        watered = trial.floor is not None and trial.floor.wet(0.0, 0.0)
        ax.axhspan(-3.0, 0.0, color=WET if watered else _DRY, lw=0.0)
        x = x - x[0]
        ax.plot(np.where(standing, np.nan, x), z, color=BLACK, lw=1.0)
        ax.plot(np.where(standing, x, np.nan), z, color=VERMILION, lw=3.0)
        ax.set(title=f'({letter}) {RAIL[name][0]}', xlabel='x / mm')
        ax.set_xlim(x.min() - 8.0, x.min() + 215.0)
    axes[0].set(ylabel='z / mm', ylim=(-3.0, 25.0))
    keys = ((BLACK, 1.0, 'foot in the air'), (VERMILION, 3.0, 'standing: a long stroke is slip'),
            (_DRY, 5.0, 'dry floor'), (WET, 5.0, 'wet floor'))  # fmt: skip
    legend(figure, [Line2D([], [], color=c, lw=w, label=text) for c, w, text in keys])
    dry, wet, dome = (_slip_a_cycle(walks[name, 0])[0] for name in shown)
    stroke = 1e3 * walks[shown[0], 0].settings['stride_m']
    claims = (
        claim('dry the flat foot', dry, dry <= STRAIGHT * stroke, dry=dry, stroke=stroke),
        claim('wet the flat foot', wet, wet > 0.5 * stroke, wet=wet, stroke=stroke),
        claim('wet domes of high', dome, dome <= MINIMAL * stroke, dome=dome, stroke=stroke),
    )
    slips = zip(shown, (dry, wet, dome), strict=True)
    words = ', '.join(f'{RAIL[name][0]} {slip:.1f} mm' for name, slip in slips)
    return explained(number, figure, claims, slips=words)


_DRY = '#E4E4E4'


def _figure_39(walks: Walks, number: int) -> Explained:
    figure = Figure(figsize=(WIDE, 2.6), layout='constrained')
    ax = figure.subplots()
    found = {name: walks[name, 0].metrics for name in RAIL}
    for name, (words, colour, style) in RAIL.items():
        trial, metrics = walks[name, 0], found[name]
        assert metrics is not None
        goal = metrics.goal_m or 0.0
        rows = trial.body[:, 0] <= goal
        time = trial.time - trial.settings['settle_s']
        ax.plot(time[rows], 1e3 * trial.body[rows, 0], color=colour, ls=style, label=words)
    ax.axhline(1e3 * goal, color=PALE, lw=0.9)
    ax.annotate('end of the rail', (ax.get_xlim()[1], 1e3 * goal), (0, 3), ha='right',
                textcoords='offset points')  # fmt: skip
    ax.set(xlabel='time / s', ylabel='distance of the body / mm')
    ax.set(xlim=(0.0, None), ylim=(0.0, 1.12e3 * goal))
    legend(figure, ax.get_legend_handles_labels()[0])
    times = {name: each.time_to_goal_s for name, each in found.items() if each}
    advances = {name: each.distance_per_cycle_m for name, each in found.items() if each}
    dry, flat, low, middle, high = (math.inf if t is None else t for t in times.values())
    less = advances['leg_wet_dome_75'] / advances['leg_dry_flat'] - 1.0
    claims = (
        claim('domes of 75 kpa', less, abs(less) <= MINIMAL, less=abs(less), high=high, dry=dry),
        claim('wet flat feet need', flat / high, abs(flat / high / 5.0 - 1.0) <= ABOUT,
              ratio=flat / high, flat=flat, high=high),
        claim('of 40 60 and', (low, middle, high), low > middle > high,
              times=(low, middle, high)),
    )  # fmt: skip
    shown = [f'{"never" if t is None else f"{t:.1f} s"} ({RAIL[n][0]})' for n, t in times.items()]
    return explained(number, figure, claims, times=', '.join(shown))


# --- the hexapod ---------------------------------------------------------------------------------


def _feet(walks: Walks, number: int) -> Explained:
    floor = FLOOR_OF[number]
    middle, others = _slips_by_case(walks, floor)
    stride = 1e3 * walks[f'hexapod_{floor}_dry_flat', SEEDS[0]].settings['stride_m']
    largest = max(middle['dry_flat'].max(), others['dry_flat'].max())
    wet, dome = middle['wet_flat'], middle['wet_dome']
    more, left, ratio = wet / middle['dry_flat'], dome / wet, wet / others['wet_flat']
    at: dict[str, Any] = {'figure': number, 'seeds': f'{len(SEEDS)} floors, L2'}
    claims = (
        claim('dry nothing slips', largest, largest <= MINIMAL * stride, largest=largest,
              stride=stride, **at),
        claim('wet flat feet slip', more, np.all(more > 2.0), slips=wet, more=more, **at),
        claim('domes take away much', left, np.all(left <= 0.5), slips=dome, left=left, **at),
        claim('legs 2 and 5', ratio, ratio.mean() > 1.0, ratio=ratio, mean=ratio.mean(), **at),
    )  # fmt: skip
    slips = ', '.join(f'{CASES[case][0]} {each.mean():.0f} mm' for case, each in middle.items())
    return explained(number, _draw_feet(walks, floor), claims, slips=slips, floor=floor)


def _draw_feet(walks: Walks, floor: str) -> Figure:
    figure = Figure(figsize=(WIDE, 3.1), layout='constrained')
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for column, (case, (words, _, _)) in enumerate(CASES.items()):
        trial = walks[f'hexapod_{floor}_{case}', SEEDS[0]]
        rows = _part(trial, 5, 5)
        standing = trial.standing(view_of(trial).load_gate)[rows]
        time = trial.time[rows]
        for ax, leg in zip(axes[:, column], (2, 5), strict=True):
            index = trial.legs.index(leg)
            x, stands = 1e3 * trial.position[rows, index, 0], standing[:, index]
            x = x - x[0]
            ax.plot(time - time[0], np.where(stands, np.nan, x), color=BLACK, lw=0.9)
            ax.plot(time - time[0], np.where(stands, x, np.nan), color=VERMILION, lw=2.0)
            if column == 0:
                ax.set_ylabel(f'leg {leg}: x / mm')
        axes[0, column].set_title(f'({"abc"[column]}) {words}')
        axes[1, column].set_xlabel('time / s')
    keys = (BLACK, 0.9, 'foot in the air'), (VERMILION, 2.0, 'standing: level where it holds')
    legend(figure, [Line2D([], [], color=c, lw=w, label=text) for c, w, text in keys])
    return figure


Slips = dict[str, np.ndarray]  # slip of each seed, mm a cycle, by case


def _slips_by_case(walks: Walks, floor: str) -> tuple[Slips, Slips]:
    """Return the mean slip of legs 2 and 5, and the mean slip of the other legs."""
    middle, others = {}, {}
    for case in CASES:
        trials = [walks[f'hexapod_{floor}_{case}', seed] for seed in SEEDS]
        slips = np.array([_slip_a_cycle(trial) for trial in trials])
        at = np.isin(np.array(trials[0].legs), (2, 5))
        middle[case], others[case] = slips[:, at].mean(axis=1), slips[:, ~at].mean(axis=1)
    return middle, others


def _paths(walks: Walks, number: int) -> Explained:
    floor = FLOOR_OF[number]
    figure = Figure(figsize=(WIDE, 2.3), layout='constrained')
    ax = figure.subplots()
    drifts, shares = {}, {}
    for case, (words, colour, style) in CASES.items():
        trials = [walks[f'hexapod_{floor}_{case}', seed] for seed in SEEDS]
        for trial in trials:
            label = words if trial is trials[0] else None
            ax.plot(*(1e3 * trial.body[:, :2]).T, color=colour, ls=style, lw=1.2, label=label)
            ax.plot(*(1e3 * trial.body[-1, :2]), 's', color=colour, ms=4.0)
        own = [trial.metrics for trial in trials if trial.metrics is not None]
        drifts[case] = np.array([1e3 * abs(each.lateral_drift_m) for each in own])
        shares[case] = np.array([abs(each.lateral_drift_m) / each.distance_m for each in own])
    ax.axhline(0.0, color=PALE, lw=0.8, zorder=0)
    ax.set(xlabel='x / mm', ylabel='y / mm')
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -150.0), max(high, 150.0))
    end = Line2D([], [], color=BLACK, marker='s', ms=4.0, ls='', label='end')
    legend(figure, [*ax.get_legend_handles_labels()[0], end])
    straight = max(shares['dry_flat'].max(), shares['wet_dome'].max())
    dry, wet, dome = drifts['dry_flat'].max(), drifts['wet_flat'], drifts['wet_dome']
    at: dict[str, Any] = {'figure': number, 'seeds': f'{len(SEEDS)} floors, L2'}
    claims = (
        claim('wet flat feet leave', wet,
              np.median(shares['wet_flat']) > STRAIGHT and wet.min() > dry,
              wet=wet, dry=dry, **at),
        claim('wet domes keep a', dome, straight <= STRAIGHT, aside=dome, straight=straight, **at),
    )  # fmt: skip
    asides = '; '.join(
        worded('{0} {1:.0f} mm', CASES[case][0], each) for case, each in drifts.items()
    )
    return explained(number, figure, claims, asides=asides, floor=floor)


def _slip_a_cycle(trial: Trial) -> list[float]:
    """Return the mean slip path of each foot in a gait cycle, mm."""
    assert trial.metrics is not None
    return [1e3 * each / trial.metrics.cycles for each in trial.metrics.slip_path_m]

# SPDX-License-Identifier: Apache-2.0
"""Draw figures 38, 39 and 41 to 44 of the thesis: walks of the rail leg and of the hexapod.

The thesis gives no data points of these walks, so they are compared with its text.
"""

from __future__ import annotations

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
from studies.thesis.explained import MINIMAL, Claim, Explained, claim, explained

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
    makers: dict[int, Callable[[], Explained]] = {
        38: lambda: _figure_38(walks),
        39: lambda: _figure_39(walks),
        **{
            number: lambda number=number, floor=floor: (  # type: ignore[misc]
                _feet(walks, number, floor) if number < 43 else _paths(walks, number, floor)
            )
            for number, floor in FLOOR_OF.items()
        },
    }
    with matplotlib.rc_context(PAPER_STYLE):
        return [makers[number]() for number in NUMBERS if number in numbers]


# --- the leg on its rail -------------------------------------------------------------------------


def _figure_38(walks: Walks) -> Explained:
    shown = {name: RAIL[name][0] for name in ('leg_dry_flat', 'leg_wet_flat', 'leg_wet_dome_75')}
    figure = Figure(figsize=(WIDE, 1.9), layout='constrained')
    axes = figure.subplots(1, 3, sharey=True)
    slips = {}
    for ax, letter, (name, words) in zip(axes, 'abc', shown.items(), strict=True):
        trial = walks[name, 0]
        view = view_of(trial)
        start = trial.settings['settle_s'] + 2.0 * trial.settings['cycle_s']
        rows = (trial.time >= start) & (trial.time <= start + 4.0 * trial.settings['cycle_s'])
        x, _, z = 1e3 * trial.position[rows, 0].T
        standing = trial.standing(view.load_gate)[rows, 0]
        ground = walks[name, 0].floor
        if ground is not None and ground.wet(0.0, 0.0):
            ax.axhspan(-3.0, 0.0, color=WET, lw=0.0)
        else:
            ax.axhspan(-3.0, 0.0, color='#E4E4E4', lw=0.0)
        x = x - x[0]
        ax.plot(np.where(standing, np.nan, x), z, color=BLACK, lw=1.0)
        ax.plot(np.where(standing, x, np.nan), z, color=VERMILION, lw=3.0)
        ax.set_title(f'({letter}) {words}')
        ax.set_xlabel('x / mm')
        ax.set_xlim(x.min() - 8.0, x.min() + 215.0)
        slips[name] = _slip_a_cycle(trial)[0]
    axes[0].set_ylabel('z / mm')
    axes[0].set_ylim(-3.0, 25.0)
    legend(
        figure,
        [
            Line2D([], [], color=BLACK, lw=1.0, label='foot in the air'),
            Line2D([], [], color=VERMILION, lw=3.0, label='standing: a long stroke is slip'),
            Line2D([], [], color='#E4E4E4', lw=5.0, label='dry floor'),
            Line2D([], [], color=WET, lw=5.0, label='wet floor'),
        ],
    )
    stroke = 1e3 * walks['leg_dry_flat', 0].settings['stride_m']
    return explained(
        38,
        figure,
        _claims_38(slips, stroke),
        alt='Paths of the foot over four gait cycles. Slip in a cycle: '
        + ', '.join(f'{shown[name]} {slip:.1f} mm' for name, slip in slips.items()),
    )


def _claims_38(slips: Mapping[str, float], stroke: float) -> tuple[Claim, ...]:
    dry, wet, dome = slips.values()
    return (
        claim(
            'dry the flat foot',
            f'It slips {dry:.1f} mm a cycle, of a stroke of {stroke:g} mm (1 walk, L0).',
            (dry,),
            dry <= STRAIGHT * stroke,
        ),
        claim(
            'wet the flat foot',
            f'It slips {wet:.1f} of {stroke:g} mm (1 walk, L0).',
            (wet,),
            wet > 0.5 * stroke,
        ),
        claim(
            'wet domes of high',
            f'They slip {dome:.1f} of {stroke:g} mm (1 walk, L0).',
            (dome,),
            dome <= MINIMAL * stroke,
        ),
    )


def _figure_39(walks: Walks) -> Explained:
    figure = Figure(figsize=(WIDE, 2.6), layout='constrained')
    ax = figure.subplots()
    times, advances = {}, {}
    for name, (words, colour, style) in RAIL.items():
        trial = walks[name, 0]
        assert trial.metrics is not None
        goal = trial.metrics.goal_m or 0.0
        times[name] = trial.metrics.time_to_goal_s
        advances[name] = trial.metrics.distance_per_cycle_m
        rows = trial.body[:, 0] <= goal
        time = trial.time - trial.settings['settle_s']
        ax.plot(time[rows], 1e3 * trial.body[rows, 0], color=colour, ls=style, label=words)
    ax.axhline(1e3 * goal, color=PALE, lw=0.9)
    ax.annotate('end of the rail', (ax.get_xlim()[1], 1e3 * goal), (0, 3), ha='right',
                textcoords='offset points')  # fmt: skip
    ax.set_xlim(0.0, None)
    ax.set_ylim(0.0, 1.12e3 * goal)
    ax.set_xlabel('time / s')
    ax.set_ylabel('distance of the body / mm')
    legend(figure, ax.get_legend_handles_labels()[0])
    less = advances['leg_wet_dome_75'] / advances['leg_dry_flat'] - 1.0
    return explained(
        39,
        figure,
        _claims_39(times, less),
        alt='Distance of the body over time; it is at the end of the rail after '
        + ', '.join(f'{_seconds(times[name])} ({RAIL[name][0]})' for name in RAIL),
    )


def _claims_39(times: Mapping[str, float | None], less: float) -> tuple[Claim, ...]:
    dry, flat, low, middle, high = (
        float('inf') if each is None else each for each in times.values()
    )
    return (
        claim(
            'domes of 75 kpa',
            f'They go {100.0 * abs(less):.0f} % less far in a cycle, and need '
            f'{high:.1f} s in place of {dry:.1f} s (1 walk each, L0).',
            (less,),
            abs(less) <= MINIMAL,
        ),
        claim(
            'wet flat feet need',
            f'{flat / high:.1f} times: {flat:.1f} and {high:.1f} s (1 walk each, L0). With one '
            'assumed number halved or doubled 1.3 to 7.2 times, or the flat foot never arrives.',
            (flat / high,),
            abs(flat / high / 5.0 - 1.0) <= ABOUT,
        ),
        claim(
            'of 40 60 and',
            f'{low:.1f}, {middle:.1f} and {high:.1f} s to the goal (1 walk each, L0).',
            (low, middle, high),
            low > middle > high,
        ),
    )


# --- the hexapod ---------------------------------------------------------------------------------


def _feet(walks: Walks, number: int, floor: str) -> Explained:
    middle, others = _slips_by_case(walks, floor)
    stride = 1e3 * walks[f'hexapod_{floor}_dry_flat', SEEDS[0]].settings['stride_m']
    return explained(
        number,
        _draw_feet(walks, floor),
        _slip_claims(number, middle, others, stride),
        alt=f'Path of feet 2 and 5 over time on the {floor} floor. Slip in a cycle: '
        + ', '.join(f'{CASES[case][0]} {each.mean():.0f} mm' for case, each in middle.items()),
        title=f'Figure {number}: feet of legs 2 and 5 on the {floor} floor',
    )


def _draw_feet(walks: Walks, floor: str) -> Figure:
    figure = Figure(figsize=(WIDE, 3.1), layout='constrained')
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for column, (case, (words, _, _)) in enumerate(CASES.items()):
        trial = walks[f'hexapod_{floor}_{case}', SEEDS[0]]
        view = view_of(trial)
        standing = trial.standing(view.load_gate)
        start = trial.settings['settle_s'] + 5.0 * trial.settings['cycle_s']
        rows = (trial.time >= start) & (trial.time <= start + 5.0 * trial.settings['cycle_s'])
        time = trial.time[rows] - start
        for ax, leg in zip(axes[:, column], (2, 5), strict=True):
            index = trial.legs.index(leg)
            x = 1e3 * trial.position[rows, index, 0]
            x = x - x[0]
            ax.plot(time, np.where(standing[rows, index], np.nan, x), color=BLACK, lw=0.9)
            ax.plot(time, np.where(standing[rows, index], x, np.nan), color=VERMILION, lw=2.0)
            if column == 0:
                ax.set_ylabel(f'leg {leg}: x / mm')
        axes[0, column].set_title(f'({"abc"[column]}) {words}')
        axes[1, column].set_xlabel('time / s')
    legend(
        figure,
        [
            Line2D([], [], color=BLACK, lw=0.9, label='foot in the air'),
            Line2D([], [], color=VERMILION, lw=2.0, label='standing: level where it holds'),
        ],
    )
    return figure


Slips = dict[str, np.ndarray]  # slip of each seed, mm a cycle, by case


def _slips_by_case(walks: Walks, floor: str) -> tuple[Slips, Slips]:
    """Return the mean slip of legs 2 and 5, and the mean slip of the other legs."""
    middle, others = {}, {}
    for case in CASES:
        slips = np.array([_slip_a_cycle(walks[f'hexapod_{floor}_{case}', s]) for s in SEEDS])
        legs = np.array(walks[f'hexapod_{floor}_{case}', SEEDS[0]].legs)
        at = np.isin(legs, (2, 5))
        middle[case], others[case] = slips[:, at].mean(axis=1), slips[:, ~at].mean(axis=1)
    return middle, others


def _slip_claims(number: int, middle: Slips, others: Slips, stride: float) -> tuple[Claim, ...]:
    largest = max(middle['dry_flat'].max(), others['dry_flat'].max())
    more = middle['wet_flat'] / middle['dry_flat']
    left = middle['wet_dome'] / middle['wet_flat']
    ratio = middle['wet_flat'] / others['wet_flat']
    seeds = f'{len(SEEDS)} floors, L2'
    return (
        claim(
            'dry nothing slips',
            f'Feet slip at most {largest:.0f} mm a cycle, of a stride of {stride:g} mm, when they '
            f'land ({seeds}).',
            (float(largest),),
            bool(largest <= MINIMAL * stride),
            figure=number,
        ),
        claim(
            'wet flat feet slip',
            f'Legs 2 and 5 slip {_few(middle["wet_flat"])} mm a cycle, {_few(more, ".1f")} '
            f'times as much as on dry ground ({seeds}).',
            tuple(more.tolist()),
            bool(np.all(more > 2.0)),
            figure=number,
        ),
        claim(
            'domes take away much',
            f'{_few(100.0 * left)} % of it remain: {_few(middle["wet_dome"])} mm ({seeds}).',
            tuple(left.tolist()),
            bool(np.all(left <= 0.5)),
            figure=number,
        ),
        claim(
            'legs 2 and 5',
            f'Wet and flat they slip {_few(ratio, ".2f")} times as much as the others ({seeds}).',
            tuple(ratio.tolist()),
            bool(np.all(ratio > 1.0 + MINIMAL)),
            figure=number,
        ),
    )


def _paths(walks: Walks, number: int, floor: str) -> Explained:
    figure = Figure(figsize=(WIDE, 2.3), layout='constrained')
    ax = figure.subplots()
    drifts, shares = {}, {}
    for case, (words, colour, style) in CASES.items():
        trials = [walks[f'hexapod_{floor}_{case}', seed] for seed in SEEDS]
        for trial in trials:
            ax.plot(
                *(1e3 * trial.body[:, :2]).T, color=colour, ls=style, lw=1.2,
                label=words if trial is trials[0] else None,
            )  # fmt: skip
            ax.plot(*(1e3 * trial.body[-1, :2]), 's', color=colour, ms=4.0)
        own = [trial.metrics for trial in trials if trial.metrics is not None]
        drifts[case] = np.array([1e3 * abs(each.lateral_drift_m) for each in own])
        shares[case] = np.array([abs(each.lateral_drift_m) / each.distance_m for each in own])
    ax.axhline(0.0, color=PALE, lw=0.8, zorder=0)
    ax.set_xlabel('x / mm')
    ax.set_ylabel('y / mm')
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -150.0), max(high, 150.0))
    legend(
        figure,
        [
            *ax.get_legend_handles_labels()[0],
            Line2D([], [], color=BLACK, marker='s', ms=4.0, ls='', label='end'),
        ],
    )
    return explained(
        number,
        figure,
        _path_claims(number, drifts, shares),
        alt=f'Paths of the body on the {floor} floor. Aside at the end: '
        + '; '.join(f'{CASES[case][0]} {_few(each)} mm' for case, each in drifts.items()),
        title=f'Figure {number}: path of the body on the {floor} floor',
        caption=f'Fifteen gait cycles on {len(SEEDS)} floors, each with another seed. The scale '
        'of y is larger than that of x.',
    )


def _path_claims(number: int, drifts: Slips, shares: Slips) -> tuple[Claim, ...]:
    seeds = f'{len(SEEDS)} floors, L2'
    straight = max(shares['dry_flat'].max(), shares['wet_dome'].max())
    return (
        claim(
            'wet flat feet leave',
            f'At the end the body is {_few(drifts["wet_flat"])} mm aside; on dry ground at '
            f'most {drifts["dry_flat"].max():.0f} mm ({seeds}).',
            tuple(drifts['wet_flat'].tolist()),
            bool(
                shares['wet_flat'].min() > STRAIGHT
                and drifts['wet_flat'].min() > drifts['dry_flat'].max()
            ),
            figure=number,
        ),
        claim(
            'wet domes keep a',
            f'At the end the body is {_few(drifts["wet_dome"])} mm aside, at most '
            f'{100.0 * straight:.1f} % of its distance ({seeds}).',
            tuple(drifts['wet_dome'].tolist()),
            bool(straight <= STRAIGHT),
            figure=number,
        ),
    )


def _slip_a_cycle(trial: Trial) -> list[float]:
    """Return the mean slip path of each foot in a gait cycle, mm."""
    assert trial.metrics is not None
    return [1e3 * each / trial.metrics.cycles for each in trial.metrics.slip_path_m]


def _few(values: np.ndarray, form: str = '.0f') -> str:
    return ', '.join(f'{value:{form}}' for value in values)


def _seconds(value: float | None) -> str:
    return 'never' if value is None else f'{value:.1f} s'

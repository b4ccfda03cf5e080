# SPDX-License-Identifier: Apache-2.0
"""Measure delay, misses and false alarms of slip alarms on recorded walks, also with disturbances.

A hexapod walks in closed loop on floors with wet patches and on the thesis' wet and dry floors.
The readings of its sensors are recorded once, with the truth, and each method gets the same
readings.

The truth is the motion of the contact over the floor. A *slip* is an interval with more than 5
mm/s under more than 0.15 of the expected load, with gaps below 20 ms; slips of more than 3 mm
count. A slip is *missed* if no alarm is on until 60 ms after its end. A *stick* is a time at which
the contact moves less than 0.5 mm from 0.3 s before to 60 ms after; an alarm that starts in a
stick, or continues into it, is *false*. With full dynamics (L2), feet on dry ground scrub all the
time. So walks in the plane (L1), and standing feet that are pulled to and fro, are added for
sticks.

Without MuJoCo all walks are in the plane.
"""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from ros_pad.pace import Progress
from studies.work_precision.estimator import chart
from studies.work_precision.estimator.conditions import CHANGES
from studies.work_precision.estimator.conditions import by_walk
from studies.work_precision.estimator.conditions import stress
from studies.work_precision.estimator.methods import compare
from studies.work_precision.estimator.tally import Row
from studies.work_precision.estimator.walks import FEW_CYCLES
from studies.work_precision.estimator.walks import full
from studies.work_precision.estimator.walks import recordings


def measure(progress: Progress) -> list[Row]:
    """Record, compare the methods, and test the estimator; report progress, 0 to 1."""
    rows = compare(recordings(), lambda share: progress(0.1 * share))
    rows += stress(CHANGES, lambda share: progress(0.1 + 0.5 * share))
    return rows + by_walk(FEW_CYCLES, lambda share: progress(0.6 + 0.4 * share))


NEEDS_MUJOCO = 'full dynamics not compared: pip install "ros_pad[mujoco]"'
_HEADINGS = (
    'delay', 'slipped', 'misses', 'false/', 'update', 'Brier', 'wet', 'within', 'margin',
    '2 sigma: dry', 'wet', 'dome',
)  # fmt: skip
_UNITS = ('ms', 'mm', '%', 'minute', 'us', '', 'right', '2 sigma', 'below 5 %', '', '', '')
_WIDTHS = [max(10, len(a) + 2, len(b) + 2) for a, b in zip(_HEADINGS, _UNITS, strict=True)]


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text."""
    lines = []
    for part, title in (
        ('methods', 'methods, each over its thresholds'),
        ('robustness', 'FootEstimator under changed conditions (* ordinary)'),
        ('walks', 'FootEstimator by robot and floors, with 95 % intervals over walks'),
    ):
        mine = [row for row in rows if row.part == part]
        if not mine:
            continue
        lines.append(
            f'{title}: {max(row.slips for row in mine)} slips and'
            f' {max(row.stick_minutes for row in mine):.1f} minutes of stick at most'
        )
        for heads in (_HEADINGS, _UNITS):
            cells = ''.join(f'{head:>{width}}' for head, width in zip(heads, _WIDTHS, strict=True))
            lines.append(f'  {"":38}{cells}')
        lines += [_line(row) for row in mine]
    if full() == 'L1':
        lines.append(NEEDS_MUJOCO)
    return '\n'.join(lines)


def _line(row: Row) -> str:
    name = ', '.join(filter(None, (row.name, row.variant)))
    named = f'{name} {row.value:g} {row.unit}'.strip() + (' *' if row.shipped else '')
    values = (
        _shown(row.delay, 1e3), _shown(row.slip_distance, 1e3), _shown(row.misses, 1e2),
        _shown(row.false_per_minute), _shown(row.us_per_update), _shown(row.brier),
        _shown(row.wet_right), _shown(row.coverage), _shown(row.below),
        *(_shown(row.coverages.get(name)) for name in ('dry', 'wet', 'dome')),
    )  # fmt: skip
    cells = ''.join(f'{value:>{width}}' for value, width in zip(values, _WIDTHS, strict=True))
    note = row.note
    if row.walks:
        ends = ', '.join(f'{name} {a:.3g} to {b:.3g}' for name, (a, b) in row.intervals.items())
        note = f'{row.walks} walks, {row.slips} slips; {ends}'
    return f'  {named:38}{cells}' + (f'  {note}' if note else '')


def _shown(value: float | None, scale: float = 1.0) -> str:
    return '-' if value is None else f'{scale * value:.3g}'


def figures(rows: Sequence[Row], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the pictures, by name."""
    return {
        'estimator': chart.draw_methods(rows),
        'estimator_robustness': chart.draw_robustness(rows),
    }

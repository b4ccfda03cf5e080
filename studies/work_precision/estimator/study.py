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

Walks with noise that is larger, or configured wrong, are counted on floors on which settings were
chosen and on others, with intervals over walks.

--walks 1 takes 2 minutes on two cores: one walk of each kind, and the ends of each change.

Without MuJoCo all walks are in the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from matplotlib.figure import Figure

from ros_pad.commands.folder import new_folder
from studies import command
from studies.work_precision.estimator import chart, conditions
from studies.work_precision.estimator.methods import compare
from studies.work_precision.estimator.tally import Row
from studies.work_precision.estimator.walks import full, recordings


def measure(count: int | None, processes: int) -> dict[str, Any]:
    """Run all parts on so many walks of each kind, or on all; return the JSON."""
    walks = conditions.walk_cases(count)
    tasks: list[tuple[Any, ...]] = [(_methods, count)]
    tasks += [(_stress, place, count) for place in range(len(conditions.CHANGES))]
    tasks += [(conditions.tallies, *case) for case in walks]
    found = iter(command.in_processes(_call, tasks, processes, 'estimator', 'part'))
    rows = next(found)
    for _ in conditions.CHANGES:
        rows += next(found)
    rows += conditions.rows_by_walk(walks, [next(found) for _ in walks])
    return {'walks': count, 'rows': [asdict(row) for row in rows]}


def _call(function: Callable[..., Any], *values: Any) -> Any:
    return function(*values)


def _methods(count: int | None) -> list[Row]:
    return compare(recordings(count), lambda _: None)


def _stress(place: int, count: int | None) -> list[Row]:
    return conditions.stress(conditions.CHANGES[place], count)


def main(words: Sequence[str]) -> int:
    """Measure, print, save and draw."""
    part = command.parser('estimator', __doc__)
    command.add_count(part, '--walks', None, 'walks of each kind, for a short run')
    command.add_processes(part)
    command.add_out(part, None)
    part.add_argument(
        '--docs', action='store_true', help='write JSON and pictures of the documentation'
    )
    options = part.parse_args(words)
    document = measure(options.walks, options.processes)
    folder = command.CHARTS if options.docs else options.out or new_folder(None, 'chart_estimator')
    rows = [Row(**row) for row in document['rows']]
    kept = command.write(folder, 'estimator', document, figures(rows))
    command.show(options, kept, table(rows))
    return 0


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
        note += f': {row.walks} walks, {row.slips} slips; {ends}'
    return f'  {named:38}{cells}' + (f'  {note}' if note else '')


def _shown(value: float | None, scale: float = 1.0) -> str:
    return '-' if value is None else f'{scale * value:.3g}'


def figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the pictures, by name."""
    return {
        'estimator': chart.draw_methods(rows),
        'estimator_robustness': chart.draw_robustness(rows),
    }

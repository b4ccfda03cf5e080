# SPDX-License-Identifier: Apache-2.0
"""Measure delay, misses and false alarms of slip alarms on recorded walks, also with disturbances.

A hexapod walks in closed loop on floors with wet patches and on the thesis' wet and dry floors.
The readings of its sensors are recorded once, with the truth, and each method gets the same
readings.

The truth is the motion of the contact over the floor; slips and false alarms are those of
studies/slips.py. With full dynamics (L2), feet on dry ground scrub all the time. So walks in the
plane (L1), and standing feet that are pulled to and fro, are added for sticks.

Walks with noise that is larger, or configured wrong, are counted on floors on which no setting was
chosen, with intervals over walks.

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
from studies.work_precision.estimator.walks import recordings


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


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text; s, m, 1/min, us, shares."""
    return command.listed([asdict(row) for row in rows])


def figures(rows: Sequence[Row]) -> dict[str, Figure]:
    """Return the pictures, by name."""
    return {
        'estimator': chart.draw_methods(rows),
        'estimator_robustness': chart.draw_robustness(rows),
    }

# SPDX-License-Identifier: Apache-2.0
"""Compare methods for one problem: time each, and compare its results with the reference."""

from __future__ import annotations

import math
import statistics
import time
import warnings
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D

from ros_pad.contact.pad import Array
from ros_pad.errors import PadError
from ros_pad.pace import Progress
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import PALE
from studies.drawing import VERMILION

# Rows of a batch when it is timed, and how long a method for one case is repeated, s.
BATCH = 100_000
TIMED = 0.05
REPEATS = 5
# Errors that a method raises if it has no result.
_REFUSALS = (ArithmeticError, ValueError, RuntimeError, PadError)
_FLOOR = 1e-17  # smaller errors are drawn here: the resolution of a double
_CAPTION = (
    'Disc: median error; whisker: worst of the answers that are no failures. An error of 0 is'
    ' drawn at 1e-17. Green: ros_pad; blue: others; orange: others that are wrong without a'
    ' warning.'
)


@dataclass(frozen=True)
class Problem:
    """A problem: a sample of cases with their true results.

    Attributes
    ----------
    name : str
    inputs : mapping of str to array
        Cases: one array for each argument of a method, by name and unit.
    truth : array
        True result of each case.
    ordinary : array of bool
        Cases on which methods are timed, because no method fails there.
    wrong : float
        Relative error above which a result without a warning is wrong; infinite for methods that
        approximate, whose error is measured.
    """

    name: str
    inputs: Mapping[str, Array]
    truth: Array
    ordinary: np.ndarray[Any, np.dtype[np.bool_]]
    wrong: float = 0.01


@dataclass(frozen=True)
class Method:
    """A method of solving a problem.

    Attributes
    ----------
    name : str
    solve : callable
        Takes the inputs in their order, as floats or (``batch``) arrays. If it has no result, it
        returns NaN; for floats it may also raise or warn.
    batch : bool
        Whether ``solve`` takes arrays with all cases.
    ours : bool
        Whether the method belongs to ros_pad, for the picture.
    """

    name: str
    solve: Callable[..., Any]
    batch: bool = False
    ours: bool = False


@dataclass(frozen=True)
class Result:
    """Result of a method on a problem.

    Attributes
    ----------
    problem, method : str
    us_per_solve : float
        Median time of one solution of an ordinary case, microseconds.
    error : float
        Largest relative error of the results that are no failures.
    median_error : float
        Median of the same errors.
    failures : int
        Number of cases without a result, with a warning, or with a wrong result.
    wrong : int
        Number of wrong results without a warning.
    cases : int
    versus : float
        Time over the time of the baseline.
    baseline : str
        Name of the method that times are compared with.
    examples : list
        Up to five cases that failed: the inputs and the result.
    ours : bool
    """

    problem: str
    method: str
    us_per_solve: float
    error: float
    median_error: float
    failures: int
    wrong: int
    cases: int
    versus: float
    baseline: str
    examples: list[dict[str, Any]]
    ours: bool


def run(
    problem: Problem, methods: Sequence[Method], baseline: str, progress: Progress | None = None
) -> list[Result]:
    """Measure each method; times are compared with that of the method named ``baseline``.

    ``progress`` is called with the number of methods that are done.
    """
    results = []
    for done, method in enumerate(methods):
        answers = answer(method, problem)
        results.append(_result(problem, method, answers, _time(method, problem), baseline))
        if progress is not None:
            progress(done + 1)
    base = next(result.us_per_solve for result in results if result.method == baseline)
    return [
        Result(**{**asdict(result), 'versus': result.us_per_solve / base}) for result in results
    ]


def answer(method: Method, problem: Problem) -> Array:
    """Return the method's result for each case; NaN where it raises or warns for one case.

    A method for batches must neither raise nor warn.
    """
    inputs = list(problem.inputs.values())
    with warnings.catch_warnings(), np.errstate(all='ignore'):
        warnings.simplefilter('error')
        if method.batch:
            return np.asarray(method.solve(*inputs), dtype=np.float64)
        answers = np.full(len(problem.truth), np.nan)
        for case, values in enumerate(zip(*(column.tolist() for column in inputs), strict=True)):
            with suppress(*_REFUSALS, Warning):
                answers[case] = method.solve(*values)
    return answers


def _result(
    problem: Problem, method: Method, answers: Array, us_per_solve: float, baseline: str
) -> Result:
    error = abs(answers - problem.truth) / abs(problem.truth)
    refused, wrong = np.isnan(answers), error > problem.wrong
    failed = refused | wrong
    good = error[~failed]
    examples = [
        {
            **{name: float(column[case]) for name, column in problem.inputs.items()},
            'truth': float(problem.truth[case]),
            'answer': None if refused[case] else float(answers[case]),
        }
        for case in np.flatnonzero(failed)[:5]
    ]
    return Result(
        problem=problem.name,
        method=method.name,
        us_per_solve=us_per_solve,
        error=float(good.max()) if good.size else math.nan,
        median_error=float(np.median(good)) if good.size else math.nan,
        failures=int(failed.sum()),
        wrong=int(wrong.sum()),
        cases=len(problem.truth),
        versus=1.0,
        baseline=baseline,
        examples=examples,
        ours=method.ours,
    )


def _time(method: Method, problem: Problem) -> float:
    """Return the median time of one solution of an ordinary case, us."""
    inputs = [column[problem.ordinary] for column in problem.inputs.values()]
    size = len(inputs[0])
    if method.batch:
        rows = [np.resize(column, BATCH) for column in inputs]
        method.solve(*rows)  # one-time costs, such as a table, are not timed
        times = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            method.solve(*rows)
            times.append((time.perf_counter() - start) / BATCH)
        return 1e6 * statistics.median(times)
    cases = list(zip(*(column.tolist() for column in inputs), strict=True))
    times = []
    with warnings.catch_warnings(), np.errstate(all='ignore'):
        warnings.simplefilter('ignore')
        # Slow methods are timed on fewer cases, spread over the sample.
        start = time.perf_counter()
        _attempt(method, cases[0])
        once = time.perf_counter() - start
        few = cases[:: max(1, math.ceil(size * once / 1.0))]
        for _ in range(REPEATS):
            start, rounds = time.perf_counter(), 0
            while rounds == 0 or time.perf_counter() - start < TIMED:
                for values in few:
                    _attempt(method, values)
                rounds += 1
            times.append((time.perf_counter() - start) / (rounds * len(few)))
    return 1e6 * statistics.median(times)


def _attempt(method: Method, values: tuple[float, ...]) -> None:
    with suppress(*_REFUSALS):
        method.solve(*values)


# --- table and picture ---------------------------------------------------------------------------


def table(results: Sequence[Result]) -> str:
    """Return the results as text, one block for each problem."""
    lines = []
    for name in dict.fromkeys(result.problem for result in results):
        part = [result for result in results if result.problem == name]
        width = max(len(result.method) for result in part)
        lines += [
            f'{name} ({part[0].cases} cases; times against {part[0].baseline})',
            f'  {"method":{width}}  us/solve      ratio   median error  worst error'
            '  failures  of these wrong',
        ]
        for result in part:
            ratio = f'1/{1 / result.versus:.0f}' if result.versus < 0.5 else f'{result.versus:.2g}'
            lines.append(
                f'  {result.method:{width}}  {result.us_per_solve:8.4g} {ratio:>10}'
                f'   {result.median_error:12.1e} {result.error:12.1e}'
                f'  {result.failures:8d}  {result.wrong:14d}'
            )
        lines.append('')
    return '\n'.join(lines)


WIDTH, HEIGHT = 5.2, 6.6
"""Of a panel with the names of its methods, in."""


def chart(results: Sequence[Result]) -> Figure:
    """Return the log-log picture of time against error, a panel for each problem."""
    problems = len({result.problem for result in results})
    figure = Figure(figsize=(WIDTH * problems, HEIGHT), layout='constrained')
    draw(results, figure)
    return figure


def draw(results: Sequence[Result], figure: Figure | SubFigure) -> None:
    """Draw time against error, a panel for each problem.

    A disc is the median error of a method; its whisker ends at the worst error. The list below the
    panel has the names of the methods, by rising time, and their numbers of failures.
    """
    problems = list(dict.fromkeys(result.problem for result in results))
    panels = figure.subplots(1, len(problems), squeeze=False)[0]
    numbers = []
    for panel, name in zip(panels, problems, strict=True):
        part = sorted(
            (result for result in results if result.problem == name),
            key=lambda result: result.us_per_solve,
        )
        panel.set(xscale='log', yscale='log', title=name, xlabel='time for one solution, µs')
        panel.set_ylabel('relative error')
        handles = []
        for number, result in enumerate(part, start=1):
            colour = GREEN if result.ours else VERMILION if result.wrong else BLUE
            low, high = max(result.median_error, _FLOOR), max(result.error, _FLOOR)
            panel.plot(
                [result.us_per_solve] * 2, [low, high], '-_', color=colour, lw=1.2, alpha=0.7
            )
            disc = {'marker': 'o', 'color': colour, 'ms': 7, 'ls': '', 'mec': 'white'}
            panel.plot(result.us_per_solve, low, **disc, zorder=3)
            numbers.append((panel, f'{number}', result.us_per_solve, low, colour))
            text = f'{number}  {result.method}'
            if result.failures:
                text += f': {result.failures} of {result.cases} fail'
                text += f', {result.wrong} silently' if result.wrong else ''
            handles.append(Line2D([], [], marker='o', color=colour, ls='', ms=7, label=text))
        panel.grid(color=PALE, alpha=0.3, lw=0.5)
        panel.spines[['top', 'right']].set_visible(False)
        panel.margins(x=0.1, y=0.1)
        panel.legend(
            handles=handles,
            loc='upper left',
            bbox_to_anchor=(-0.12, -0.13),
            frameon=False,
            fontsize=8.5,
            handletextpad=0.2,
        )
    figure.supxlabel(_CAPTION, fontsize=8.5)
    _write_numbers(figure, numbers)


def _write_numbers(
    figure: Figure | SubFigure, numbers: Sequence[tuple[Axes, str, float, float, str]]
) -> None:
    """Write each number beside its disc, where it covers no disc and no other number."""
    figure.figure.draw_without_rendering()  # positions are final only after this call
    places = [panel.transData.transform((x, y)) for panel, _, x, y, _ in numbers]
    points = figure.dpi / 72.0
    taken = list(places)
    for (panel, text, x, y, colour), place in zip(numbers, places, strict=True):
        around = [
            (reach * math.cos(angle), reach * math.sin(angle))
            for reach in (9.0, 14.0, 20.0)
            for angle in np.radians((-90.0, 0.0, 180.0, -45.0, -135.0, 45.0, 135.0))
        ]

        def room(shift: tuple[float, float], place: Array = place) -> float:
            there = place + points * np.array(shift)
            return min(math.dist(there, other) for other in taken)

        shift = next((each for each in around if room(each) > 8.5 * points), max(around, key=room))
        taken.append(place + points * np.array(shift))
        panel.annotate(
            text,
            (x, y),
            xytext=shift,
            textcoords='offset points',
            ha='center',
            va='center',
            fontsize=8.5,
            color=colour,
            zorder=4,
        )

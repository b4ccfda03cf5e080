# SPDX-License-Identifier: Apache-2.0
"""Compare methods for one problem: time each, and compare its results with the reference."""

from __future__ import annotations

import math
import statistics
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from ros_pad.contact.pad import Array
from ros_pad.errors import PadError
from ros_pad.pace import Progress
from studies.drawing import BLUE, GREEN, PALE, VERMILION

# Rows of a batch when it is timed, and how long a method for one case is repeated, s.
BATCH = 100_000
TIMED = 0.05
REPEATS = 5
# Errors that a method raises if it has no result.
_REFUSALS = (ArithmeticError, ValueError, RuntimeError, PadError)
_FLOOR = 1e-17  # smaller errors are drawn here: the resolution of a double
_CAPTION = (
    'Green: ros_pad; blue: others; orange: others that are wrong without a warning.\n'
    'The worst error is that of the answers that are no failures; an error of 0 is drawn at 1e-17.'
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


def both(name: str, solve: Callable[..., Any]) -> tuple[Method, Method]:
    """Return a method of ros_pad, for one case and for batches."""
    return Method(name, solve, ours=True), Method(f'{name}, batch', solve, batch=True, ours=True)


Result = SimpleNamespace
"""Result of a method on a problem.

- ``problem``, ``method``, ``ours``
- ``us_per_solve``: median time of one solution of an ordinary case, microseconds
- ``error``, ``median_error``: largest and median relative error of results that are no failures
- ``failures``: cases without a result, with a warning, or with a wrong result, of ``cases``
- ``wrong``: wrong results without a warning
- ``versus``: time over the time of the method named ``baseline``
- ``examples``: up to five cases that failed: the inputs and the result
"""


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
    for result in results:
        result.versus = result.us_per_solve / base
    return results


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


# --- picture ---------------------------------------------------------------------------


WIDTH = 9.0
"""Of a picture, in."""


def inches(results: Sequence[Result]) -> float:
    """Return the height, in, of the picture of results: a line for each, and each problem."""
    return 0.19 * (len(results) + len({result.problem for result in results})) + 1.2


def chart(results: Sequence[Result]) -> Figure:
    """Return the picture of times and errors, a block of lines for each problem."""
    figure = Figure(figsize=(WIDTH, inches(results)), layout='constrained')
    draw(results, figure)
    return figure


def draw(results: Sequence[Result], figure: Figure | SubFigure) -> None:
    """Draw times and errors side by side, a line for each method, by problem and rising time.

    A disc is the time or median error of a method; a whisker ends at its worst error.
    """
    times, errors = figure.subplots(1, 2, sharey=True)
    names: list[str] = []
    heads = []
    for problem in dict.fromkeys(result.problem for result in results):
        heads.append(len(names))
        names.append(problem)
        part = [result for result in results if result.problem == problem]
        for result in sorted(part, key=lambda result: result.us_per_solve):
            _line(times, errors, len(names), result)
            names.append(result.method)
    times.set_yticks(range(len(names)), names, fontsize=9.0)
    for head in heads:
        times.get_yticklabels()[head].set_fontweight('bold')
    times.set(xscale='log', xlabel='time for one solution, µs', ylim=(len(names) - 0.4, -0.6))
    errors.set(xscale='log', xlabel='error, relative: median to worst')
    for panel in (times, errors):
        panel.tick_params(axis='y', length=0)
        panel.grid(color=PALE, alpha=0.3, lw=0.5)
        panel.spines[['top', 'right']].set_visible(False)
    figure.supxlabel(_CAPTION, fontsize=9.0)


def _line(times: Axes, errors: Axes, place: int, result: Result) -> None:
    colour = GREEN if result.ours else VERMILION if result.wrong else BLUE
    disc: dict[str, Any] = {'marker': 'o', 'color': colour, 'ms': 6.5, 'mec': 'white', 'zorder': 3}
    low, high = max(result.median_error, _FLOOR), max(result.error, _FLOOR)
    times.plot(result.us_per_solve, place, **disc)
    errors.plot([low, high], [place] * 2, '-|', color=colour, lw=1.4)
    errors.plot(low, place, **disc)
    if result.failures:
        text = f'{result.failures} of {result.cases} fail'
        text += f', {result.wrong} silently' if result.wrong else ''
        errors.text(
            1.01, place, text, transform=errors.get_yaxis_transform(), va='center', fontsize=9.0,
            color=colour,
        )  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""A ladder: several ways to solve one problem, timed and compared with the truth in one run."""

from __future__ import annotations

import datetime
import math
import os
import pathlib
import platform
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
from matplotlib.lines import Line2D

from ros_pad.contact.pad import Array
from ros_pad.errors import PadError
from ros_pad.trials.report import BLUE
from ros_pad.trials.report import GREEN
from ros_pad.trials.report import PALE
from ros_pad.trials.report import VERMILION

Progress = Callable[[float], None]

# Rows of a batch when it is timed, and how long a method for one case is repeated, s.
BATCH = 100_000
_TIMED = 0.05
_REPEATS = 5
# How a method says that it has no answer.
_REFUSALS = (ArithmeticError, ValueError, RuntimeError, PadError)
_FLOOR = 1e-17  # errors below are drawn here: a double has none smaller
_CAPTION = (
    'Disc: median error; whisker: worst of the answers that are no failures. An error of 0 is'
    ' drawn at 1e-17. Green: ros_pad; blue: others; orange: others that are wrong without a'
    ' warning.'
)


@dataclass(frozen=True)
class Problem:
    """What is to be solved, with the truth.

    Attributes
    ----------
    name : str
    inputs : mapping of str to array
        The cases, one array for each argument of a method, by name and unit.
    truth : array
    ordinary : array of bool
        The cases on which methods are timed: those without a trap.
    wrong : float
        Relative error from which an answer without a word of warning is a wrong one; infinite
        where methods approximate, and their error is what is asked for.
    """

    name: str
    inputs: Mapping[str, Array]
    truth: Array
    ordinary: np.ndarray[Any, np.dtype[np.bool_]]
    wrong: float = 0.01


@dataclass(frozen=True)
class Method:
    """One way to solve a problem.

    Attributes
    ----------
    name : str
    solve : callable
        Takes the inputs in their order, floats or (``batch``) arrays. Where it knows that it has
        no answer it raises, warns, or returns NaN.
    batch : bool
    ours : bool
        For the picture.
    """

    name: str
    solve: Callable[..., Any]
    batch: bool = False
    ours: bool = False


@dataclass(frozen=True)
class Rung:
    """What a method achieved on a problem.

    Attributes
    ----------
    problem, method : str
    us_per_solve : float
        Median time of one solution of an ordinary case, microseconds.
    error : float
        Largest relative error of the answers that are no failures.
    median_error : float
    failures : int
        Answers refused, with a warning, or wrong.
    wrong : int
        Those of them that were given without a word.
    cases : int
    versus : float
        Time over that of the baseline.
    baseline : str
    examples : list
        Up to five cases that failed: the inputs, and what was answered.
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


def climb(
    problem: Problem, methods: Sequence[Method], baseline: str, progress: Progress | None = None
) -> list[Rung]:
    """Measure each method; ``baseline`` is the name of the one that the times are compared with.

    ``progress`` is told how many methods are done.
    """
    rungs = []
    for done, method in enumerate(methods):
        answers = answer(method, problem)
        rungs.append(_rung(problem, method, answers, _time(method, problem), baseline))
        if progress is not None:
            progress(done + 1)
    base = next(rung.us_per_solve for rung in rungs if rung.method == baseline)
    return [Rung(**{**asdict(rung), 'versus': rung.us_per_solve / base}) for rung in rungs]


def answer(method: Method, problem: Problem) -> Array:
    """Return the method's answer to each case; NaN where it says itself that it has none."""
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


def _rung(
    problem: Problem, method: Method, answers: Array, us_per_solve: float, baseline: str
) -> Rung:
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
    return Rung(
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
        method.solve(*rows)  # what is made once, such as a table, is not counted
        times = []
        for _ in range(_REPEATS):
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
        for _ in range(_REPEATS):
            start, rounds = time.perf_counter(), 0
            while rounds == 0 or time.perf_counter() - start < _TIMED:
                for values in few:
                    _attempt(method, values)
                rounds += 1
            times.append((time.perf_counter() - start) / (rounds * len(few)))
    return 1e6 * statistics.median(times)


def _attempt(method: Method, values: tuple[float, ...]) -> None:
    with suppress(*_REFUSALS):
        method.solve(*values)


# --- what is shown -------------------------------------------------------------------------------


def processor() -> str:
    """Return the model of the processor, and number of its cores."""
    name = platform.processor() or platform.machine()
    info = pathlib.Path('/proc/cpuinfo')
    if info.exists():
        lines = info.read_text(encoding='utf-8').splitlines()
        models = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
        name = models[0] if models else name
    return f'{name}, {os.cpu_count()} cores'


def machine() -> dict[str, str]:
    """Return what the times depend on: processor, Python, NumPy, date."""
    return {
        'processor': processor(),
        'system': platform.system(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'date': datetime.date.today().isoformat(),
    }


def table(rungs: Sequence[Rung]) -> str:
    """Return the rungs as text, one block for each problem."""
    lines = []
    for name in dict.fromkeys(rung.problem for rung in rungs):
        part = [rung for rung in rungs if rung.problem == name]
        width = max(len(rung.method) for rung in part)
        lines += [
            f'{name} ({part[0].cases} cases; times against {part[0].baseline})',
            f'  {"method":{width}}  us/solve      ratio   median error  worst error'
            '  failures  of these wrong',
        ]
        for rung in part:
            ratio = f'1/{1 / rung.versus:.0f}' if rung.versus < 0.5 else f'{rung.versus:.2g}'
            lines.append(
                f'  {rung.method:{width}}  {rung.us_per_solve:8.4g} {ratio:>10}'
                f'   {rung.median_error:12.1e} {rung.error:12.1e}'
                f'  {rung.failures:8d}  {rung.wrong:14d}'
            )
        lines.append('')
    return '\n'.join(lines)


def chart(rungs: Sequence[Rung]) -> Figure:
    """Return the log-log picture of time against error, a panel for each problem.

    A disc is the median error of a method, its whisker ends at the worst; the list below the panel
    has the names, by rising time, and what failed. The figure's last line says what is what.
    """
    problems = list(dict.fromkeys(rung.problem for rung in rungs))
    figure = Figure(figsize=(5.2 * len(problems), 6.6), layout='constrained')
    panels = figure.subplots(1, len(problems), squeeze=False)[0]
    numbers = []
    for panel, name in zip(panels, problems, strict=True):
        part = sorted(
            (rung for rung in rungs if rung.problem == name), key=lambda rung: rung.us_per_solve
        )
        panel.set(xscale='log', yscale='log', title=name, xlabel='time for one solution, µs')
        panel.set_ylabel('relative error')
        handles = []
        for number, rung in enumerate(part, start=1):
            colour = GREEN if rung.ours else VERMILION if rung.wrong else BLUE
            low, high = max(rung.median_error, _FLOOR), max(rung.error, _FLOOR)
            panel.plot([rung.us_per_solve] * 2, [low, high], '-_', color=colour, lw=1.2, alpha=0.7)
            disc = {'marker': 'o', 'color': colour, 'ms': 7, 'ls': '', 'mec': 'white'}
            panel.plot(rung.us_per_solve, low, **disc, zorder=3)
            numbers.append((panel, f'{number}', rung.us_per_solve, low, colour))
            said = f'{number}  {rung.method}'
            if rung.failures:
                said += f': {rung.failures} of {rung.cases} fail'
                said += f', {rung.wrong} silently' if rung.wrong else ''
            handles.append(Line2D([], [], marker='o', color=colour, ls='', ms=7, label=said))
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
    _write_numbers(figure, numbers)
    figure.supxlabel(_CAPTION, fontsize=8.5)
    return figure


def _write_numbers(figure: Figure, numbers: Sequence[tuple[Axes, str, float, float, str]]) -> None:
    """Write each number beside its disc, where neither a disc nor another number stands."""
    figure.draw_without_rendering()  # places are known only then
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

# SPDX-License-Identifier: Apache-2.0
import math
import time
import warnings

import numpy as np
import pytest

from ros_pad.errors import NoEquilibrium
from ros_pad.ladders.ladder import Method
from ros_pad.ladders.ladder import Problem
from ros_pad.ladders.ladder import answer
from ros_pad.ladders.ladder import climb
from ros_pad.ladders.ladder import table

SQUARES = Problem(
    'square root',
    {'square': np.array([1.0, 4.0, 9.0, 16.0])},
    np.array([1.0, 2.0, 3.0, 4.0]),
    np.array([True, True, False, False]),
)


def _warns(square):
    warnings.warn('not sure', RuntimeWarning, stacklevel=1)
    return math.sqrt(square)


def _raises(square):
    raise NoEquilibrium('no root', 'flattened')


def test_warnings_errors_and_nan_are_refusals():
    for solve in (_warns, _raises, lambda square: math.nan, lambda square: 1 / 0):
        assert np.isnan(answer(Method('m', solve), SQUARES)).all()
    # A fault of the method's own is none.
    with pytest.raises(TypeError):
        answer(Method('m', lambda square: square + 'a'), SQUARES)


def test_errors_failures_and_wrong_answers_are_told_apart():
    methods = [
        Method('right', math.sqrt),
        Method('coarse', lambda square: 1.001 * math.sqrt(square)),
        Method('wrong at 9', lambda square: 2.0 if square == 9.0 else math.sqrt(square)),
        Method('silent at 9', lambda square: math.nan if square == 9.0 else math.sqrt(square)),
        Method('batch', np.sqrt, batch=True),
    ]
    done = []
    rungs = {rung.method: rung for rung in climb(SQUARES, methods, 'right', done.append)}
    assert done == [1, 2, 3, 4, 5]
    assert (rungs['right'].error, rungs['right'].failures) == (0.0, 0)
    assert rungs['coarse'].error == pytest.approx(1e-3)
    assert rungs['coarse'].failures == 0
    assert (rungs['wrong at 9'].failures, rungs['wrong at 9'].wrong) == (1, 1)
    assert rungs['wrong at 9'].examples == [{'square': 9.0, 'truth': 3.0, 'answer': 2.0}]
    assert (rungs['silent at 9'].failures, rungs['silent at 9'].wrong) == (1, 0)
    assert rungs['silent at 9'].examples[0]['answer'] is None
    assert rungs['right'].versus == 1.0
    assert rungs['batch'].us_per_solve < rungs['right'].us_per_solve
    text = table(list(rungs.values()))
    assert 'square root (4 cases; times against right)' in text
    assert all(method.name in text for method in methods)


def test_time_is_that_of_one_solution_of_an_ordinary_case():
    def slow(square):
        # Case 9 and 16 are not ordinary: their time must not count.
        time.sleep(2e-3 if square < 9.0 else 50e-3)
        return math.sqrt(square)

    (rung,) = climb(SQUARES, [Method('slow', slow)], 'slow')
    assert 2e3 < rung.us_per_solve < 40e3

# SPDX-License-Identifier: Apache-2.0
import math
import warnings

import numpy as np
import pytest

from ros_pad.errors import NoEquilibrium
from studies.work_precision.comparison import Method, Problem, answer, run

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
    # A programming error in a method is no refusal.
    with pytest.raises(TypeError):
        answer(Method('m', lambda square: square + 'a'), SQUARES)


def test_errors_failures_and_wrong_answers_are_separated():
    methods = [
        Method('right', math.sqrt),
        Method('coarse', lambda square: 1.001 * math.sqrt(square)),
        Method('wrong at 9', lambda square: 2.0 if square == 9.0 else math.sqrt(square)),
        Method('silent at 9', lambda square: math.nan if square == 9.0 else math.sqrt(square)),
        Method('batch', np.sqrt, batch=True),
    ]
    done = []
    results = {result.method: result for result in run(SQUARES, methods, 'right', done.append)}
    assert done == [1, 2, 3, 4, 5]
    assert (results['right'].error, results['right'].failures) == (0.0, 0)
    assert results['coarse'].error == pytest.approx(1e-3)
    assert results['coarse'].failures == 0
    assert (results['wrong at 9'].failures, results['wrong at 9'].wrong) == (1, 1)
    assert results['wrong at 9'].examples == [{'square': 9.0, 'truth': 3.0, 'answer': 2.0}]
    assert (results['silent at 9'].failures, results['silent at 9'].wrong) == (1, 0)
    assert results['silent at 9'].examples[0]['answer'] is None
    assert results['right'].versus == 1.0

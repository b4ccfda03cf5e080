# SPDX-License-Identifier: Apache-2.0
"""The planar step as machine code, where numba is installed (``pip install "ros_pad[fast]"``)."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import cache
from typing import Any

from ros_pad.errors import ConfigError
from ros_pad.simulation import planar_step

# Steps that take as long in plain Python as compiling does (4 s; a copy kept on disk loads in
# 0.3 s): a trial that compiles is never slower for it, not even the first.
WORTH_LOADING = 150_000

Walk = Callable[..., bool]


def worth_loading(steps: float) -> bool:
    """Whether to compile for so many steps: numba is there, and loaded or soon paid for."""
    return _dispatcher.cache_info().currsize > 0 or (
        steps >= WORTH_LOADING and importlib.util.find_spec('numba') is not None
    )


def walk(*arguments: Any) -> Walk:
    """Return :func:`ros_pad.simulation.planar_step.walk`, compiled for arguments like these.

    The compiled copy is kept on disk beside the source, or where numba finds room: making it takes
    seconds, loading it a tenth of one. What is returned takes arguments of these types only, which
    it does not look at: that would cost more than the step.

    Raises
    ------
    ConfigError
        Without numba, naming the extra that brings it.
    """
    dispatcher, typeof = _dispatcher()
    compiled: Walk = dispatcher.compile(tuple(map(typeof, arguments)))
    return compiled


@cache
def _dispatcher() -> tuple[Any, Callable[[Any], Any]]:
    try:
        import numba
    except ImportError as error:
        raise ConfigError('compiled steps need numba: pip install "ros_pad[fast]"') from error
    for function in planar_step.PARTS:
        numba.extending.register_jitable(error_model='numpy')(function)
    try:
        made = numba.njit(cache=True, error_model='numpy')(planar_step.walk)
    except RuntimeError:  # there is nowhere to keep a copy
        made = numba.njit(error_model='numpy')(planar_step.walk)
    return made, numba.typeof

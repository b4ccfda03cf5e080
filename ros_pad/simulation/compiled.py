# SPDX-License-Identifier: Apache-2.0
"""The planar step as machine code, where numba is installed (``pip install "ros_pad[fast]"``)."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from ros_pad.contact import laws
from ros_pad.errors import ConfigError
from ros_pad.simulation import planar_step

# So many steps take as long in plain Python as compiling does (4 s; a copy on disk loads in
# 0.3 s). For fewer steps, compiling would make a trial slower.
WORTH_LOADING = 150_000

Step = Callable[..., bool]


def worth_loading(steps: float) -> bool:
    """Return whether compiled steps save time in a trial of so many steps.

    They do if they were compiled or loaded before in this process, or from ``WORTH_LOADING``
    steps on if numba is installed.
    """
    return dispatcher.cache_info().currsize > 0 or (
        steps >= WORTH_LOADING and importlib.util.find_spec('numba') is not None
    )


def step(*arguments: Any) -> Step:
    """Return :func:`ros_pad.simulation.planar_step.step`, compiled for the types of the arguments.

    The compiled copy is kept on disk beside the source, or where numba can write: making it takes
    4 s, loading it 0.3 s. The returned function takes only arguments of these types
    and does not check them: a check would take longer than the step.

    Raises
    ------
    ConfigError
        Without numba; the message names the extra that installs it.
    """
    made, typeof = dispatcher()
    compiled: Step = made.compile(tuple(map(typeof, arguments)))
    return compiled


@cache
def dispatcher() -> tuple[Any, Callable[[Any], Any]]:
    """Return numba's dispatcher of the step, and numba's ``typeof``; both are made only once."""
    try:
        import numba
    except ImportError as error:
        raise ConfigError('compiled steps need numba: pip install "ros_pad[fast]"') from error
    for module in (laws, planar_step):
        for part in vars(module).values():
            if inspect.isfunction(part) and part.__module__ == module.__name__:
                numba.extending.register_jitable(error_model='numpy')(part)
    advance, sources = planar_step.step, inspect.getsource(laws) + inspect.getsource(planar_step)
    version = hashlib.sha256(sources.encode()).hexdigest()

    def step(model: Any, body: Any, feet: Any, pressures: Any) -> bool:
        # numba takes a copy from disk only if the values that a function refers to are the same.
        return advance(model, body, feet, pressures) if version else False

    try:
        made = numba.njit(cache=True, error_model='numpy')(step)
    except RuntimeError:  # numba finds no folder that is writable
        made = numba.njit(error_model='numpy')(step)
    return made, numba.typeof

# SPDX-License-Identifier: Apache-2.0
"""Steps as machine code, where numba is installed (``pip install "ros_pad[fast]"``)."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

from ros_pad.contact import laws
from ros_pad.errors import ConfigError
from ros_pad.simulation import balance_step, planar_step

# Modules with a function step, and those that it needs; and so many steps take as long in plain
# Python as compiling does (4 to 8 s; a copy on disk loads in 0.3 s): for fewer, compiling would
# make a trial slower.
_STEPS = {planar_step: ((laws, planar_step), 150_000), balance_step: ((balance_step,), 8_000)}

Step = Callable[..., bool]


def worth_loading(module: ModuleType, steps: float) -> bool:
    """Return whether compiled steps save time in a trial of so many steps.

    They do if they were compiled or loaded before in this process, or in a long trial if numba is
    installed.
    """
    return module in _loaded or (
        steps >= _STEPS[module][1] and importlib.util.find_spec('numba') is not None
    )


def step(module: ModuleType, *arguments: Any) -> Step:
    """Return the function ``step`` of a module, compiled for the types of the arguments.

    The compiled copy is kept on disk beside the source, or where numba can write. The returned
    function takes only arguments of these types and does not check them: a check would take longer
    than the step.

    Raises
    ------
    ConfigError
        Without numba; the message names the extra that installs it.
    """
    made, typeof = dispatcher(module)
    compiled: Step = made.compile(tuple(map(typeof, arguments)))
    _loaded.add(module)
    return compiled


_loaded: set[ModuleType] = set()


@cache
def dispatcher(module: ModuleType) -> tuple[Any, Callable[[Any], Any]]:
    """Return numba's dispatcher of a module's step, and numba's ``typeof``; made only once."""
    try:
        import numba
    except ImportError as error:
        raise ConfigError('compiled steps need numba: pip install "ros_pad[fast]"') from error
    for needed in _STEPS[module][0]:
        for part in vars(needed).values():
            if inspect.isfunction(part) and part.__module__ == needed.__name__:
                numba.extending.register_jitable(error_model='numpy')(part)
    step = module.step
    if module is planar_step:  # numba itself sees changes of one file only
        sources = inspect.getsource(laws) + inspect.getsource(planar_step)
        advance, version = step, hashlib.sha256(sources.encode()).hexdigest()

        def step(model: Any, body: Any, feet: Any, films: Any, pressures: Any) -> bool:
            # A copy from disk is taken only if the values that a function refers to are the same.
            return advance(model, body, feet, films, pressures) if version else False

    try:
        made = numba.njit(cache=True, error_model='numpy')(step)
    except RuntimeError:  # numba finds no folder that is writable
        made = numba.njit(error_model='numpy')(step)
    return made, numba.typeof

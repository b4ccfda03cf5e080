# SPDX-License-Identifier: Apache-2.0
"""Pressure regulators: their interface, the backends by name, and the supervision of a pad."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from ros_pad.configuration import nearest
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.regulators.alicat import AlicatRegulator
from ros_pad.regulators.protocol import Reading, Regulator
from ros_pad.regulators.serial_text import SerialTextRegulator, smc_itv
from ros_pad.regulators.simulated import SimulatedRegulator

__all__ = ['BACKENDS', 'Reading', 'Regulator', 'SimulatedRegulator', 'create']

BACKENDS: dict[str, Callable[..., Regulator]] = {
    'simulated': SimulatedRegulator,
    'alicat': AlicatRegulator,
    'smc_itv': smc_itv,
    'serial_text': SerialTextRegulator,
}
"""Classes or functions that make a regulator, by backend; their arguments are the options."""


def create(backend: str, **options: Any) -> Regulator:
    """Make a regulator of a backend.

    Parameters
    ----------
    backend : str
        A key of ``BACKENDS``.
    **options
        Arguments of that backend.

    Returns
    -------
    Regulator
        The regulator, not yet open.

    Raises
    ------
    ConfigError
        When there is no such backend or option, or the value of an option is not allowed; the
        message names what is allowed.

    Examples
    --------
    >>> regulator = create('simulated', hose_diameter=0.002)
    >>> regulator.open()
    >>> regulator.set_pressure(75e3)
    """
    if backend not in BACKENDS:
        raise ConfigError(
            f'there is no regulator backend {backend!r}: the backends are {", ".join(BACKENDS)}'
            f'{nearest(backend, [*BACKENDS])}'
        )
    allowed = inspect.signature(BACKENDS[backend]).parameters
    for name in options:
        if name not in allowed:
            raise ConfigError(
                f'regulator backend {backend!r} has no option {name!r} (= {options[name]!r}): its'
                f' options are {", ".join(allowed)}{nearest(name, [*allowed])}'
            )
    missing = [name for name, p in allowed.items() if p.default is p.empty and name not in options]
    if missing:
        raise ConfigError(f'regulator backend {backend!r} needs the option {missing[0]!r}')
    try:
        return BACKENDS[backend](**options)
    except InvalidInput as error:
        raise ConfigError(f'regulator backend {backend!r}: {error}') from error

# SPDX-License-Identifier: Apache-2.0
"""Constants of friction and film of a foot, fitted to tangential forces at which it slips."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ros_pad.configuration import quantity
from ros_pad.contact.film import Film
from ros_pad.contact.fits import Constant, fit_positive, kept_constant
from ros_pad.contact.foot_file import FITTED, UNITS
from ros_pad.contact.measurements import Friction, Measurements
from ros_pad.contact.pad import Array
from ros_pad.contact.resistance import FOOT_SETTINGS, Foot

# Start values of the constants of friction for a foot in which they are 0, and lower bounds where
# a foot file allows 0.
_STARTS = (0.3, 3e3, 1e4, 0.1, 3e-7, 2.0)
_LOWEST = (0.0, 1.0, 0.0, 1e-4, 0.0, 0.0)
_SETTINGS = {each.name: each for each in FOOT_SETTINGS}
# Start value, and lower and upper bound.
_FRICTION = {
    name: (start, max(low, _SETTINGS[name].low), _SETTINGS[name].high)
    for name, start, low in zip(FITTED, _STARTS, _LOWEST, strict=True)
}


class WetFloor(NamedTuple):
    """The liquid on the floor before a foot lands: thickness of the film, m, viscosity, Pa s."""

    film_thickness: float
    viscosity: float


def modelled_forces(friction: Friction, foot: Foot, floor: WetFloor) -> Array:
    """Return the model's largest tangential force for each row of measurements, N."""
    forces = []
    for pressure, load, _, wet, stance_time in zip(
        *(column.tolist() for column in friction), strict=True
    ):
        domes = foot.dome_load(load, pressure)
        sole = load - domes
        films = (0.0, 0.0)
        if wet:
            film = Film(foot, floor.viscosity)
            film.touch_down(floor.film_thickness)
            films = film.drain(domes, sole, pressure, stance_time)
        forces.append(foot.resistance_of(domes, sole, pressure, *films))
    return np.array(forces)


def fit_friction(
    measurements: Measurements, foot: Foot, floor: WetFloor, warnings: list[str]
) -> tuple[Foot, list[Constant]]:
    """Return the foot with the fitted constants of friction, and these constants; add warnings."""
    friction, source = measurements.friction, measurements.source
    for name in ('load', 'tangential_force'):
        quantity(f'{source}: {name}', getattr(friction, name), 'N', above=True)
    quantity(f'{source}: stance_time on a wet floor', friction.stance_time[friction.wet], 's')
    what = f'{source}: pressure of a friction row on the foot {foot.source}'
    quantity(what, friction.pressure, 'Pa', high=foot.ceiling)
    fitted: list[str] = []
    fit = None
    # A constant is added if the data identify it together with the earlier ones. The second round
    # is for constants that are identified only after a later one has been added.
    for name in [*FITTED, *FITTED]:
        if name in fitted or len(fitted) == len(friction.load):
            continue
        trial = [*fitted, name]
        before: list[float] = [] if fit is None else fit.values.tolist()
        start = getattr(foot, name) or _FRICTION[name][0]
        least, most = zip(*(_FRICTION[each][1:] for each in trial), strict=True)

        def forces(values: Array, names: Sequence[str] = trial) -> Array:
            return modelled_forces(friction, _changed(foot, names, values), floor)

        # The law has kinks: a fit can stop on the wrong side of one.
        attempts = [
            fit_positive(forces, friction.tangential_force, [*before, factor * start], least, most)
            for factor in (1.0, 0.3, 3.0)
        ]
        best = min(attempts, key=lambda attempt: attempt.cost)
        if best.identified():
            fitted, fit = trial, best
    constants = []
    note = 'not identified by these forces: kept'
    if not len(friction.load):
        note = 'no friction was measured'
    for name in FITTED:
        if fit is not None and name in fitted:
            words = f'{len(friction.load)} forces'
            constants.append(fit.constant(name, UNITS[name], words, fitted.index(name)))
        else:
            constants.append(kept_constant(name, UNITS[name], getattr(foot, name), note))
    kept = [name for name in FITTED if name not in fitted]
    if kept and len(friction.load):
        warnings.append(
            f'{", ".join(kept)}: not identified by the tangential forces; the fitted constants of'
            f' friction are valid only if these values of {foot.source} are right'
        )
    return foot if fit is None else _changed(foot, fitted, fit.values), constants


def _changed(foot: Foot, names: Sequence[str], values: Array) -> Foot:
    changes: dict[str, Any] = dict(zip(names, values.tolist(), strict=True))
    return dataclasses.replace(foot, **changes)

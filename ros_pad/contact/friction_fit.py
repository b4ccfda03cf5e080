# SPDX-License-Identifier: Apache-2.0
"""Constants of friction and film of a foot, fitted to tangential forces at which it slips."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_pad.contact.film import Film
from ros_pad.contact.fits import Constant, Fit, Residual, above_zero, fit_positive, kept_constant
from ros_pad.contact.foot_file import FITTED, UNITS
from ros_pad.contact.measurements import Friction, Measurements
from ros_pad.contact.pad import Array
from ros_pad.contact.resistance import FOOT_SETTINGS, Foot
from ros_pad.errors import InvalidInput

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


@dataclass(frozen=True)
class WetFloor:
    """The liquid on the floor before a foot lands."""

    film_thickness: float  # m
    viscosity: float  # Pa s


def _modelled_forces(friction: Friction, foot: Foot, floor: WetFloor) -> Array:
    """Return the model's largest tangential force for each row of measurements, N."""
    forces = []
    for pressure, load, _, wet, stance_time in zip(
        *(column.tolist() for column in friction), strict=True
    ):
        domes = foot.dome_load(load, pressure)
        sole = load - domes
        under_domes = under_sole = 0.0
        if wet:
            film = Film(foot, floor.viscosity)
            film.touch_down(floor.film_thickness)
            under_domes, under_sole = film.drain(domes, sole, pressure, stance_time)
        forces.append(foot.resistance_of(domes, sole, pressure, under_domes, under_sole))
    return np.array(forces)


def fit_friction(
    measurements: Measurements,
    foot: Foot,
    floor: WetFloor,
    constants: list[Constant],
    warnings: list[str],
) -> Foot:
    """Return the foot with the fitted constants of friction; add constants and warnings."""
    friction = measurements.friction
    if not len(friction.load):
        for name in FITTED:
            entry = kept_constant(
                name, UNITS[name], getattr(foot, name), 'no friction was measured'
            )
            constants.append(entry)
        return foot
    _check_friction(measurements, foot)
    fitted, fit = _identified_friction(friction, foot, floor)
    for name in FITTED:
        if fit is not None and name in fitted:
            constants.append(
                fit.constant(name, UNITS[name], f'{len(friction.load)} forces', fitted.index(name))
            )
        else:
            note = 'not identified by these forces: kept'
            constants.append(kept_constant(name, UNITS[name], getattr(foot, name), note))
    if fit is None:
        warnings.append(
            'all constants of friction are kept: the tangential forces identify none of them'
        )
        return foot
    kept = [name for name in FITTED if name not in fitted]
    if kept:
        warnings.append(
            f'{", ".join(kept)}: not identified by the tangential forces; the fitted constants of'
            f' friction are valid only if these values of {foot.source} are right'
        )
    return _changed(foot, fitted, fit.values)


def _changed(foot: Foot, names: Sequence[str], values: Array) -> Foot:
    changes: dict[str, Any] = dict(zip(names, values.tolist(), strict=True))
    return dataclasses.replace(foot, **changes)


def _check_friction(measurements: Measurements, foot: Foot) -> None:
    """Raise `InvalidInput` where friction measurements cannot be fitted."""
    friction = measurements.friction
    for name in ('load', 'tangential_force'):
        above_zero(measurements.source, name, getattr(friction, name))
    if np.isnan(friction.stance_time[friction.wet]).any():
        raise InvalidInput(
            f'{measurements.source}: friction on a wet floor needs stance_time, the time from'
            ' touch-down to slip, s'
        )
    if (friction.pressure > foot.ceiling).any():
        raise InvalidInput(
            f'{measurements.source}: pressure = {friction.pressure.max():g} Pa of a friction row'
            f' is above the ceiling of the foot {foot.source}, {foot.ceiling:g} Pa'
        )


def _identified_friction(
    friction: Friction, foot: Foot, floor: WetFloor
) -> tuple[list[str], Fit | None]:
    """Fit as many constants of friction as the forces identify; return their names and the fit."""

    def forces(names: Sequence[str], values: Array) -> Array:
        return _modelled_forces(friction, _changed(foot, names, values), floor)

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
        model = functools.partial(forces, trial)
        least, most = zip(*(_FRICTION[each][1:] for each in trial), strict=True)
        # The law has kinks: a fit can stop on the wrong side of one.
        attempts = [
            fit_positive(model, friction.tangential_force, [*before, factor * start], least, most)
            for factor in (1.0, 0.3, 3.0)
        ]
        best = min(attempts, key=lambda attempt: attempt.cost)
        if best.identified():
            fitted, fit = trial, best
    return fitted, fit


def friction_residuals(friction: Friction, foot: Foot, floor: WetFloor) -> list[Residual]:
    """Return the measured forces beside those of the foot."""
    modelled = _modelled_forces(friction, foot, floor)
    residuals = []
    for row, model in enumerate(modelled.tolist()):
        pressure, load = float(friction.pressure[row]), float(friction.load[row])
        shape = f'domes of {pressure:g} Pa' if pressure > 0.0 else 'flat'
        where = 'wet' if friction.wet[row] else 'dry'
        setting = f'{shape}, {where}, {load:g} N'
        measured = float(friction.tangential_force[row])
        residuals.append(Residual('tangential_force', setting, pressure, measured, model, True))
    return residuals

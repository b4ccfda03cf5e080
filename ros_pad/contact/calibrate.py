# SPDX-License-Identifier: Apache-2.0
"""Fit the constants of a foot to measurements: stiffness, force limit, friction, film.

Stiffness and the constants of friction are fitted by their logarithms and minimise relative
errors. A pad of a material has the factor on its stresses in place of the stiffness; free domes
give it by relative errors of pressure. The line of the force limit minimises absolute errors.
Confidence intervals are those of Student's t at 95 %, from the curvature of the sum of squares at
its minimum.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_pad.configuration import Setting, number, quantity
from ros_pad.contact.dome import BURST, inflate, press
from ros_pad.contact.film import WATER_VISCOSITY, Film
from ros_pad.contact.fits import Constant, Residual, fit_positive, line_through
from ros_pad.contact.foot_file import foot_text
from ros_pad.contact.hyperelastic import pressure_for_height
from ros_pad.contact.limits import DEFAULT_CRITERION, criteria, force_limit, largest_pressure
from ros_pad.contact.measurements import Friction, Measurements
from ros_pad.contact.pad import Array, MeasuredLimit, Pad, with_constant
from ros_pad.contact.resistance import FOOT_SETTINGS, LIMIT_SETTINGS, PAD_SETTINGS, Foot
from ros_pad.errors import InvalidInput

# Constants of friction in the order in which they are fitted: the start value for a foot in which
# one is 0, and the lowest value of a fit.
_FRICTION = {
    'friction': (0.3, 0.01),
    'shear_strength': (3e3, 1.0),
    'conforming_pressure': (1e4, 1.0),
    'boundary_friction': (0.1, 1e-4),
    'critical_film': (3e-7, 1e-9),
    'film_exponent': (2.0, 0.1),
}
_SETTINGS = {each.name: each for each in FOOT_SETTINGS}


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    Attributes
    ----------
    measurements : Measurements
        Input of the calibration.
    foot : Foot
        The start foot with the fitted constants.
    constants : tuple of Constant
        All constants, fitted or kept.
    residuals : tuple of Residual
        All measurements against the calibrated model.
    warnings : tuple of str
        Messages about results that the user should check.
    """

    measurements: Measurements
    foot: Foot
    constants: tuple[Constant, ...]
    residuals: tuple[Residual, ...]
    warnings: tuple[str, ...]


def calibrate(
    measurements: Measurements,
    foot: Foot,
    film_thickness: float = 3.0e-4,
    viscosity: float = WATER_VISCOSITY,
    *,
    rubber: Pad | None = None,
) -> Calibration:
    """Fit the constants of a foot to measurements.

    Parameters
    ----------
    measurements : Measurements
        Measured points. Free domes give ``stiffness`` (of a pad of a material, the factor on its
        stresses), force limits give the line of the criterion ``measured``, tangential forces give
        the constants of friction and film.
    foot : Foot
        Start of the fit. It gives the radius of the pads and every constant that is not fitted.
    film_thickness : float
        Thickness of the film on the wet floor before the foot touches down, m, above 0.
    viscosity : float
        Viscosity of that liquid, Pa s, above 0.
    rubber : Pad, optional
        A pad of a material in place of the foot's pad.

    Returns
    -------
    Calibration
        The calibrated foot, its constants and residuals.

    Raises
    ------
    InvalidInput
        When nothing can be fitted (the message lists the data that each fit needs), when a
        measurement contradicts the model or the foot, when a fitted constant is out of the range
        of a foot file, or when film thickness or viscosity is not finite or not above 0.
    """
    number('film_thickness', film_thickness, 'm', above=True)
    number('viscosity', viscosity, 'Pa s', above=True)
    start = foot.pad if rubber is None else rubber
    warnings: list[str] = []
    pad, shape = _shape(measurements, start, warnings)
    pad, line = _limit(measurements, pad, warnings)
    foot = _with_pad(foot, pad, warnings)
    foot, friction = _fit_friction(measurements, foot, (film_thickness, viscosity), warnings)
    constants = (shape, *line, *friction)
    if not any(constant.fitted for constant in constants):
        raise InvalidInput(
            f'{measurements.source}: nothing can be fitted: {shape.name} needs a free dome; the'
            ' line of the force limit needs force limits at two pressures; friction needs'
            ' tangential forces'
        )
    residuals = _residuals(measurements, foot, (film_thickness, viscosity))
    return Calibration(measurements, foot, constants, residuals, tuple(warnings))


def _check(source: str, constant: Constant, allowed: Setting) -> None:
    """Raise `InvalidInput` for a fitted constant that no foot file may have."""
    what = f'{source}: check the units of the measurements: {constant.name}'
    number(what, constant.value, constant.unit, allowed.low, allowed.high)


def foot_file(calibration: Calibration) -> str:
    """Return the YAML text of the calibrated foot, for :meth:`Foot.load` and every command.

    The comment behind each constant states whether it was fitted, with its 95 % interval.
    """
    foot = calibration.foot
    source = pathlib.PurePath(calibration.measurements.source).name
    head = [
        f'Calibrated by pad calibrate from {source}.',
        'Fitted constants have a 95 % interval; all others are those of the start foot.',
        *calibration.warnings,
    ]
    comments = {}
    for each in calibration.constants:
        between = 'too few for an interval'
        if not math.isnan(each.low):
            between = f'{each.low:.4g} to {each.high:.4g}, {each.points} points'
        comments[each.name] = f'fitted: {between}' if each.fitted else 'of the start foot'
    return foot_text(foot, f'{foot.source}, calibrated', head, comments)


def stiffness_of(pad: Pad, pressure: Array, height: Array) -> Array:
    """Return the stiffness, N/m, that gives each free dome its measured height.

    Thesis 3.60 with F = 0, solved for k: ``k = p r/(6 sin t - 2 sin 2t)``, ``tan t = height/r``.

    Parameters
    ----------
    pad : Pad
        Its radius is used.
    pressure, height : array
        Gauge pressure, Pa, and height, m, above 0, of each dome.
    """
    t = np.arctan(height / pad.radius)
    return pressure * pad.radius / (6.0 * np.sin(t) - 2.0 * np.sin(2.0 * t))


def from_pressures(name: str, unit: str, ratio: Array) -> Constant:
    """Fit a constant to free domes, by relative errors of pressure.

    Pressures and not heights, for near its largest pressure a dome of rubber has a height that
    small errors of pressure change without bound, and above it has none.

    Parameters
    ----------
    name, unit : str
        Name and unit of the constant, to which the pressure for a height is in proportion.
    ratio : array
        Pressure for the height of each dome if the constant is 1, over the measured pressure.
    """
    fit = line_through(ratio[:, None], np.ones_like(ratio))
    fit = replace(fit, half_widths=fit.half_widths / fit.values, logarithmic=True)
    return fit.constant(name, unit, 'free domes')


def _shape(measurements: Measurements, pad: Pad, warnings: list[str]) -> tuple[Pad, Constant]:
    """Return the pad with the stiffness or factor that its free domes give, and this constant."""
    source, free, material = measurements.source, measurements.free, pad.material
    quantity(f'{source}: height', free.height, 'm', above=True)
    quantity(f'{source}: pressure of a free dome', free.pressure, 'Pa', above=True)
    pressed = measurements.pressed
    for what, values, unit in (
        ('pressure of a pressed dome', pressed.pressure, 'Pa'),
        ('height of a pressed dome', pressed.height, 'm'),
        ('gap', pressed.gap, 'm'),
    ):
        quantity(f'{source}: {what}', values[~np.isnan(values)], unit, above=True)
    name, unit, value = 'stiffness', 'N/m', pad.stiffness
    if material is not None:
        name, unit, value = 'factor', '(factor)', material.factor
    if not len(free.pressure):
        return pad, Constant(name, unit, value, 'no free dome was measured')
    if material is None:

        def heights(k: Array) -> Array:
            return np.asarray(inflate(replace(pad, stiffness=float(k[0])), free.pressure).height)

        least = float(free.pressure.max()) * pad.radius / BURST
        fit = fit_positive(heights, free.height, [value], [least], [math.inf])
        found = fit.constant(name, unit, "of the thesis' law, free domes")
        each = stiffness_of(pad, *free)[np.argsort(free.pressure)]
        if len(each) > 2 and abs(each[-1] / each[0] - 1.0) > 0.1:
            warnings.append(
                f'one stiffness does not fit all points: single points give {each[0]:.3g} N/m at'
                f' {free.pressure.min():g} Pa and {each[-1]:.3g} N/m at {free.pressure.max():g} Pa'
            )
        _check(source, found, PAD_SETTINGS[1])
        return with_constant(pad, name, found.value), found
    made = material.name or str(material)
    try:
        ratio = pressure_for_height(pad, free.height) / material.factor / free.pressure
        found = from_pressures(name, unit, ratio)
        found = replace(found, note=f'on the stresses of {made}, {found.note}')
        pad = with_constant(pad, name, found.value)
    except InvalidInput as error:
        raise InvalidInput(f'{source}: {error}: check the units of the measurements') from error
    low, high = material.factor_range or (1.0, 1.0)
    if low <= found.value <= high:
        words = f'one that the doubts about {made} explain ({low:g} to {high:g})'
    else:
        words = (
            f'outside {low:g} to {high:g}, which the doubts about {made} explain: check the'
            f' material, the units, and the thickness of {pad.thickness:g} m'
        )
    warnings.append(f'the factor {found.value:.3g} is {words}')
    if not math.isnan(found.low):
        pad = replace(pad, material=material.times(found.value, (found.low, found.high)))
    return pad, found


def _limit(
    measurements: Measurements, pad: Pad, warnings: list[str]
) -> tuple[Pad, list[Constant]]:
    """Return the pad with the fitted line of its force limit, and the constants of this line."""
    pressure, limit = measurements.force_limits
    if len(np.unique(pressure)) < 2:
        if len(pressure):
            warnings.append(
                'the line of the force limit is not fitted: the measured force limits are all at'
                ' one pressure, and a line needs two'
            )
        line = pad.measured_limit
        if line is None:
            return pad, []
        at = f"the start foot's line, on one pad at {line.pressure:g} Pa"
        slope = Constant('force_limit_slope', 'N/Pa', line.slope, "the start foot's line")
        return pad, [Constant('force_limit', 'N', line.force, at), slope]
    middle = float(pressure.mean())
    fit = line_through(np.column_stack([np.ones_like(pressure), pressure - middle]), limit)
    at = f'line of the force limit of one pad, at {middle:g} Pa'
    force = fit.constant('force_limit', 'N', at, 0)
    slope = fit.constant('force_limit_slope', 'N/Pa', 'slope of this line', 1)
    _check(measurements.source, force, LIMIT_SETTINGS[0])
    _check(measurements.source, slope, LIMIT_SETTINGS[2])
    return replace(pad, measured_limit=MeasuredLimit(force.value, middle, slope.value)), [
        force,
        slope,
    ]


def _with_pad(foot: Foot, pad: Pad, warnings: list[str]) -> Foot:
    """Return the foot with a pad, a criterion of the force limit that this has, and its ceiling.

    The ceiling is lowered to whole kPa if the pad's model ends below.
    """
    limit, ceiling = foot.limit, foot.ceiling
    if pad.measured_limit not in (None, foot.pad.measured_limit):
        limit = 'measured'
    elif limit not in criteria(pad):
        limit = DEFAULT_CRITERION
        warnings.append(
            f'the criterion of the force limit becomes {limit}: none was measured on a pad of this'
            ' stiffness'
        )
    end = largest_pressure(pad)
    if ceiling > end:
        ceiling = 1e3 * math.floor(end / 1e3)
        warnings.append(
            f'the ceiling is lowered from {foot.ceiling:g} to {ceiling:g} Pa: the model of these'
            f' softer pads ends at {end:.6g} Pa'
        )
    return replace(foot, pad=pad, limit=limit, ceiling=ceiling)


def _modelled_forces(friction: Friction, foot: Foot, floor: tuple[float, float]) -> Array:
    """Return the model's largest tangential force for each row of measurements, N.

    ``floor`` has the thickness of the film before a foot lands, m, and its viscosity, Pa s.
    """
    forces = []
    for pressure, load, _, wet, stance_time in zip(
        *(column.tolist() for column in friction), strict=True
    ):
        film = Film(foot, floor[1])
        film.touch_down(floor[0])
        forces.append(foot.grip_after(load, pressure, film if wet else None, stance_time))
    return np.array(forces)


def _fit_friction(
    measurements: Measurements, foot: Foot, floor: tuple[float, float], warnings: list[str]
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
    for name in [*_FRICTION, *_FRICTION]:
        if name in fitted or len(fitted) == len(friction.load):
            continue
        trial = [*fitted, name]
        before: list[float] = [] if fit is None else fit.values.tolist()
        start = getattr(foot, name) or _FRICTION[name][0]
        least = [_FRICTION[each][1] for each in trial]
        most = [_SETTINGS[each].high for each in trial]

        def forces(values: Array, names: Sequence[str] = trial) -> Array:
            return _modelled_forces(friction, _changed(foot, names, values), floor)

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
    for name in _FRICTION:
        unit = _SETTINGS[name].unit
        if fit is not None and name in fitted:
            words = f'{len(friction.load)} forces'
            constants.append(fit.constant(name, unit, words, fitted.index(name)))
        else:
            constants.append(Constant(name, unit, getattr(foot, name), note))
    kept = [name for name in _FRICTION if name not in fitted]
    if kept and len(friction.load):
        warnings.append(
            f'{", ".join(kept)}: not identified by the tangential forces; the fitted constants of'
            f' friction are valid only if these values of {foot.source} are right'
        )
    return foot if fit is None else _changed(foot, fitted, fit.values), constants


def _changed(foot: Foot, names: Sequence[str], values: Array) -> Foot:
    changes: dict[str, Any] = dict(zip(names, values.tolist(), strict=True))
    return replace(foot, **changes)


def _residuals(
    measurements: Measurements, foot: Foot, floor: tuple[float, float]
) -> tuple[Residual, ...]:
    """Return all measured numbers beside those of the foot."""
    pad, free, pressed = foot.pad, measurements.free, measurements.pressed
    found: list[Residual] = []

    def add(
        name: str, settings: Sequence[str], p: Array, measured: Array, modelled: Array, used: bool
    ) -> None:
        for row in np.flatnonzero(~np.isnan(measured)).tolist():
            at, value, model = (float(each[row]) for each in (p, measured, modelled))
            found.append(Residual(name, settings[row], at, value, model, used))

    if len(free.pressure):
        words = [f'free, {p:g} Pa' for p in free.pressure]
        add('height', words, *free, np.asarray(inflate(pad, free.pressure).height), True)
    if len(pressed.pressure):
        dome = press(pad, pressed.pressure, pressed.force)
        words = [f'{p:g} Pa, {f:g} N' for p, f in zip(*pressed[:2], strict=True)]
        for name in ('height', 'depth', 'contact_radius', 'gap'):
            model = np.asarray(getattr(dome, name))
            add(name, words, pressed.pressure, getattr(pressed, name), model, False)
    pressure, limit = measurements.force_limits
    if len(pressure):
        used = pad.measured_limit is not None
        criterion = 'measured' if used else DEFAULT_CRITERION
        known = pressure <= largest_pressure(pad)
        model = np.asarray(force_limit(pad, np.where(known, pressure, 0.0), criterion))
        words = [f'{p:g} Pa' for p in pressure]
        add('force_limit', words, pressure, limit, np.where(known, model, np.nan), used)
    rows = measurements.friction
    words = [
        f'{f"domes of {p:g} Pa" if p > 0.0 else "flat"}, {"wet" if wet else "dry"}, {load:g} N'
        for p, load, wet in zip(rows.pressure, rows.load, rows.wet, strict=True)
    ]
    model = _modelled_forces(rows, foot, floor)
    add('tangential_force', words, rows.pressure, rows.tangential_force, model, True)
    return tuple(found)

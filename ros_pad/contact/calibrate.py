# SPDX-License-Identifier: Apache-2.0
"""Fit the constants of a foot to measurements: stiffness, force limit, friction, film.

Stiffness and the constants of friction are fitted by their logarithms and minimise relative
errors. A pad of a material has the factor on its stresses, or its thickness, in place of the
stiffness; free domes give it by relative errors of pressure. The line of the force limit minimises
absolute errors. Confidence intervals are those of Student's t at 95 %, from the curvature of the
sum of squares at its minimum.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.configuration import choice, number
from ros_pad.contact.dome import BURST, inflate, largest_tension, press
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.fits import (
    Constant,
    Fit,
    Residual,
    above_zero,
    fit_positive,
    kept_constant,
    line_through,
)
from ros_pad.contact.foot_file import foot_text
from ros_pad.contact.friction_fit import WetFloor, fit_friction, friction_residuals
from ros_pad.contact.hyperelastic import pressure_end, pressure_for_height
from ros_pad.contact.limits import DEFAULT_CRITERION, criteria, force_limit, largest_pressure
from ros_pad.contact.material import FACTORS, Material
from ros_pad.contact.measurements import FreeDomes, Measurements
from ros_pad.contact.pad import Array, MeasuredLimit, Pad, with_constant
from ros_pad.contact.resistance import LIMIT_SETTINGS, PAD_SETTINGS, Foot
from ros_pad.errors import InvalidInput

FITS = ('factor', 'thickness')
"""What the shapes of domes of a material can be fitted by."""
# Share by which single points may differ in stiffness before a warning says so.
_TREND = 0.1

# Settings of a foot file for the constants that are checked only after the fit.
_IN_FOOT = {
    'stiffness': PAD_SETTINGS[1],
    'force_limit': LIMIT_SETTINGS[0],
    'force_limit_slope': LIMIT_SETTINGS[2],
}


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
    fit: str | None = None,
    rubber: Pad | None = None,
) -> Calibration:
    """Fit the constants of a foot to measurements.

    Parameters
    ----------
    measurements : Measurements
        Measured points. Free domes give ``stiffness`` (pressed domes, if there are no free ones),
        force limits give the line of the criterion ``measured``, tangential forces give the
        constants of friction and film.
    foot : Foot
        Start of the fit. It gives the radius of the pads and every constant that is not fitted.
    film_thickness : float
        Thickness of the film on the wet floor before the foot touches down, m, above 0.
    viscosity : float
        Viscosity of that liquid, Pa s, above 0.
    fit : {'factor', 'thickness'}, optional
        What the shapes of domes give for a pad of a material, by default the factor. Other pads
        have the stiffness of the thesis' law fitted.
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
        of a foot file, when ``fit`` needs a material and there is none, or when film thickness or
        viscosity is not finite or not above 0.
    """
    number('film_thickness', film_thickness, 'm', above=True)
    number('viscosity', viscosity, 'Pa s', above=True)
    start, fit = _start(foot, fit, rubber)
    constants: list[Constant] = []
    warnings: list[str] = []
    _check_shapes(measurements)
    if fit == 'stiffness':
        pad = _stiffness(measurements, start, constants, warnings)
    else:
        pad = _of_rubber(measurements, start, fit, constants, warnings)
    for constant in constants:
        _fits_a_foot(measurements.source, constant)
    pad = _limit(measurements, pad, constants, warnings)
    limit = _criterion(foot, pad, warnings)
    ceiling = _ceiling(foot.ceiling, pad, limit, warnings)
    foot = dataclasses.replace(foot, pad=pad, limit=limit, ceiling=ceiling)
    wet_floor = WetFloor(film_thickness, viscosity)
    foot = fit_friction(measurements, foot, wet_floor, constants, warnings)
    _check_constants(measurements.source, fit, constants)
    residuals = (
        *_shape_residuals(measurements, pad, len(measurements.free.pressure) >= 1),
        *_limit_residuals(measurements, pad),
        *friction_residuals(measurements.friction, foot, wet_floor),
    )
    return Calibration(measurements, foot, tuple(constants), residuals, tuple(warnings))


def _check_constants(source: str, fit: str, constants: Sequence[Constant]) -> None:
    """Raise `InvalidInput` if nothing was fitted, or a constant that no foot file may have."""
    if not any(constant.fitted for constant in constants):
        raise InvalidInput(
            f'{source}: nothing can be fitted: {fit} needs a free dome, or a'
            ' pressed dome with height or gap; the line of the force limit needs force limits at'
            ' two pressures; friction needs tangential forces'
        )
    for constant in constants:
        _fits_a_foot(source, constant)


def _start(foot: Foot, fit: str | None, rubber: Pad | None) -> tuple[Pad, str]:
    """Return the pad from which the fit starts, and what is fitted."""
    start = foot.pad if rubber is None else rubber
    if fit is not None:
        choice('fit', fit, FITS)
    if start.material is not None:
        return start, fit or 'factor'
    if fit is not None:
        raise InvalidInput(
            f'fit = {fit!r} is not allowed without a material: a foot whose pad names a material'
            ' is needed, or material and thickness beside the foot'
        )
    return start, 'stiffness'


def _criterion(foot: Foot, pad: Pad, warnings: list[str]) -> str:
    """Return the criterion of the force limit: that of the start foot, or the pad's own line."""
    if pad.measured_limit not in (None, foot.pad.measured_limit):
        return 'measured'
    if foot.limit in criteria(pad):
        return foot.limit
    warnings.append(
        f'the criterion of the force limit becomes {DEFAULT_CRITERION}: none was measured on a pad'
        ' of this stiffness'
    )
    return DEFAULT_CRITERION


def _ceiling(ceiling: float, pad: Pad, limit: str, warnings: list[str]) -> float:
    """Return the foot's ceiling, Pa; lower it to whole kPa if the pad's model ends below."""
    end = largest_pressure(pad, limit)
    if ceiling <= end:
        return ceiling
    lowered = 1e3 * math.floor(end / 1e3)
    warnings.append(
        f'the ceiling is lowered from {ceiling:g} to {lowered:g} Pa: the model of these'
        f' softer pads ends at {end:.6g} Pa'
    )
    return lowered


def _fits_a_foot(source: str, constant: Constant) -> None:
    allowed = _IN_FOOT.get(constant.name)
    if constant.fitted and allowed and not allowed.low <= constant.value <= allowed.high:
        raise InvalidInput(
            f'{source}: the fit gives {constant.name} = {constant.value:.4g} {constant.unit}, but'
            f' {allowed.allowed} is needed: check the units of the measurements'
        )


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
    comments = {constant.name: _comment(constant) for constant in calibration.constants}
    return foot_text(foot, f'{foot.source}, calibrated', head, comments)


def _comment(constant: Constant) -> str:
    if not constant.fitted:
        return 'kept'
    if math.isnan(constant.low):
        return f'fitted to {constant.points} points, too few for an interval'
    return f'fitted: {constant.low:.4g} to {constant.high:.4g} ({constant.points} points)'


# --- stiffness -----------------------------------------------------------------------------------


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


def from_pressures(pad: Pad, name: str, pressure: Array, height: Array) -> Constant:
    """Fit a constant of a pad to free domes, by relative errors of pressure.

    Pressures and not heights, for near its largest pressure a dome of rubber has a height that
    small errors of pressure change without bound, and above it has none. The pressure for a
    height is in proportion to each of these constants.

    Parameters
    ----------
    pad : Pad
        The pad; ``factor`` and ``thickness`` are those of its material.
    name : {'stiffness', 'factor', 'thickness'}
        The constant.
    pressure, height : array
        Gauge pressure, Pa, and height, m, above 0, of each dome.

    Raises
    ------
    InvalidInput
        When no dome of the material has such a height.
    """
    if name == 'stiffness':
        each = pressure / stiffness_of(pad, pressure, height)
    else:
        each = pressure_for_height(pad, height) / _value(pad, name)
    fit = line_through((each / pressure)[:, None], np.ones_like(pressure))
    fit = dataclasses.replace(fit, half_widths=fit.half_widths / fit.values, logarithmic=True)
    unit = {'stiffness': 'N/m', 'factor': '(factor)', 'thickness': 'm'}[name]
    return fit.constant(name, unit, 'free domes')


def _check_shapes(measurements: Measurements) -> None:
    """Raise `InvalidInput` for pressures and lengths of domes that are not above 0."""
    free, pressed = measurements.free, measurements.pressed
    for name, values in (
        ('height', free.height),
        ('pressure of a free dome', free.pressure),
        ('pressure of a pressed dome', pressed.pressure),
        ('height of a pressed dome', pressed.height),
        ('gap', pressed.gap),
    ):
        above_zero(measurements.source, name, values)


def _stiffness(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> Pad:
    """Return the pad with its fitted stiffness; add constants and warnings."""
    free = measurements.free
    if len(free.pressure):
        least = float(free.pressure.max()) * pad.radius / BURST

        def heights(k: Array) -> Array:
            return np.asarray(
                inflate(with_constant(pad, 'stiffness', float(k[0])), free.pressure).height
            )

        fit = fit_positive(heights, free.height, [pad.stiffness], [least])
        constants.append(fit.constant('stiffness', 'N/m', "of the thesis' law, free domes"))
        _warn_of_trend(pad, free, warnings)
        return with_constant(pad, 'stiffness', float(fit.values[0]))
    fit_pressed = _from_pressed(measurements, pad, 'stiffness')
    if fit_pressed is None:
        constants.append(kept_constant('stiffness', 'N/m', pad.stiffness, 'no dome was measured'))
        return pad
    note = "of the thesis' law, pressed domes"
    constants.append(fit_pressed.constant('stiffness', 'N/m', note))
    return with_constant(pad, 'stiffness', float(fit_pressed.values[0]))


def _warn_of_trend(pad: Pad, free: FreeDomes, warnings: list[str]) -> None:
    """Warn where the lowest and the highest pressure ask for another stiffness."""
    each = stiffness_of(pad, *free)[np.argsort(free.pressure)]
    if len(each) > 2 and abs(each[-1] / each[0] - 1.0) > _TREND:
        warnings.append(
            f'one stiffness does not fit all points: single points give {each[0]:.3g} N/m at'
            f' {free.pressure.min():g} Pa and {each[-1]:.3g} N/m at {free.pressure.max():g} Pa'
        )


def _from_pressed(measurements: Measurements, pad: Pad, name: str) -> Fit | None:
    """Fit a constant of the pad to height or gap of pressed domes; None if neither is measured."""
    pressed = measurements.pressed
    wall = np.where(np.isnan(pressed.height), pressed.gap, pressed.height)
    known = ~np.isnan(wall)
    if not known.any():
        return None
    start = _value(pad, name)
    if name == 'stiffness':
        end = largest_tension(0.01) * start / pad.radius
    else:
        end = pressure_end(pad)[0]
    least = start * float(pressed.pressure[known].max()) / end
    if name == 'factor':
        least = max(least, FACTORS[0])

    def walls(value: Array) -> Array:
        changed = with_constant(pad, name, float(value[0]))
        dome = press(changed, pressed.pressure[known], pressed.force[known])
        by_gap = np.isnan(pressed.height[known])
        return np.asarray(np.where(by_gap, dome.gap, dome.height))

    most = {'factor': FACTORS[1], 'thickness': pad.radius}.get(name, math.inf)
    fit = None if least >= most else fit_positive(walls, wall[known], [start], [least], [most])
    if fit is None or np.isnan(fit.values).any():
        raise InvalidInput(
            f'{measurements.source}: the pressed domes carry more than the model of a pad of '
            f'radius = {pad.radius:g} m allows at their pressure: check the radius in the foot'
            ' file'
        )
    return fit


def _value(pad: Pad, name: str) -> float:
    if name == 'factor':
        return pad.material.factor  # type: ignore[union-attr]
    return float(getattr(pad, name))


def _of_rubber(
    measurements: Measurements,
    pad: Pad,
    name: str,
    constants: list[Constant],
    warnings: list[str],
) -> Pad:
    """Return the pad with its fitted factor or thickness; add constants and warnings."""
    material, free = pad.material, measurements.free
    assert material is not None
    made = material.name or str(material)
    what = {'factor': f'on the stresses of {made}', 'thickness': f'of the sheet of {made}'}[name]
    if len(free.pressure):
        try:
            found = from_pressures(pad, name, *free)
        except InvalidInput as error:
            raise InvalidInput(f'{measurements.source}: {error}') from error
    else:
        unit = {'factor': '(factor)', 'thickness': 'm'}[name]
        by_pressed = _from_pressed(measurements, pad, name)
        if by_pressed is None:
            constants.append(kept_constant(name, unit, _value(pad, name), 'no dome was measured'))
            return pad
        found = by_pressed.constant(name, unit, 'pressed domes')
    constants.append(dataclasses.replace(found, note=f'{what}, {found.note}'))
    try:
        pad = with_constant(pad, name, found.value)
        if name == 'factor':
            pad = _with_range(pad, material, found, warnings)
    except InvalidInput as error:
        raise InvalidInput(
            f'{measurements.source}: the fit gives no pad: {error}: check the units of the'
            ' measurements'
        ) from error
    return pad


def _with_range(pad: Pad, material: Material, factor: Constant, warnings: list[str]) -> Pad:
    """Return the pad with the interval of its factor; warn whether the doubts explain it."""
    low, high = material.factor_range or (1.0, 1.0)
    name = material.name or str(material)
    if low <= factor.value <= high:
        warnings.append(
            f'the factor {factor.value:.3g} is one that the doubts about {name} explain'
            f' ({low:g} to {high:g}): {material.doubts or "they are not stated"}'
        )
    else:
        warnings.append(
            f'the factor {factor.value:.3g} is outside {low:g} to {high:g}, which the doubts about'
            f' {name} explain: check the material, the units, and the thickness of'
            f' {pad.thickness:g} m, to which pressures are in proportion'
        )
    if math.isnan(factor.low):
        return pad
    measured = material.times(factor.value, (factor.low, factor.high))
    return dataclasses.replace(pad, material=measured)


def _shape_residuals(measurements: Measurements, pad: Pad, used_free: bool) -> list[Residual]:
    free, pressed = measurements.free, measurements.pressed
    residuals = []
    modelled = inflate(pad, free.pressure).height if len(free.pressure) else []
    for p, height, model in zip(*free, modelled, strict=True):
        residuals.append(Residual('height', f'free, {p:g} Pa', p, height, float(model), True))
    if not len(pressed.pressure):
        return residuals
    dome = press(pad, pressed.pressure, pressed.force)
    for name in ('height', 'depth', 'contact_radius', 'gap'):
        for p, force, value, model in zip(
            pressed.pressure,
            pressed.force,
            getattr(pressed, name),
            getattr(dome, name),
            strict=True,
        ):
            if not math.isnan(value):
                used = not used_free and name in ('height', 'gap')
                setting = f'{p:g} Pa, {force:g} N'
                residuals.append(Residual(name, setting, p, value, float(model), used))
    return residuals


# --- force limit ---------------------------------------------------------------------------------


def _limit(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> Pad:
    """Return the pad with the fitted line of its force limit; add constants and warnings."""
    pressure, limit = measurements.force_limits
    if len(np.unique(pressure)) < 2:
        if len(pressure):
            warnings.append(
                'the line of the force limit is not fitted: the measured force limits are all at'
                ' one pressure, and a line needs two'
            )
        line = pad.measured_limit
        if line is not None:
            note = "the start foot's line"
            at = f'{note}, on one pad at {line.pressure:g} Pa'
            constants.append(kept_constant('force_limit', 'N', line.force, at))
            constants.append(kept_constant('force_limit_slope', 'N/Pa', line.slope, note))
        return pad
    middle = float(pressure.mean())
    fit = line_through(np.column_stack([np.ones_like(pressure), pressure - middle]), limit)
    force, slope = fit.values
    if slope <= 0.0 or force < 0.0:
        raise InvalidInput(
            f'{measurements.source}: the line through the measured force limits has slope ='
            f' {slope:.3g} N/Pa and a force of {force:.3g} N at {middle:g} Pa: a slope above 0 and'
            ' a force of at least 0 N are needed'
        )
    at = f'line of the force limit of one pad, at {middle:g} Pa'
    constants.append(fit.constant('force_limit', 'N', at, 0))
    constants.append(fit.constant('force_limit_slope', 'N/Pa', 'slope of this line', 1))
    return dataclasses.replace(
        pad, measured_limit=MeasuredLimit(float(force), middle, float(slope))
    )


def _limit_residuals(measurements: Measurements, pad: Pad) -> list[Residual]:
    pressure, limit = measurements.force_limits
    if not len(pressure):
        return []
    used = pad.measured_limit is not None
    criterion = 'measured' if used else DEFAULT_CRITERION
    known = pressure <= largest_pressure(pad, criterion)
    modelled = force_limit(pad, np.where(known, pressure, 0.0), criterion)
    modelled = np.where(known, modelled, np.nan)
    return [
        Residual('force_limit', f'{p:g} Pa', p, value, float(model), used)
        for p, value, model in zip(pressure, limit, modelled, strict=True)
    ]

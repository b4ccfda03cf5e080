# SPDX-License-Identifier: Apache-2.0
"""Fit the constants of a foot to measurements: stiffness, force limit, friction, film.

Stiffness and the constants of friction are fitted by their logarithms and minimise relative
errors. A pad of a material has the factor on its stresses, or its thickness, in place of the
stiffness; free domes give it by relative errors of pressure (:mod:`ros_pad.contact.laws`). The
line of the force limit minimises absolute errors. Confidence intervals are those of Student's t at
95 %, from the curvature of the sum of squares at its minimum.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import pathlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.configuration import choice, number
from ros_pad.contact.dome import BURST, inflate, largest_tension, press
from ros_pad.contact.film import WATER_VISCOSITY, Film
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.laws import (
    Comparison,
    Law,
    compare,
    rubber_laws,
    stiffness_law,
    two_constants_law,
    with_constant,
)
from ros_pad.contact.limits import DEFAULT_CRITERION, criteria, force_limit, largest_pressure
from ros_pad.contact.material import FACTORS, Material
from ros_pad.contact.measurements import Friction, Measurements
from ros_pad.contact.pad import LARGE_PAD, Array, MeasuredLimit, Pad
from ros_pad.contact.resistance import FOOT_SETTINGS, LIMIT_SETTINGS, PAD_SETTINGS, Foot
from ros_pad.errors import InvalidInput

CONFIDENCE = 0.95
FITS = ('factor', 'thickness', 'constants')
"""What shapes of domes can be fitted by; the last is the stiffness, with the two constants."""
# A constant is identified if its interval is within this factor of its value, and if every change
# of the constants by 1 % changes the modelled data by more than one part in 10^5.
_WIDEST = 10.0
_LEAST_EFFECT = 1e-3

# Constants of friction in the order in which they are fitted: start value for a foot in which the
# constant is 0, and lower bound where a foot file allows 0.
_STARTS = {
    'friction': (0.3, 0.0),
    'shear_strength': (3e3, 1.0),
    'conforming_pressure': (1e4, 0.0),
    'boundary_friction': (0.1, 1e-4),
    'critical_film': (3e-7, 0.0),
    'film_exponent': (2.0, 0.0),
}
_SETTINGS = {each.name: each for each in FOOT_SETTINGS}
# The same constants with unit, start value, and lower and upper bound.
_FRICTION = {
    name: (_SETTINGS[name].unit, start, max(low, _SETTINGS[name].low), _SETTINGS[name].high)
    for name, (start, low) in _STARTS.items()
}
# Constant that the shapes of domes give, by what is fitted.
_SHAPES = {'factor': 'factor', 'thickness': 'thickness', 'constants': 'stiffness'}
# Settings of a foot file for the constants that are checked only after the fit.
_IN_FOOT = {
    'stiffness': PAD_SETTINGS[1],
    'force_limit': LIMIT_SETTINGS[0],
    'force_limit_slope': LIMIT_SETTINGS[2],
}


@dataclass(frozen=True)
class Constant:
    """One constant after a calibration.

    Attributes
    ----------
    name, unit : str
        Name and unit of the constant.
    value : float
        Value in this unit.
    low, high : float
        95 % interval; NaN where there are no more points than constants, or nothing was fitted.
    points : int
        Number of measurements used for the fit.
    fitted : bool
        True if fitted, False if kept from the start foot.
    note : str
        Purpose of the constant, or the reason why it was kept.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    points: int
    fitted: bool
    note: str


@dataclass(frozen=True)
class Residual:
    """One measured number and the value of the calibrated model.

    Attributes
    ----------
    quantity : str
        ``height``, ``depth``, ``contact_radius``, ``gap``, ``force_limit``, ``tangential_force``.
    setting : str
        Pressure, force and so on of the measurement, in words.
    pressure : float
        Gauge pressure, Pa.
    measured, modelled : float
        Values in SI units; ``modelled`` is NaN where the model has no equilibrium or no force
        limit.
    used : bool
        Whether the measurement was used in a fit, and not only compared with the model.
    """

    quantity: str
    setting: str
    pressure: float
    measured: float
    modelled: float
    used: bool

    @property
    def error(self) -> float:
        """Relative error of the model: modelled / measured - 1."""
        return self.modelled / self.measured - 1.0 if self.measured else math.nan


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
    laws : tuple of Law
        If a material was given: laws of the free dome, fitted to the free domes.
    comparisons : tuple of Comparison
        Which of these laws the free domes distinguish.
    """

    measurements: Measurements
    foot: Foot
    constants: tuple[Constant, ...]
    residuals: tuple[Residual, ...]
    warnings: tuple[str, ...]
    laws: tuple[Law, ...] = ()
    comparisons: tuple[Comparison, ...] = ()


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
    fit : {'factor', 'thickness', 'constants'}, optional
        What the shapes of domes give: factor or thickness of the material, or the stiffness of
        the thesis' law. By default the factor for a pad of a material, else the stiffness.
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
    laws = _laws(measurements, start, fit, warnings)
    if fit == 'constants':
        pad = _stiffness(measurements, _capped(measurements, start), constants, warnings)
    else:
        pad = _of_rubber(measurements, start, fit, laws, constants, warnings)
    for constant in constants:
        _fits_a_foot(measurements.source, constant)
    pad = _limit(measurements, pad, constants, warnings)
    limit = _criterion(foot, pad, warnings)
    ceiling = _ceiling(foot.ceiling, pad, limit, warnings)
    foot = _with(foot, pad=pad, limit=limit, ceiling=ceiling)
    wet_floor = _WetFloor(film_thickness, viscosity)
    foot = _friction(measurements, foot, wet_floor, constants, warnings)
    _check_constants(measurements.source, fit, constants)
    residuals = (
        *_shape_residuals(measurements, pad, len(measurements.free.pressure) >= 1),
        *_limit_residuals(measurements, pad),
        *_friction_residuals(measurements.friction, foot, wet_floor),
    )
    compared = compare(laws, measurements.free.pressure)
    return Calibration(
        measurements, foot, tuple(constants), residuals, tuple(warnings), laws, compared
    )


def _check_constants(source: str, fit: str, constants: Sequence[Constant]) -> None:
    """Raise `InvalidInput` if nothing was fitted, or a constant that no foot file may have."""
    if not any(constant.fitted for constant in constants):
        raise InvalidInput(
            f'{source}: nothing can be fitted: {_SHAPES[fit]} needs a free dome, or a'
            ' pressed dome with height or gap; the line of the force limit needs force limits at'
            ' two pressures; friction needs tangential forces'
        )
    for constant in constants:
        _fits_a_foot(source, constant)


def _start(foot: Foot, fit: str | None, rubber: Pad | None) -> tuple[Pad, str]:
    """Return the pad from which the fit starts, and what is fitted."""
    start = foot.pad if rubber is None else rubber
    if start.edge is not None:
        raise InvalidInput(
            f'edge = {start.edge} is not allowed in a calibration: feet are pressed, and shapes'
            ' under load are not known with an edge; a pad without edge is needed'
        )
    if fit is None:
        fit = 'constants' if start.material is None else 'factor'
    choice('fit', fit, FITS)
    if fit != 'constants' and start.material is None:
        raise InvalidInput(
            f'fit = {fit!r} is not allowed without a material: a foot whose pad names a material'
            ' is needed, or material and thickness beside the foot'
        )
    return start, fit


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


def _with(foot: Foot, **changes: float | str | Pad) -> Foot:
    return dataclasses.replace(foot, **changes)  # type: ignore[arg-type]


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


def foot_text(
    foot: Foot, description: str, head: Iterable[str], comments: Mapping[str, str]
) -> str:
    """Return the YAML text of a foot, for :meth:`Foot.load`.

    Parameters
    ----------
    foot : Foot
        The foot.
    description : str
        What the file states under this key.
    head : iterable of str
        Lines of the comment at the top.
    comments : mapping of str to str
        What the comment behind a constant has after its unit, by name of the constant.
    """
    pad, limit = foot.pad, foot.pad.measured_limit

    def entry(name: str, value: float, unit: str, indent: str = '') -> str:
        # PyYAML reads 1e-05 as text: a number needs a decimal point.
        text = f'{value:.9g}'
        text = text if '.' in text else text.replace('e', '.0e') if 'e' in text else f'{text}.0'
        return f'{f"{indent}{name}: {text}":35} # {unit}'

    def known(name: str, unit: str, value: float, indent: str = '', other: str = '') -> str:
        comment = comments.get(other or name, 'of the start foot')
        return entry(name, value, f'{unit}, {comment}', indent)

    lines = [
        *(f'# {line}' for line in head),
        # In quotes: a path may contain characters with a meaning in YAML.
        f'description: {json.dumps(description, ensure_ascii=False)}',
        '',
        'pad:',
        entry('radius', pad.radius, 'm', '  '),
    ]
    if pad.material is None:
        if pad.thickness is not None:
            lines.append(entry('thickness', pad.thickness, 'm', '  '))
        lines += [
            known('stiffness', 'N/m', pad.stiffness, '  '),
            entry('adhesion_energy', pad.adhesion_energy, 'J/m2', '  '),
        ]
    else:
        lines += _material_lines(pad, comments, entry)
    if limit is not None:
        lines += [
            '  measured_limit: # of one pad',
            known('force', 'N', limit.force, '    ', 'force_limit'),
            entry('pressure', limit.pressure, 'Pa gauge', '    '),
            known('slope', 'N/Pa', limit.slope, '    ', 'force_limit_slope'),
        ]
    lines += ['', f'pads: {foot.pads}', entry('sole_radius', foot.sole_radius, 'm')]
    lines += [known(name, unit, getattr(foot, name)) for name, (unit, *_) in _FRICTION.items()]
    lines += [
        entry('shear_stiffness', foot.shear_stiffness, 'N/m of the whole foot'),
        entry('chamber_volume', foot.chamber_volume, 'm3 of air without the domes'),
        entry('ceiling', foot.ceiling, 'Pa gauge'),
        entry('capillary_force', foot.capillary_force, 'N a dome, of the start foot'),
        f'force_limit: {foot.limit}',
    ]
    return '\n'.join(lines) + '\n'


def _material_lines(
    pad: Pad, comments: Mapping[str, str], entry: Callable[..., str]
) -> Iterator[str]:
    """Yield the lines of a foot file for material, thickness and factor of a pad."""
    material = pad.material
    assert material is not None and material.factor_range is not None
    if not material.name:
        raise InvalidInput(
            f'the material {material} has no name: a foot file needs one that was loaded from a'
            ' file (Material.load)'
        )
    yield f'  material: {json.dumps(material.name, ensure_ascii=False)}'
    yield entry('thickness', pad.thickness, f'm, {comments.get("thickness", "as given")}', '  ')
    yield f'  factor: # on the stresses of the material, {comments.get("factor", "as given")}'
    for name, value in zip(
        ('value', 'low', 'high'), (material.factor, *material.factor_range), strict=True
    ):
        yield entry(name, value, '(factor)', '    ')


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


def _tension_and_stretch(pad: Pad, pressure: Array, height: Array) -> tuple[Array, Array]:
    """Return tension, N/m, and stretch of the membrane of free domes.

    Laplace: ``2 T = p R`` with ``R = (r² + height²)/(2 height)``; ``sigma² = 1 + (height/r)²``.
    """
    relative = height / pad.radius
    tension = 0.25 * pressure * pad.radius * (1.0 + relative**2) / relative
    return tension, np.sqrt(1.0 + relative**2)


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
        _above_zero(measurements.source, name, values)


def _stiffness(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> Pad:
    """Return the pad with its fitted stiffness; add constants and warnings."""
    free = measurements.free
    if len(free.pressure):
        least = float(free.pressure.max()) * pad.radius / BURST

        def heights(k: Array) -> Array:
            return np.asarray(inflate(_stiff(pad, k[0]), free.pressure).height)

        fit = _fit(heights, free.height, [pad.stiffness], [least])
        constants.append(fit.constant('stiffness', 'N/m', "of the thesis' law, free domes"))
        pad = _stiff(pad, fit.values[0])
        _two_parameters(measurements, pad, constants, warnings)
    by_pressed = _from_pressed(measurements, pad, 'stiffness')
    if by_pressed is None:
        if not len(free.pressure):
            constants.append(_kept('stiffness', 'N/m', pad.stiffness, 'no dome was measured'))
        return pad
    if len(free.pressure):
        note = 'stiffness from pressed domes: not used'
        constants.append(by_pressed.constant('stiffness_pressed', 'N/m', note))
        return pad
    constants.append(by_pressed.constant('stiffness', 'N/m', "of the thesis' law, pressed domes"))
    return _stiff(pad, by_pressed.values[0])


def _from_pressed(measurements: Measurements, pad: Pad, name: str) -> _Fit | None:
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
    fit = None if least >= most else _fit(walls, wall[known], [start], [least], [most])
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


def _two_parameters(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> None:
    """Fit the law ``T = T0 + k (sigma - 1)`` to the pressures of free domes.

    Warns if this law fits much better than one stiffness.
    """
    free = measurements.free
    if len(np.unique(free.pressure)) < 2:
        return
    tension, stretch = _tension_and_stretch(pad, free.pressure, free.height)
    # p = 2 T/R is linear in both constants: linear least squares of the pressure.
    curvature = free.pressure / tension
    design = np.column_stack([curvature, curvature * (stretch - 1.0)])
    fit = _line(design, free.pressure)
    note = 'two-parameter law T = T0 + k (stretch - 1): not used by the model'
    constants.append(fit.constant('tension_at_rest', 'N/m', note, 0))
    constants.append(fit.constant('tension_stiffness', 'N/m', note, 1))
    one = _rms(curvature * pad.stiffness * (1.5 * stretch - 1.0) - free.pressure)
    two = _rms(design @ fit.values - free.pressure)
    if len(free.pressure) > 2 and two < 0.5 * one:
        each = stiffness_of(pad, free.pressure, free.height)
        order = np.argsort(free.pressure)
        first, last = each[order[0]], each[order[-1]]
        warnings.append(
            f'one stiffness does not fit all points: single points give {first:.3g} N/m at'
            f' {free.pressure.min():g} Pa and {last:.3g} N/m at {free.pressure.max():g} Pa; with'
            f' the law of two constants the pressure error is {two:.3g} Pa instead of {one:.3g} Pa'
            ' (rms)'
        )


def _laws(measurements: Measurements, pad: Pad, fit: str, warnings: list[str]) -> tuple[Law, ...]:
    """Return the laws of free domes, fitted; none without a material or without free domes."""
    free = measurements.free
    if pad.material is None or not len(free.pressure):
        return ()
    laws = [stiffness_law(pad.radius, *free)]
    if len(np.unique(free.pressure)) > 1:
        laws.append(two_constants_law(pad.radius, *free))
    try:
        return (*laws, *rubber_laws(pad, *free))
    except InvalidInput as error:
        if fit != 'constants':
            raise InvalidInput(f'{measurements.source}: {error}') from error
        warnings.append(f'the material is not compared: {error}')
        return tuple(laws)


def _capped(measurements: Measurements, pad: Pad) -> Pad:
    """Return a pad of the law of the thesis, with a first stiffness, for a pad of a material."""
    if pad.material is None:
        return pad
    free = measurements.free
    known = stiffness_of(pad, *free) if len(free.pressure) else [LARGE_PAD.stiffness]
    return Pad(pad.radius, float(np.mean(known)), measured_limit=pad.measured_limit)


def _of_rubber(
    measurements: Measurements,
    pad: Pad,
    name: str,
    laws: Sequence[Law],
    constants: list[Constant],
    warnings: list[str],
) -> Pad:
    """Return the pad with its fitted factor or thickness; add constants and warnings."""
    material = pad.material
    assert material is not None
    unit = {'factor': '(factor)', 'thickness': 'm'}[name]
    made = material.name or str(material)
    what = {'factor': f'on the stresses of {made}', 'thickness': f'of the sheet of {made}'}[name]
    found: list[Constant] = []
    for law in laws:
        if law.name == name:
            value, low, high = (float(each[0]) for each in (law.values, law.low, law.high))
            points = len(measurements.free.pressure)
            note = f'{what}, free domes'
            found.append(Constant(name, unit, value, low, high, points, True, note))
    by_pressed = _from_pressed(measurements, pad, name)
    if by_pressed is not None:
        if found:
            note = f'{name} from pressed domes: not used'
            found.append(by_pressed.constant(f'{name}_pressed', unit, note))
        else:
            found.append(by_pressed.constant(name, unit, f'{what}, pressed domes'))
    if not found:
        constants.append(_kept(name, unit, _value(pad, name), 'no dome was measured'))
        return pad
    constants.extend(found)
    try:
        pad = with_constant(pad, name, found[0].value)
        if name == 'factor':
            pad = _with_range(pad, material, found[0], warnings)
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


def _stiff(pad: Pad, stiffness: float) -> Pad:
    return dataclasses.replace(pad, stiffness=float(stiffness))


def _above_zero(source: str, name: str, values: Array) -> None:
    if (values <= 0.0).any():
        raise InvalidInput(
            f'{source}: {name} = {values[values <= 0.0][0]:g} is not allowed: a fit needs values'
            ' above 0'
        )


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
            constants.append(_kept('force_limit', 'N', line.force, at))
            constants.append(_kept('force_limit_slope', 'N/Pa', line.slope, note))
        return pad
    middle = float(pressure.mean())
    fit = _line(np.column_stack([np.ones_like(pressure), pressure - middle]), limit)
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


# --- friction and film ---------------------------------------------------------------------------


@dataclass(frozen=True)
class _WetFloor:
    film_thickness: float  # m
    viscosity: float  # Pa s


def _modelled_forces(friction: Friction, foot: Foot, floor: _WetFloor) -> Array:
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


def _friction(
    measurements: Measurements,
    foot: Foot,
    floor: _WetFloor,
    constants: list[Constant],
    warnings: list[str],
) -> Foot:
    """Return the foot with the fitted constants of friction; add constants and warnings."""
    friction = measurements.friction
    if not len(friction.load):
        for name, (unit, *_) in _FRICTION.items():
            constants.append(_kept(name, unit, getattr(foot, name), 'no friction was measured'))
        return foot
    _check_friction(measurements, foot)
    fitted, fit = _identified_friction(friction, foot, floor)
    for name, (unit, *_) in _FRICTION.items():
        if fit is not None and name in fitted:
            constants.append(
                fit.constant(name, unit, f'{len(friction.load)} forces', fitted.index(name))
            )
        else:
            note = 'not identified by these forces: kept'
            constants.append(_kept(name, unit, getattr(foot, name), note))
    if fit is None:
        warnings.append(
            'all constants of friction are kept: the tangential forces identify none of them'
        )
        return foot
    kept = [name for name in _FRICTION if name not in fitted]
    if kept:
        warnings.append(
            f'{", ".join(kept)}: not identified by the tangential forces; the fitted constants of'
            f' friction are valid only if these values of {foot.source} are right'
        )
    return _with(foot, **dict(zip(fitted, fit.values.tolist(), strict=True)))


def _check_friction(measurements: Measurements, foot: Foot) -> None:
    """Raise `InvalidInput` where friction measurements cannot be fitted."""
    friction = measurements.friction
    for name in ('load', 'tangential_force'):
        _above_zero(measurements.source, name, getattr(friction, name))
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
    friction: Friction, foot: Foot, floor: _WetFloor
) -> tuple[list[str], _Fit | None]:
    """Fit as many constants of friction as the forces identify; return their names and the fit."""

    def forces(names: Sequence[str], values: Array) -> Array:
        changed = _with(foot, **dict(zip(names, values.tolist(), strict=True)))
        return _modelled_forces(friction, changed, floor)

    fitted: list[str] = []
    fit = None
    # A constant is added if the data identify it together with the earlier ones. The second round
    # is for constants that are identified only after a later one has been added.
    for name in [*_FRICTION, *_FRICTION]:
        if name in fitted or len(fitted) == len(friction.load):
            continue
        trial = [*fitted, name]
        before: list[float] = [] if fit is None else fit.values.tolist()
        start = getattr(foot, name) or _FRICTION[name][1]
        model = functools.partial(forces, trial)
        least, most = zip(*(_FRICTION[each][2:] for each in trial), strict=True)
        # The law has kinks: a fit can stop on the wrong side of one.
        attempts = [
            _fit(model, friction.tangential_force, [*before, factor * start], least, most)
            for factor in (1.0, 0.3, 3.0)
        ]
        best = min(attempts, key=lambda attempt: attempt.cost)
        if best.identified():
            fitted, fit = trial, best
    return fitted, fit


def _friction_residuals(friction: Friction, foot: Foot, floor: _WetFloor) -> list[Residual]:
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


# --- least squares -------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Fit:
    """Fitted constants."""

    values: Array
    half_widths: Array  # of the 95 % intervals; for logarithms of the values if ``logarithmic``
    logarithmic: bool
    points: int
    cost: float
    sensitivity: Array  # derivatives of the residuals (rows) over the constants

    def constant(self, name: str, unit: str, note: str, index: int = 0) -> Constant:
        value, width = float(self.values[index]), float(self.half_widths[index])
        if self.logarithmic:
            low, high = value * math.exp(-width), value * math.exp(width)
        else:
            low, high = value - width, value + width
        return Constant(name, unit, value, low, high, self.points, True, note)

    def identified(self) -> bool:
        """Return whether the data determine each constant separately."""
        if not np.isfinite(self.values).all():
            return False
        singular = np.linalg.svd(self.sensitivity, compute_uv=False)
        known = self.half_widths[~np.isnan(self.half_widths)]
        return bool(
            singular[-1] > _LEAST_EFFECT * math.sqrt(self.points)
            and (known < math.log(_WIDEST)).all()
        )


def _fit(
    model: Callable[[Array], Array],
    measured: Array,
    start: Sequence[float],
    least: Sequence[float],
    most: Sequence[float] | None = None,
) -> _Fit:
    """Fit positive constants within bounds, minimising relative errors."""
    from scipy.optimize import least_squares

    low = np.log(least) + 1e-9
    high = np.full(len(low), np.inf) if most is None else np.log(most)
    first = np.clip(np.log(start), low + 1e-3, high - 1e-3)

    def errors(logarithms: Array) -> Array:
        error = model(np.exp(logarithms)) / measured - 1.0
        # Where the model has no value, the error counts as 100 %.
        return np.where(np.isnan(error), 1.0, error)

    found = least_squares(errors, first, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    values = np.exp(found.x)
    if np.isnan(model(values)).any():
        values = np.full_like(values, np.nan)
    widths = _half_widths(found.jac, found.fun)
    return _Fit(values, widths, True, len(measured), float(found.cost), found.jac)


def _line(design: Array, measured: Array) -> _Fit:
    """Fit the constants of a linear law, minimising absolute errors."""
    values = np.asarray(np.linalg.lstsq(design, measured, rcond=None)[0], dtype=np.float64)
    missed = design @ values - measured
    widths = _half_widths(design, missed)
    return _Fit(values, widths, False, len(measured), float(missed @ missed), design)


def _half_widths(jacobian: Array, residuals: Array) -> Array:
    """Return half-widths of the intervals; NaN unless there are more points than constants."""
    from scipy.stats import t as student

    points, constants = jacobian.shape
    spare = points - constants
    if spare < 1:
        return np.full(constants, np.nan)
    variance = float(residuals @ residuals) / spare
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    factor = student.ppf(0.5 + 0.5 * CONFIDENCE, spare)
    return np.asarray(factor * np.sqrt(np.diag(covariance)))


def _kept(name: str, unit: str, value: float, note: str) -> Constant:
    return Constant(name, unit, value, math.nan, math.nan, 0, False, note)


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2)))

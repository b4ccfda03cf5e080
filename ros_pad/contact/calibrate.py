# SPDX-License-Identifier: Apache-2.0
"""Fitting a foot's constants to measurements: stiffness, force limit, friction, film.

Constants that are positive are fitted by their logarithm, to relative errors; intervals are those
of Student's t at 95 %, from the curvature of the sum of squares at its least value.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import pathlib
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.contact.dome import BURST
from ros_pad.contact.dome import inflate
from ros_pad.contact.dome import largest_tension
from ros_pad.contact.dome import press
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit
from ros_pad.contact.limits import largest_pressure
from ros_pad.contact.limits import measured_line
from ros_pad.contact.measurements import Friction
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import MeasuredLimit
from ros_pad.contact.pad import Pad
from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput

CONFIDENCE = 0.95
# A constant is told by the data if its interval ends within this factor, and if no change of the
# constants by 1 % leaves the data alone to one part in 10^5.
_WIDEST = 10.0
_LEAST_EFFECT = 1e-3

# Constants of friction in the order in which measurements tell them: unit, where a fit starts if
# the foot has none, and the range in which a foot file may have it.
_FRICTION = {
    'friction': ('(coefficient)', 0.3, 0.01, 3.0),
    'shear_strength': ('Pa', 3e3, 1.0, 1e6),
    'conforming_pressure': ('Pa', 1e4, 1.0, 1e7),
    'boundary_friction': ('(coefficient)', 0.1, 1e-4, 3.0),
    'critical_film': ('m', 3e-7, 1e-9, 1e-3),
    'film_exponent': ('(exponent)', 2.0, 0.1, 10.0),
}
# The ranges in which it may have what is fitted without bounds.
_IN_FOOT = {
    'stiffness': (1.0, 1e4),
    'force_limit': (0.0, 1e3),
    'force_limit_slope': (1e-9, 1.0),
}


@dataclass(frozen=True)
class Constant:
    """One constant after a calibration.

    Attributes
    ----------
    name, unit : str
    value : float
    low, high : float
        95 % interval; NaN where there are no more points than constants, or nothing was fitted.
    points : int
        Measurements that it rests on.
    fitted : bool
        Fitted to them, or kept as it was.
    note : str
        What it is for, or why it was kept.
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
    """One measured number beside the calibrated model's.

    Attributes
    ----------
    quantity : str
        ``height``, ``depth``, ``contact_radius``, ``gap``, ``force_limit``, ``tangential_force``.
    setting : str
        At which pressure, force and so on, in words.
    pressure : float
        Pa gauge.
    measured, modelled : float
        SI units; the model's is NaN where it has no equilibrium, or knows no force limit.
    used : bool
        In a fit; the others only show what the model makes of them.
    """

    quantity: str
    setting: str
    pressure: float
    measured: float
    modelled: float
    used: bool

    @property
    def error(self) -> float:
        """Model over measurement, less one."""
        return self.modelled / self.measured - 1.0 if self.measured else math.nan


@dataclass(frozen=True)
class Calibration:
    """What a calibration found.

    Attributes
    ----------
    measurements : Measurements
    foot : Foot
        The foot to start from, with the constants that were fitted.
    constants : tuple of Constant
    residuals : tuple of Residual
    warnings : tuple of str
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
) -> Calibration:
    """Fit the constants of a foot to measurements.

    Parameters
    ----------
    measurements : Measurements
        Of which kinds there are decides what is fitted: free domes give ``stiffness`` (pressed
        ones where there are fewer than two free ones), force limits the line of the criterion
        ``measured``, tangential forces the constants of friction and film.
    foot : Foot
        Where the fit starts; it gives the radius of the pads, and whatever is not fitted.
    film_thickness : float
        Of the liquid on the wet floor before a foot stands in it, m, above 0.
    viscosity : float
        Of that liquid, Pa s, above 0.

    Raises
    ------
    InvalidInput
        When nothing can be fitted: the message says what each fit needs; or when a measurement
        contradicts the model or the foot.
    """
    number('film_thickness', film_thickness, 'm', above=True)
    number('viscosity', viscosity, 'Pa s', above=True)
    constants: list[Constant] = []
    warnings: list[str] = []
    pad = _stiffness(measurements, foot.pad, constants, warnings)
    pad = _limit(measurements, pad, constants, warnings)
    foot = _with(foot, pad=pad, ceiling=_ceiling(foot, pad, warnings))
    wet_floor = _WetFloor(film_thickness, viscosity)
    foot = _friction(measurements, foot, wet_floor, constants, warnings)
    if not any(constant.fitted for constant in constants):
        raise InvalidInput(
            f'{measurements.source}: nothing can be fitted: stiffness needs a free or a pressed '
            'dome, the force limit two pressures, friction tangential forces'
        )
    for constant in constants:
        _fits_a_foot(measurements.source, constant)
    used_free = len(measurements.free.pressure) >= 1
    residuals = (
        *_shape_residuals(measurements, pad, used_free),
        *_limit_residuals(measurements, pad),
        *_friction_residuals(measurements.friction, foot, wet_floor),
    )
    return Calibration(measurements, foot, tuple(constants), residuals, tuple(warnings))


def _ceiling(foot: Foot, pad: Pad, warnings: list[str]) -> float:
    """Return the foot's ceiling, lowered in whole kPa to where the model of softer pads ends."""
    end = largest_pressure(pad, foot.limit)
    if foot.ceiling <= end:
        return foot.ceiling
    lowered = 1e3 * math.floor(end / 1e3)
    warnings.append(
        f'the ceiling is lowered from {foot.ceiling:g} to {lowered:g} Pa: the model of these'
        f' softer pads ends at {end:.6g} Pa'
    )
    return lowered


def _fits_a_foot(source: str, constant: Constant) -> None:
    least, most = _IN_FOOT.get(constant.name, (-math.inf, math.inf))
    if constant.fitted and not least <= constant.value <= most:
        raise InvalidInput(
            f'{source}: {constant.name} comes out as {constant.value:.4g} {constant.unit}, which'
            f' no foot may have: from {least:g} to {most:g} {constant.unit} is needed. Are the'
            ' units right?'
        )


def _with(foot: Foot, **changes: float | Pad) -> Foot:
    return dataclasses.replace(foot, **changes)  # type: ignore[arg-type]


def foot_file(calibration: Calibration) -> str:
    """Return the YAML text of the calibrated foot, for :meth:`Foot.load` and every command.

    Comments say of each constant whether it was fitted, and how sure it is.
    """
    foot, pad = calibration.foot, calibration.foot.pad
    said = {constant.name: _comment(constant) for constant in calibration.constants}

    def entry(name: str, value: float, unit: str, indent: str = '') -> str:
        # YAML takes 1e-05 for a text: a number needs its point.
        text = f'{value:.9g}'
        text = text if '.' in text else text.replace('e', '.0e') if 'e' in text else f'{text}.0'
        return f'{f"{indent}{name}: {text}":35} # {unit}'

    def known(name: str, unit: str) -> str:
        comment = f'{unit}, {said[name]}' if name in said else f'{unit}, of the start foot'
        return entry(name, getattr(foot, name), comment)

    source = pathlib.PurePath(calibration.measurements.source).name
    lines = [
        f'# Calibrated by pad calibrate from {source}.',
        '# What was fitted has its 95 % interval; the rest is that of the foot it started from.',
        *(f'# {warning}' for warning in calibration.warnings),
        # Between quotes, for a path may hold what YAML takes for a mark of its own.
        f'description: {json.dumps(foot.source + ", calibrated", ensure_ascii=False)}',
        '',
        'pad:',
        entry('radius', pad.radius, 'm', '  '),
        entry('stiffness', pad.stiffness, f'N/m, {said["stiffness"]}', '  '),
        entry('adhesion_energy', pad.adhesion_energy, 'J/m2', '  '),
    ]
    if pad.measured_limit is not None:
        lines += [
            '  measured_limit: # of one pad',
            entry('force', pad.measured_limit.force, f'N, {said["force_limit"]}', '    '),
            entry('pressure', pad.measured_limit.pressure, 'Pa gauge', '    '),
            entry('slope', pad.measured_limit.slope, f'N/Pa, {said["force_limit_slope"]}', '    '),
        ]
    lines += ['', f'pads: {foot.pads}', entry('sole_radius', foot.sole_radius, 'm')]
    lines += [known(name, unit) for name, (unit, *_) in _FRICTION.items()]
    lines += [
        entry('shear_stiffness', foot.shear_stiffness, 'N/m of the whole foot'),
        entry('chamber_volume', foot.chamber_volume, 'm3 of air besides that under the pads'),
        entry('ceiling', foot.ceiling, 'Pa gauge'),
        f'force_limit: {foot.limit}',
    ]
    return '\n'.join(lines) + '\n'


def _comment(constant: Constant) -> str:
    if not constant.fitted:
        return 'kept'
    if math.isnan(constant.low):
        return f'fitted to {constant.points} points, too few for an interval'
    return f'fitted: {constant.low:.4g} to {constant.high:.4g} ({constant.points} points)'


# --- stiffness -----------------------------------------------------------------------------------


def stiffness_of(pad: Pad, pressure: Array, height: Array) -> Array:
    """Return the stiffness, N/m, with which each free dome would have just the height it has.

    Thesis 3.60 with F = 0, solved for k: ``k = p r/(6 sin t - 2 sin 2t)``, ``tan t = height/r``.
    """
    t = np.arctan(height / pad.radius)
    return pressure * pad.radius / (6.0 * np.sin(t) - 2.0 * np.sin(2.0 * t))


def tension_law(pad: Pad, pressure: Array, height: Array) -> tuple[Array, Array]:
    """Return the membrane's tension, N/m, and its stretch, of free domes.

    Laplace: ``2 T = p R`` with ``R = (r² + height²)/(2 height)``; ``sigma² = 1 + (height/r)²``.
    """
    relative = height / pad.radius
    tension = 0.25 * pressure * pad.radius * (1.0 + relative**2) / relative
    return tension, np.sqrt(1.0 + relative**2)


def _stiffness(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> Pad:
    free, pressed = measurements.free, measurements.pressed
    for name, values in (
        ('height', free.height),
        ('pressure of a free dome', free.pressure),
        ('pressure of a pressed dome', pressed.pressure),
        ('height of a pressed dome', pressed.height),
        ('gap', pressed.gap),
    ):
        _tall_enough(measurements.source, name, values)
    if len(free.pressure):
        least = float(free.pressure.max()) * pad.radius / BURST

        def heights(k: Array) -> Array:
            return np.asarray(inflate(_stiff(pad, k[0]), free.pressure).height)

        fit = _fit(heights, free.height, [pad.stiffness], [least])
        constants.append(fit.constant('stiffness', 'N/m', "of the thesis' law, free domes"))
        best = _stiff(pad, fit.values[0])
        _two_parameters(measurements, best, constants, warnings)
    else:
        best = pad
    wall = np.where(np.isnan(pressed.height), pressed.gap, pressed.height)
    there = ~np.isnan(wall)
    if there.any():
        least = float(pressed.pressure[there].max()) * pad.radius / largest_tension(0.01)

        def walls(k: Array) -> Array:
            dome = press(_stiff(pad, k[0]), pressed.pressure[there], pressed.force[there])
            by_gap = np.isnan(pressed.height[there])
            return np.asarray(np.where(by_gap, dome.gap, dome.height))

        fit = _fit(walls, wall[there], [best.stiffness], [least])
        if np.isnan(fit.values).any():
            raise InvalidInput(
                f'{measurements.source}: the pressed domes carry more than the model of a pad of '
                f'radius {pad.radius:g} m at their pressure: is the radius right?'
            )
        if len(free.pressure):
            constants.append(
                fit.constant('stiffness_pressed', 'N/m', 'the same by pressed domes: not used')
            )
        else:
            constants.append(fit.constant('stiffness', 'N/m', "of the thesis' law, pressed domes"))
            best = _stiff(pad, fit.values[0])
    elif not len(free.pressure):
        constants.append(_kept('stiffness', 'N/m', pad.stiffness, 'no shape was measured'))
    return best


def _two_parameters(
    measurements: Measurements, pad: Pad, constants: list[Constant], warnings: list[str]
) -> None:
    """Fit ``T = T0 + k (sigma - 1)`` to the pressures of free domes, and compare."""
    free = measurements.free
    if len(np.unique(free.pressure)) < 2:
        return
    tension, stretch = tension_law(pad, free.pressure, free.height)
    # p = 2 T/R, linear in both constants; least squares of the pressure.
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
            f'one stiffness does not fit: that of single points goes from {first:.3g} N/m at'
            f' {free.pressure.min():g} Pa to {last:.3g} at {free.pressure.max():g} Pa; the law of'
            f' two constants misses the pressures by {two:.3g} Pa instead of {one:.3g} Pa (rms)'
        )


def _stiff(pad: Pad, stiffness: float) -> Pad:
    return dataclasses.replace(pad, stiffness=float(stiffness))


def _tall_enough(source: str, name: str, values: Array) -> None:
    if (values <= 0.0).any():
        raise InvalidInput(f'{source}: {name} = 0 cannot be fitted to: above 0 is needed')


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
    pressure, limit = measurements.force_limits
    if len(np.unique(pressure)) < 2:
        if len(pressure):
            warnings.append('one pressure is not enough for the line of the force limit')
        line = measured_line(pad)
        note = "the thesis' line" if pad.measured_limit is None else "the start foot's line"
        constants.append(
            _kept('force_limit', 'N', line.force, f'{note}, on one pad at {line.pressure:g} Pa')
        )
        constants.append(_kept('force_limit_slope', 'N/Pa', line.slope, note))
        return pad
    middle = float(pressure.mean())
    fit = _line(np.column_stack([np.ones_like(pressure), pressure - middle]), limit)
    force, slope = fit.values
    if slope <= 0.0 or force < 0.0:
        raise InvalidInput(
            f'{measurements.source}: the force limits fall with pressure (slope {slope:.3g} N/Pa):'
            ' a limit that rises is needed'
        )
    at = f'line of the force limit of one pad, at {middle:g} Pa'
    constants.append(fit.constant('force_limit', 'N', at, 0))
    constants.append(fit.constant('force_limit_slope', 'N/Pa', 'and how it rises', 1))
    return dataclasses.replace(
        pad, measured_limit=MeasuredLimit(float(force), middle, float(slope))
    )


def _limit_residuals(measurements: Measurements, pad: Pad) -> list[Residual]:
    pressure, limit = measurements.force_limits
    if not len(pressure):
        return []
    used = pad.measured_limit is not None
    known = pressure <= largest_pressure(pad)
    modelled = np.where(known, force_limit(pad, np.where(known, pressure, 0.0)), np.nan)
    return [
        Residual('force_limit', f'{p:g} Pa', p, value, float(model), used)
        for p, value, model in zip(pressure, limit, modelled, strict=True)
    ]


# --- friction and film ---------------------------------------------------------------------------


@dataclass(frozen=True)
class _WetFloor:
    film_thickness: float
    viscosity: float


def _slips_at(friction: Friction, foot: Foot, floor: _WetFloor) -> Array:
    """Return the model's tangential force of each row of measurements, N."""
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
            film.drain(domes, sole, pressure, stance_time)
            under_domes, under_sole = film.under_domes, film.under_sole
        forces.append(foot.resistance_of(domes, sole, pressure, under_domes, under_sole))
    return np.array(forces)


def _friction(
    measurements: Measurements,
    foot: Foot,
    floor: _WetFloor,
    constants: list[Constant],
    warnings: list[str],
) -> Foot:
    friction = measurements.friction
    if not len(friction.load):
        for name, (unit, *_) in _FRICTION.items():
            constants.append(_kept(name, unit, getattr(foot, name), 'no friction was measured'))
        return foot
    for name in ('load', 'tangential_force'):
        _tall_enough(measurements.source, name, getattr(friction, name))
    if np.isnan(friction.stance_time[friction.wet]).any():
        raise InvalidInput(
            f'{measurements.source}: friction on a wet floor needs stance_time: how long the foot '
            'stood before it slipped'
        )
    if (friction.pressure > foot.ceiling).any():
        raise InvalidInput(
            f'{measurements.source}: friction at {friction.pressure.max():g} Pa, above the ceiling'
            f' of {foot.source}, {foot.ceiling:g} Pa'
        )

    def forces(names: Sequence[str], values: Array) -> Array:
        changed = _with(foot, **dict(zip(names, values.tolist(), strict=True)))
        return _slips_at(friction, changed, floor)

    fitted: list[str] = []
    fit = None
    # A constant is added if the data tell it apart from those before it. The second round is for
    # those that had to wait for a later one.
    for name in [*_FRICTION, *_FRICTION]:
        if name in fitted or len(fitted) == len(friction.load):
            continue
        trial = [*fitted, name]
        before: list[float] = [] if fit is None else fit.values.tolist()
        start = getattr(foot, name) or _FRICTION[name][1]
        model = functools.partial(forces, trial)
        least, most = zip(*(_FRICTION[each][2:] for each in trial), strict=True)
        # The law has kinks: a fit may end on the wrong side of one.
        attempts = [
            _fit(model, friction.tangential_force, [*before, factor * start], least, most)
            for factor in (1.0, 0.3, 3.0)
        ]
        best = min(attempts, key=lambda attempt: attempt.cost)
        if best.identified():
            fitted, fit = trial, best
    for name, (unit, *_) in _FRICTION.items():
        if fit is not None and name in fitted:
            constants.append(
                fit.constant(name, unit, f'{len(friction.load)} forces', fitted.index(name))
            )
        else:
            note = 'these forces do not tell it: kept'
            constants.append(_kept(name, unit, getattr(foot, name), note))
    if fit is None:
        warnings.append('the tangential forces tell none of the constants of friction')
        return foot
    kept = [name for name in _FRICTION if name not in fitted]
    if kept:
        warnings.append(
            f'{", ".join(kept)} could not be told from these forces: what was fitted holds if the '
            f'values of {foot.source} are right'
        )
    return _with(foot, **dict(zip(fitted, fit.values.tolist(), strict=True)))


def _friction_residuals(friction: Friction, foot: Foot, floor: _WetFloor) -> list[Residual]:
    modelled = _slips_at(friction, foot, floor)
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
    """Values of constants with half-widths of their intervals, in value or in logarithm."""

    values: Array
    half_widths: Array
    logarithmic: bool
    points: int
    cost: float
    sensitivity: Array  # of the residuals to each constant

    def constant(self, name: str, unit: str, note: str, index: int = 0) -> Constant:
        value, width = float(self.values[index]), float(self.half_widths[index])
        if self.logarithmic:
            low, high = value * math.exp(-width), value * math.exp(width)
        else:
            low, high = value - width, value + width
        return Constant(name, unit, value, low, high, self.points, True, note)

    def identified(self) -> bool:
        """Return whether the data tell each constant apart from the others."""
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
    """Fit positive constants, within bounds, to relative errors."""
    from scipy.optimize import least_squares

    low = np.log(least) + 1e-9
    high = np.full(len(low), np.inf) if most is None else np.log(most)
    first = np.clip(np.log(start), low + 1e-3, high - 1e-3)

    def errors(logarithms: Array) -> Array:
        error = model(np.exp(logarithms)) / measured - 1.0
        # A trial outside the model: as bad as twice what was measured.
        return np.where(np.isnan(error), 1.0, error)

    found = least_squares(errors, first, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    values = np.exp(found.x)
    if np.isnan(model(values)).any():
        values = np.full_like(values, np.nan)
    widths = _half_widths(found.jac, found.fun)
    return _Fit(values, widths, True, len(measured), float(found.cost), found.jac)


def _line(design: Array, measured: Array) -> _Fit:
    """Fit the constants of a linear law to absolute errors."""
    values = np.asarray(np.linalg.lstsq(design, measured, rcond=None)[0], dtype=np.float64)
    missed = design @ values - measured
    widths = _half_widths(design, missed)
    return _Fit(values, widths, False, len(measured), float(missed @ missed), design)


def _half_widths(jacobian: Array, residuals: Array) -> Array:
    """Return half-widths of the intervals; NaN without a point to spare."""
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

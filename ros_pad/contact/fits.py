# SPDX-License-Identifier: Apache-2.0
"""Least squares with 95 % intervals, and the constants that they give."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.contact.pad import Array


@dataclass(frozen=True)
class Constant:
    """One constant after a calibration.

    Attributes
    ----------
    name, unit : str
        Name and unit of the constant.
    value : float
        Value in this unit.
    note : str
        Purpose of the constant, or the reason why it was kept.
    low, high : float
        95 % interval; NaN where there are no more points than constants, or nothing was fitted.
    points : int
        Number of measurements used for the fit.
    fitted : bool
        True if fitted, False if kept from the start foot.
    """

    name: str
    unit: str
    value: float
    note: str
    low: float = math.nan
    high: float = math.nan
    points: int = 0
    fitted: bool = False


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
class Fit:
    """Fitted constants: values, half-widths of 95 % intervals, points, and sum of squares.

    ``half_widths`` are of the logarithms of the values if ``logarithmic``; ``sensitivity`` has the
    derivatives of the residuals (rows) over the constants.
    """

    values: Array
    half_widths: Array
    logarithmic: bool
    points: int
    cost: float
    sensitivity: Array

    def constant(self, name: str, unit: str, note: str, index: int = 0) -> Constant:
        """Return one of the constants with its interval."""
        value, width = float(self.values[index]), float(self.half_widths[index])
        if self.logarithmic:
            low, high = value * math.exp(-width), value * math.exp(width)
        else:
            low, high = value - width, value + width
        return Constant(name, unit, value, note, low, high, self.points, True)

    def identified(self) -> bool:
        """Return whether the data determine each constant separately.

        Its interval must be within a factor of 10 of its value, and every change of the constants
        by 1 % must change the modelled data by more than one part in 10^5.
        """
        if not np.isfinite(self.values).all():
            return False
        singular = np.linalg.svd(self.sensitivity, compute_uv=False)
        known = self.half_widths[~np.isnan(self.half_widths)]
        felt = singular[-1] > 1e-3 * math.sqrt(self.points)
        return bool(felt and (known < math.log(10.0)).all())


def fit_positive(
    model: Callable[[Array], Array],
    measured: Array,
    start: Sequence[float],
    least: Sequence[float],
    most: Sequence[float],
) -> Fit:
    """Fit positive constants within bounds, minimising relative errors."""
    from scipy.optimize import least_squares

    low, high = np.log(least) + 1e-9, np.log(most)
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
    return Fit(values, widths, True, len(measured), float(found.cost), found.jac)


def line_through(design: Array, measured: Array) -> Fit:
    """Fit the constants of a linear law, minimising absolute errors."""
    values = np.asarray(np.linalg.lstsq(design, measured, rcond=None)[0], dtype=np.float64)
    missed = design @ values - measured
    widths = _half_widths(design, missed)
    return Fit(values, widths, False, len(measured), float(missed @ missed), design)


def _half_widths(jacobian: Array, residuals: Array) -> Array:
    """Return half-widths of the intervals; NaN unless there are more points than constants."""
    from scipy.stats import t as student

    points, constants = jacobian.shape
    spare = points - constants
    if spare < 1:
        return np.full(constants, np.nan)
    covariance = residuals @ residuals / spare * np.linalg.pinv(jacobian.T @ jacobian)
    return np.asarray(student.ppf(0.975, spare) * np.sqrt(np.diag(covariance)))

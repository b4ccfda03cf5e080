# SPDX-License-Identifier: Apache-2.0
"""Largest force on an inflated pad by three criteria, and the pressure for a force.

``measured``
    A straight line through measurements: of this pad, or else the three measurements of the thesis
    on its large pad (0.15, 0.30, 0.40 N at 65, 75, 85 kPa), in proportion to the area.
``max_depth``
    The force at which the floor cuts deepest into the cap; under a larger force the dome
    collapses sideways.
``flattening``
    The force at which the contact reaches the rim and the model ends.

The last two follow from the model with its default adhesion; the code uses the dimensionless
variables of :mod:`ros_pad.contact.dome`. A pad of a material is a membrane without adhesion, which
flattens at ``p π r²``; it is no cap, so it has no ``max_depth``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice
from ros_pad.configuration import quantity
from ros_pad.contact.dome import BURST
from ros_pad.contact.dome import flattening_force
from ros_pad.contact.dome import largest_tension
from ros_pad.contact.dome import signed_adhesion
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import MeasuredLimit
from ros_pad.contact.pad import Pad
from ros_pad.contact.pad import broadcast
from ros_pad.contact.pad import plain
from ros_pad.errors import NoEquilibrium

CRITERIA = ('measured', 'flattening', 'max_depth')

# Line fitted to the thesis' measurements on its large pad.
THESIS_LIMIT = MeasuredLimit(force=0.2833, pressure=75e3, slope=1.25e-5)
# The thesis measured up to 85 kPa; the line is extrapolated to the end of this pad's model.
_THESIS_END = 3.426 * LARGE_PAD.stiffness / LARGE_PAD.radius

# Upper bounds of height and depth (over the radius) of the deepest dome. A second solution, which
# fails the certificate, has depths above 0.57.
_HIGHEST, _DEEPEST = 0.655, 0.55


def force_limit(pad: Pad, pressure: npt.ArrayLike, criterion: str = 'measured') -> Floats:
    """Return the largest normal force on one pad at a pressure, N.

    Parameters
    ----------
    pad : Pad
        Size and material.
    pressure : float or array
        Gauge pressure, Pa, from 0 to the end of the model (see :func:`ros_pad.contact.press`).
        With the measurements of the thesis also at most 91.36 kPa, for every pad.
    criterion : {'measured', 'flattening', 'max_depth'}
        ``measured`` is the pad's own ``measured_limit``. Without one it is
        ``0.2833 + 0.0125 (p/kPa - 75)`` N for a pad of 1.5 mm radius; for other radii this is
        scaled with the radius squared, which has not been measured.

    Returns
    -------
    float or array
        0 where the pad carries nothing (``measured``: below 52.3 kPa). In arrays NaN above the
        end of the model.

    Raises
    ------
    NoEquilibrium
        For a scalar pressure above the end of the model; status ``fold_zone`` or
        ``no_inflation``.
    InvalidInput
        When the criterion is unknown, or a pressure is negative, not finite, or above the
        measurements.
    """
    choice('criterion', criterion, criteria(pad))
    p = quantity('pressure', pressure, 'Pa')
    tension = p * (pad.radius / pad.stiffness)
    end, status = _model_end(pad)
    inside = p <= end
    if np.ndim(p) == 0 and not inside:
        if pad.material is None and tension >= BURST:
            status = 'no_inflation'
        raise NoEquilibrium(
            f'pressure = {p:g} Pa on {pad} has no force limit: up to {end:.6g} Pa is needed',
            status,
        )
    if criterion == 'measured':
        quantity('pressure', np.where(inside, p, 0.0), 'Pa', high=_end_of_measurements(pad))
        line = measured_line(pad)
        limit = line.force + line.slope * (p - line.pressure)
    elif pad.material is not None:
        limit = p * (math.pi * pad.radius**2)
    else:
        a = signed_adhesion(pad, 'matlab')
        tension = np.where(inside, tension, 1.0)
        if criterion == 'flattening':
            f = flattening_force(tension, a)
        else:
            f = _deepest_force(tension, a)
        limit = f * (math.pi * pad.stiffness * pad.radius)
    return plain(np.where(inside, np.maximum(limit, 0.0), np.nan))


def pressure_for(
    pad: Pad, force: npt.ArrayLike, criterion: str = 'measured', margin: npt.ArrayLike = 1.0
) -> Floats:
    """Return the lowest pressure with a force limit of ``margin * force``, Pa gauge.

    Parameters
    ----------
    pad : Pad
        Size and material.
    force : float or array
        Normal force on this one pad, N, from 0. For 0 the result is the pressure above which the
        limit is above 0.
    criterion : {'measured', 'flattening', 'max_depth'}
        As for :func:`force_limit`.
    margin : float or array
        Factor on the force, above 0.

    Returns
    -------
    float or array
        NaN in arrays where no pressure of the model carries the force.

    Raises
    ------
    NoEquilibrium
        For scalars where no pressure up to the end of the model carries the force; status
        ``fold_zone``.
    InvalidInput
        When the criterion is unknown, a value is negative or not finite, or shapes do not
        broadcast.
    """
    choice('criterion', criterion, criteria(pad))
    load = quantity('force', force, 'N')
    factor = quantity('margin', margin, '(factor)', above=True)
    load, factor = broadcast('force and margin', load, factor)
    load = load * factor
    end = largest_pressure(pad, criterion)
    strongest = force_limit(pad, end * (1.0 - 1e-15), criterion)
    carried = load <= strongest
    if np.ndim(load) == 0 and not carried:
        raise NoEquilibrium(
            f'force times margin = {load:g} N on {pad} is too high for any pressure: at most'
            f' {strongest:.6g} N, at {end:.6g} Pa, is allowed by the criterion {criterion}',
            'fold_zone',
        )
    load = np.where(carried, load, 0.0)
    if criterion == 'measured':
        line = measured_line(pad)
        # A line that is above 0 at pressure 0 carries small forces without any pressure.
        p = np.maximum(line.pressure + (load - line.force) / line.slope, 0.0)
    elif pad.material is not None:
        p = load / (math.pi * pad.radius**2)
    else:
        a = signed_adhesion(pad, 'matlab')
        f = load / (math.pi * pad.stiffness * pad.radius)
        invert = _tension_at_flattening if criterion == 'flattening' else _tension_at_deepest
        p = invert(f, a) * (pad.stiffness / pad.radius)
    return plain(np.where(carried, p, np.nan))


def largest_pressure(pad: Pad, criterion: str = 'measured') -> float:
    """Return the highest pressure for which a criterion has a force limit, Pa gauge.

    This is the end of the model of the pressed dome. For ``measured`` it is at most 91.36 kPa, the
    end of the thesis' line, if the pad has no ``measured_limit`` of its own.
    """
    choice('criterion', criterion, criteria(pad))
    end = _model_end(pad)[0]
    return min(end, _end_of_measurements(pad)) if criterion == 'measured' else end


def criteria(pad: Pad) -> tuple[str, ...]:
    """Return the criteria that a pad has: ``max_depth`` is one of the spherical dome alone.

    Of a pad with an edge, pressed shapes are not known, and so only what was measured.
    """
    if pad.edge is not None:
        return ('measured',)
    return CRITERIA if pad.material is None else ('measured', 'flattening')


def _model_end(pad: Pad) -> tuple[float, str]:
    """Return the pressure at which the model of the pressed dome ends, Pa, and its status."""
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import pressure_end

        return pressure_end(pad)
    largest = largest_tension(signed_adhesion(pad, 'matlab'))
    return largest * pad.stiffness / pad.radius, 'fold_zone'


def measured_line(pad: Pad) -> MeasuredLimit:
    """Return the line of measured force limits for a pad: its own, or that of the thesis."""
    if pad.measured_limit is not None:
        return pad.measured_limit
    scale = (pad.radius / LARGE_PAD.radius) ** 2
    return MeasuredLimit(
        THESIS_LIMIT.force * scale, THESIS_LIMIT.pressure, THESIS_LIMIT.slope * scale
    )


def resized(pad: Pad, radius: float) -> Pad:
    """Return the pad with another radius, m; a measured force limit is scaled with the area.

    Raises
    ------
    InvalidInput
        When the radius is not finite or not above 0.
    """
    pad, old = replace(pad, radius=radius), pad
    line = pad.measured_limit
    if line is None:
        return pad
    scale = (radius / old.radius) ** 2
    line = MeasuredLimit(line.force * scale, line.pressure, line.slope * scale)
    return replace(pad, measured_limit=line)


def _end_of_measurements(pad: Pad) -> float:
    return _THESIS_END if pad.measured_limit is None else math.inf


def _tension_at_flattening(f: Array, a: float) -> Array:
    return _rising_root(
        lambda tension: flattening_force(tension, a) - f, 0.0 * f, largest_tension(a) + 0.0 * f
    )


def _deepest_force(tension: Array, a: float) -> Array:
    height = _rising_root(lambda x: _deepest(x, a)[0] - tension, *_heights(tension, a))
    return _deepest(height, a)[1]


def _tension_at_deepest(f: Array, a: float) -> Array:
    height = _rising_root(lambda x: _deepest(x, a)[1] - f, *_heights(f, a))
    return _deepest(height, a)[0]


def _heights(like: Array, a: float) -> tuple[Array, Array]:
    """Return lower and upper bound of the heights of the deepest domes."""
    return math.sqrt(a / (2.0 - a)) + 1e-12 + 0.0 * like, _HIGHEST + 0.0 * like


def _deepest(x: Array, a: float) -> tuple[Array, Array]:
    """Return pressure ``P`` and force ``f`` at which a dome of height x has its largest depth.

    Eliminating the force, 3.53 and 3.58 give ``P A(x, d) = B(x, d)`` for height x and depth d. The
    depth is largest where also ``P dA/dx = dB/dx``, so ``A dB/dx = B dA/dx`` gives d for each x,
    and then P. At the lowest pressures d reaches x first: the dome flattens.
    """
    rho = 0.5 * (x + 1.0 / x)
    rho_slope = 0.5 - 0.5 / (x * x)

    def balance(d: Array) -> tuple[Array, Array, Array]:
        sigma = np.sqrt(1.0 + (x - d) * (x + d))
        area = rho * (x - d) + d * d
        pull = (x + d) * (3.0 * sigma - 2.0) - 2.0 * a * rho
        area_slope = rho_slope * (x - d) + rho
        pull_slope = 3.0 * sigma - 2.0 + 3.0 * (x + d) * x / sigma - 2.0 * a * rho_slope
        return area, pull, pull * area_slope - area * pull_slope

    d = _rising_root(lambda depth: balance(depth)[2], 0.0 * x, np.minimum(x, _DEEPEST))
    area, pull, _ = balance(d)
    tension = pull / area
    return tension, tension * d * (2.0 * rho - d) - 2.0 * a * rho


def _rising_root(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return the zero of a rising function (Illinois method); without a zero, the nearer end."""
    at_low, at_high = function(low), function(high)
    # Where the function does not change its sign, close the bracket on the nearer end.
    high = np.where(at_low >= 0, low, high)
    low = np.where(at_high <= 0, high, low)
    at_low, at_high = np.minimum(at_low, 0.0), np.maximum(at_high, 0.0)
    x = low
    kept = np.zeros_like(low)  # end that was kept in the last step: -1 the low one, 1 the high one
    for _ in range(100):
        rise = at_high - at_low
        new = high - at_high * (high - low) / np.where(rise > 0, rise, 1.0)
        value = function(new)
        above = value > 0
        # An end that is kept twice gets half its weight, so that the other end moves too.
        at_low = np.where(above, np.where(kept < 0, 0.5 * at_low, at_low), value)
        at_high = np.where(above, value, np.where(kept > 0, 0.5 * at_high, at_high))
        low, high = np.where(above, low, new), np.where(above, new, high)
        kept = np.where(above, -1, 1)
        done = (abs(new - x) <= 4e-16 * abs(new)) | (value == 0)
        x = new
        if np.all(done):
            break
    return x

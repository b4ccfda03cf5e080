# SPDX-License-Identifier: Apache-2.0
"""Largest force on an inflated pad by several criteria, and the pressure for a force.

``thickness`` (default)
    The force that presses the dome down to a gap as high as its sheet is thick, or to half of its
    free height where that is less or the thickness is not known.
``wall``
    The force at which the wall of the dome is vertical at the rim: below it the dome overhangs. 0
    at pressures at which even the free dome does not.
``flattening``
    The force at which the contact reaches the rim and the model ends.
``max_depth``
    The force at which the floor cuts deepest into the cap; under a larger force the dome
    collapses sideways.
``measured``
    A straight line through force limits measured on this pad: those of its ``measured_limit``, or
    on the large pad of the thesis 0.15, 0.30, 0.40 N at 65, 75, 85 kPa. It says nothing of a pad
    with another radius or stiffness.

All but the last follow from the model with its default adhesion; the code uses the dimensionless
variables of :mod:`ros_pad.contact.dome`. A pad of a material is a membrane without adhesion, which
flattens at ``p π r²``; it is no cap, so it has no ``max_depth``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, quantity
from ros_pad.contact.dome import (
    BURST,
    flattening_force,
    inflate,
    largest_tension,
    press,
    signed_adhesion,
)
from ros_pad.contact.pad import LARGE_PAD, Array, Floats, MeasuredLimit, Pad, broadcast, plain
from ros_pad.errors import InvalidInput, NoEquilibrium

CRITERIA = ('thickness', 'wall', 'flattening', 'max_depth', 'measured')
DEFAULT_CRITERION = 'thickness'

# Line fitted to the thesis' measurements on its large pad.
THESIS_LIMIT = MeasuredLimit(force=0.2833, pressure=75e3, slope=1.25e-5)
# The thesis measured up to 85 kPa; the line is extrapolated to the end of this pad's model.
_THESIS_END = 3.426 * LARGE_PAD.stiffness / LARGE_PAD.radius

# Share of its free height to which a dome lower than two sheets, or of unknown thickness, may go.
LEAST_SHARE = 0.5

# Upper bounds of height and depth (over the radius) of the deepest dome. A second solution, which
# fails the certificate, has depths above 0.57.
_HIGHEST, _DEEPEST = 0.655, 0.55


def force_limit(pad: Pad, pressure: npt.ArrayLike, criterion: str = DEFAULT_CRITERION) -> Floats:
    """Return the largest normal force on one pad at a pressure, N.

    Parameters
    ----------
    pad : Pad
        Size and material.
    pressure : float or array
        Gauge pressure, Pa, from 0 to the end of the model (see :func:`ros_pad.contact.press`).
        With the measurements of the thesis also at most 91.36 kPa.
    criterion : {'thickness', 'wall', 'flattening', 'max_depth', 'measured'}
        See :mod:`ros_pad.contact.limits`. ``measured`` needs a ``measured_limit`` of the pad, or
        the large pad of the thesis: ``0.2833 + 0.0125 (p/kPa - 75)`` N.

    Returns
    -------
    float or array
        Force, N; 0 where the pad carries nothing (``measured`` of the thesis: below 52.3 kPa). In
        arrays NaN above the end of the model.

    Raises
    ------
    NoEquilibrium
        For a scalar pressure above the end of the model; status ``fold_zone`` or
        ``no_inflation``.
    InvalidInput
        When the criterion is unknown or not known for this pad, or a pressure is negative, not
        finite, or above the measurements.

    Examples
    --------
    The thesis measured 0.15, 0.30 and 0.40 N at 65, 75 and 85 kPa:

    >>> from ros_pad.contact import LARGE_PAD, force_limit
    >>> force_limit(LARGE_PAD, [65e3, 75e3, 85e3]).round(3).tolist()
    [0.244, 0.317, 0.404]
    >>> round(force_limit(LARGE_PAD, 75e3, 'flattening'), 3)
    0.527
    """
    check_criterion(pad, criterion)
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
    elif criterion == 'max_depth':
        tension = np.where(inside, tension, 1.0)
        limit = _deepest_force(tension, signed_adhesion(pad, 'matlab'))
        limit = limit * (math.pi * pad.stiffness * pad.radius)
    else:
        limit = _flattening(pad, np.where(inside, p, 0.0))
        if criterion != 'flattening':
            # press can refuse the end itself because of rounding.
            p = np.minimum(np.where(inside, p, 0.0), end * (1.0 - 1e-15))
            limit = _where_room_ends(pad, p, limit, criterion)
    return plain(np.where(inside, np.maximum(limit, 0.0), np.nan))


def pressure_for(
    pad: Pad,
    force: npt.ArrayLike,
    criterion: str = DEFAULT_CRITERION,
    margin: npt.ArrayLike = 1.0,
) -> Floats:
    """Return the lowest pressure with a force limit of ``margin * force``, Pa gauge.

    Parameters
    ----------
    pad : Pad
        Size and material.
    force : float or array
        Normal force on this one pad, N, from 0. For 0 the result is the pressure above which the
        limit is above 0.
    criterion : {'thickness', 'wall', 'flattening', 'max_depth', 'measured'}
        As for :func:`force_limit`.
    margin : float or array
        Factor on the force, above 0.

    Returns
    -------
    float or array
        Gauge pressure, Pa. NaN in arrays where no pressure of the model carries the force.

    Raises
    ------
    NoEquilibrium
        For scalars where no pressure up to the end of the model carries the force; status
        ``fold_zone``.
    InvalidInput
        When the criterion is unknown or not known for this pad, a value is negative or not finite,
        or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import LARGE_PAD, pressure_for
    >>> round(pressure_for(LARGE_PAD, 0.25, margin=1.2))  # Pa
    72767
    """
    check_criterion(pad, criterion)
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
    elif criterion == 'max_depth':
        f = load / (math.pi * pad.stiffness * pad.radius)
        p = _tension_at_deepest(f, signed_adhesion(pad, 'matlab')) * (pad.stiffness / pad.radius)
    else:
        p = _pressure_at_flattening(pad, load)
        if criterion != 'flattening':
            p = _where_room_begins(pad, load, p, criterion)
    return plain(np.where(carried, p, np.nan))


def largest_pressure(pad: Pad, criterion: str = DEFAULT_CRITERION) -> float:
    """Return the highest pressure for which a criterion has a force limit, Pa gauge.

    This is the end of the model of the pressed dome. For ``measured`` it is at most 91.36 kPa, the
    end of the thesis' line, if the pad has no ``measured_limit`` of its own.
    """
    check_criterion(pad, criterion)
    end = _model_end(pad)[0]
    return min(end, _end_of_measurements(pad)) if criterion == 'measured' else end


def criteria(pad: Pad) -> tuple[str, ...]:
    """Return the criteria that a pad has.

    ``max_depth`` is one of the spherical dome alone, ``measured`` one of pads that were measured,
    and the only one of pads with an edge, whose pressed shapes are not known.
    """
    measured = ('measured',) if pad.measured_limit is not None or _is_large_pad(pad) else ()
    if pad.edge is not None:
        return measured
    missing = 'max_depth' if pad.material is not None else ''
    return tuple(each for each in CRITERIA[:-1] if each != missing) + measured


def check_criterion(pad: Pad, criterion: str, name: str = 'criterion') -> None:
    """Raise `InvalidInput` for a criterion that is unknown, or not known for the pad."""
    instance('pad', pad, Pad)
    if pad.edge is not None and criterion in CRITERIA[:-1]:
        raise InvalidInput(
            f'{name} = {criterion!r} is not allowed for {pad}: shapes under load are not known'
            ' with an edge; a measured_limit and the criterion measured, or no edge, is needed'
        )
    if criterion == 'measured' and criterion not in criteria(pad):
        others = f'one of {", ".join(criteria(pad))}' if pad.edge is None else 'no edge,'
        raise InvalidInput(
            f'{name} = {criterion!r} is not allowed for {pad}: no force limit was measured on'
            f' it; a measured_limit of the pad, or {others} is needed'
        )
    choice(name, criterion, criteria(pad))


def _is_large_pad(pad: Pad) -> bool:
    """Return whether this is the pad on which the thesis measured force limits."""
    return pad.material is None and all(
        math.isclose(getattr(pad, name), getattr(LARGE_PAD, name), rel_tol=1e-9)
        for name in ('radius', 'stiffness')
    )


def _model_end(pad: Pad) -> tuple[float, str]:
    """Return the pressure at which the model of the pressed dome ends, Pa, and its status."""
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import pressure_end

        return pressure_end(pad)
    largest = largest_tension(signed_adhesion(pad, 'matlab'))
    return largest * pad.stiffness / pad.radius, 'fold_zone'


def measured_line(pad: Pad) -> MeasuredLimit:
    """Return the line of measured force limits of a pad: its own, or that of the thesis."""
    return pad.measured_limit or THESIS_LIMIT


def resized(pad: Pad, radius: float) -> Pad:
    """Return a pad of the same sheet with another radius, m, on which no limit was measured.

    Raises
    ------
    InvalidInput
        When the radius is not finite, not above 0, or below the thickness of the sheet.
    """
    if radius == pad.radius:
        return pad
    return replace(pad, radius=radius, measured_limit=None)


def _end_of_measurements(pad: Pad) -> float:
    return _THESIS_END if pad.measured_limit is None else math.inf


def _flattening(pad: Pad, p: Array) -> Array:
    """Return the force at which the contact reaches the rim, N."""
    if pad.material is not None:
        return p * (math.pi * pad.radius**2)
    a = signed_adhesion(pad, 'matlab')
    unit = math.pi * pad.stiffness * pad.radius
    return flattening_force(p * (pad.radius / pad.stiffness), a) * unit


def _pressure_at_flattening(pad: Pad, force: Array) -> Array:
    """Return the pressure at which a force just brings the contact to the rim, Pa."""
    if pad.material is not None:
        return force / (math.pi * pad.radius**2)
    a = signed_adhesion(pad, 'matlab')
    f = force / (math.pi * pad.stiffness * pad.radius)
    tension = _rising_root(
        lambda tension: flattening_force(tension, a) - f, 0.0 * f, largest_tension(a) + 0.0 * f
    )
    return tension * (pad.stiffness / pad.radius)


def _where_room_ends(pad: Pad, p: Array, flat: Array, criterion: str) -> Array:
    """Return the force up to the flattening one at which a pressed dome has no room left, N."""
    flat = np.maximum(flat, 0.0)
    share = _rising_root(
        lambda share: -_room(pad, p, share * flat, criterion), 0.0 * flat, 1.0 + 0.0 * flat
    )
    return share * flat


def _where_room_begins(pad: Pad, force: Array, low: Array, criterion: str) -> Array:
    """Return the pressure from that of flattening on at which a pressed dome gets room, Pa."""
    high = _model_end(pad)[0] * (1.0 - 1e-15) + 0.0 * low
    return _rising_root(lambda p: _room(pad, p, force, criterion), low, high)


def _room(pad: Pad, p: Array, force: Array, criterion: str) -> Array:
    """Return what a pressed dome has left before it reaches a criterion, above 0 below its limit.

    ``thickness``: gap less its least value, over the radius. ``wall``: angle at the rim past 90
    degrees, rad. At flattening both are what a flat wall has.
    """
    shape = np.shape(p)
    rows, loads = np.ravel(p), np.ravel(force)
    if criterion == 'thickness':
        least = LEAST_SHARE * inflate(pad, rows).height
        if pad.thickness is not None:
            least = np.minimum(least, pad.thickness)
        left = np.nan_to_num(press(pad, rows, loads).gap) - least
        return (left / pad.radius).reshape(shape)
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import rim_angle

        angle = rim_angle(pad, rows, loads)
    else:
        # The cap meets the base at twice the angle with the tangent height over radius.
        angle = 2.0 * np.arctan(np.nan_to_num(press(pad, rows, loads).height) / pad.radius)
    return (angle - 0.5 * math.pi).reshape(shape)


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

# SPDX-License-Identifier: Apache-2.0
"""Largest force on an inflated pad by several criteria, and the pressure for a force.

``thickness`` (default)
    The force that presses the dome down to a gap as high as its sheet is thick, or to half of its
    free height where that is less or the thickness is not known.
``flattening``
    The force at which the contact reaches the rim and the model ends.
``measured``
    A straight line through force limits measured on this pad: those of its ``measured_limit``, or
    on the large pad of the thesis 0.15, 0.30, 0.40 N at 65, 75, 85 kPa. It says nothing of a pad
    with another radius or stiffness.

All but the last follow from the model with its default adhesion; the code uses the dimensionless
variables of :mod:`ros_pad.contact.dome`. A pad of a material is a membrane without adhesion, which
flattens at ``p π r²``.
"""

from __future__ import annotations

import math
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
from ros_pad.contact.roots import rising_root
from ros_pad.errors import InvalidInput, NoEquilibrium

CRITERIA = ('thickness', 'flattening', 'measured')
DEFAULT_CRITERION = 'thickness'

# Line fitted to the thesis' measurements on its large pad at up to 85 kPa.
THESIS_LIMIT = MeasuredLimit(force=0.2833, pressure=75e3, slope=1.25e-5)


def force_limit(pad: Pad, pressure: npt.ArrayLike, criterion: str = DEFAULT_CRITERION) -> Floats:
    """Return the largest normal force on one pad at a pressure, N.

    Parameters
    ----------
    pad : Pad
        Size and material.
    pressure : float or array
        Gauge pressure, Pa, from 0 to the end of the model (see :func:`ros_pad.contact.press`).
    criterion : {'thickness', 'flattening', 'measured'}
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
        When the criterion is unknown or not known for this pad, or a pressure is negative or not
        finite.

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
    end, status = _model_end(pad)
    if pad.material is None and p.max() >= BURST * pad.stiffness / pad.radius:
        status = 'no_inflation'
    if not np.ndim(p) and p > end:
        raise NoEquilibrium(
            f'pressure = {p:g} Pa on {pad} has no force limit: up to {end:.6g} Pa is needed',
            status,
        )
    inside = p <= end
    # press can refuse the end itself because of rounding.
    p = np.minimum(np.where(inside, p, 0.0), end * (1.0 - 1e-15))
    if criterion == 'measured':
        line = pad.measured_limit or THESIS_LIMIT
        limit = np.maximum(line.force + line.slope * (p - line.pressure), 0.0)
    else:
        limit = np.maximum(_flattening(pad, p), 0.0)
        if criterion == 'thickness':
            share = rising_root(
                lambda share: -_room(pad, p, share * limit), 0.0 * limit, 1.0 + 0.0 * limit
            )
            limit = share * limit
    return plain(np.where(inside, limit, np.nan))


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
    criterion : {'thickness', 'flattening', 'measured'}
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
    end = largest_pressure(pad)
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
        line = pad.measured_limit or THESIS_LIMIT
        # A line that is above 0 at pressure 0 carries small forces without any pressure.
        p = np.maximum(line.pressure + (load - line.force) / line.slope, 0.0)
    else:
        high = end * (1.0 - 1e-15) + 0.0 * load
        p = rising_root(lambda p: _flattening(pad, p) - load, 0.0 * load, high)
        if criterion == 'thickness':
            p = rising_root(lambda p: _room(pad, p, load), p, high)
    return plain(np.where(carried, p, np.nan))


def largest_pressure(pad: Pad) -> float:
    """Return the end of the model of the pressed dome, up to which there are limits, Pa gauge."""
    return _model_end(pad)[0]


def criteria(pad: Pad) -> tuple[str, ...]:
    """Return the criteria that a pad has: ``measured`` is one of pads that were measured."""
    alike = (
        math.isclose(getattr(pad, name), getattr(LARGE_PAD, name), rel_tol=1e-9)
        for name in ('radius', 'stiffness')
    )
    of_thesis = pad.material is None and all(alike)  # the pad that the thesis measured
    return CRITERIA if of_thesis or pad.measured_limit is not None else CRITERIA[:-1]


def check_criterion(pad: Pad, criterion: str, name: str = 'criterion') -> None:
    """Raise `InvalidInput` for a criterion that is unknown, or not known for the pad."""
    instance('pad', pad, Pad)
    choice(name, criterion, CRITERIA)
    if criterion not in criteria(pad):
        raise InvalidInput(
            f'{name} = {criterion!r} is not allowed for {pad}: no force limit was measured on it;'
            f' a measured_limit of the pad, or one of {", ".join(criteria(pad))} is needed'
        )


def _model_end(pad: Pad) -> tuple[float, str]:
    """Return the pressure at which the model of the pressed dome ends, Pa, and its status."""
    if pad.material is not None:
        from ros_pad.contact.hyperelastic import pressure_end

        return pressure_end(pad)
    largest = largest_tension(signed_adhesion(pad, 'matlab'))
    return largest * pad.stiffness / pad.radius, 'fold_zone'


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


def _flattening(pad: Pad, p: Array) -> Array:
    """Return the force at which the contact reaches the rim, N."""
    if pad.material is not None:
        return p * (math.pi * pad.radius**2)
    a = signed_adhesion(pad, 'matlab')
    unit = math.pi * pad.stiffness * pad.radius
    return flattening_force(p * (pad.radius / pad.stiffness), a) * unit


def _room(pad: Pad, p: Array, force: Array) -> Array:
    """Return gap of a pressed dome less the least that ``thickness`` allows, over the radius."""
    # A dome lower than two sheets, or of unknown thickness, may go to half of its free height.
    least = 0.5 * inflate(pad, np.atleast_1d(p)).height
    if pad.thickness is not None:
        least = np.minimum(least, pad.thickness)
    gap = np.nan_to_num(press(pad, np.atleast_1d(p), force).gap)
    return ((gap - least) / pad.radius).reshape(np.shape(p))

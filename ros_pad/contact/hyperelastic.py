# SPDX-License-Identifier: Apache-2.0
"""Shape of an inflated pad of a material: a membrane of rubber, free and pressed on a floor.

The membrane has no bending stiffness, is flat and unstretched without pressure, and is clamped at
its rim. With the undeformed radius R, stretches λ1 (meridian) and λ2 = r/R, nominal tensions
``N = h dW/dλ``, true tensions ``T1 = N1/λ2``, ``T2 = N2/λ1`` and the angle φ below the horizontal

    r' = λ1 cos φ,   z' = λ1 sin φ,   (R N1)' = N2 cos φ,   φ' = λ1 (p - T2 sin φ/r)/T1.

A frictionless floor touches a flat disc of radius b with uniform stretch λ. There the wall starts
with φ = 0, and ``F = p π b²`` is the force; b = 0 is the free dome. There is no adhesion.

In lengths of ``μ h/p``, with the shear modulus μ, these equations have no parameter but the law.
They are integrated from the disc (stretch λ, undeformed radius) to where λ2 = 1, which is the rim:
its radius is ``P = p r/(μ h)``. So two numbers give one state of all pads of the material, and P
and b/r come out. :func:`shapes` does that for hundreds of states together.

:class:`Domes` turns this round, once for a material: P over the strain of the apex up to its
maximum, or to the end of the material's range, gives the free dome as a spline. For pressed ones
P and the angle ψ = 2 atan(gap/(r - b)) are polynomials in ``w``, which is the strain of the disc
along lines through the state without pressure, and ``s = (b/r)^(1/3)``, in which the
``b² log b`` of small contacts is smooth. A row takes Newton's method for w at its s. P rises with
w up to the maximum pressure of the free dome, so there is one root.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from ros_pad.contact.dome import (
    FLATTENED,
    NO_CONTACT,
    NO_INFLATION,
    OK,
    OUT_OF_RANGE,
    STATUS,
    Codes,
    Inflated,
    words,
)
from ros_pad.contact.material import tensions
from ros_pad.contact.membrane import cap_through
from ros_pad.contact.pad import Array, Floats, Pad
from ros_pad.contact.thickness import HIGHEST, thickened
from ros_pad.errors import InvalidInput, NoEquilibrium

Law = tuple[str, tuple[float, ...]]

# Rows of a batch computed at a time, so that temporary arrays fit the processor's cache.
_CHUNK = 4096
# States integrated together: with more, BLAS would start threads for each step.
_TOGETHER = 1000
# Most evaluations of the equations in one integration; usual are 2,000.
_EVALUATIONS = 20000
# Relative tolerance of the integration.
_TOLERANCE = 1e-11
# The free dome is one with a contact of this radius, relative to μ h/p.
_POINT = 1e-9
# Smallest strain of the apex, over the largest, that is computed; below it extrapolation is exact.
_FLAT = 3e-3
# Without a maximum of P, the coordinate x of domes is made as if one were at this times ``end``.
_BEYOND = 1.005
# Nodes of the free dome, and of pressed domes over x and along lines.
_FREE, _STRAINS, _LINES = 64, 48, 48
# Smallest x of these, over the largest, and ends of the lines: nearly free, and nearly flat.
_LOW, _SPAN = 0.02, (3e-3, 0.9999)
# Rows and columns of the table of pressed domes: x, and s.
_ROWS, _CONTACTS = 512, 512
# Least ``F/(p π r²)`` at which the angle at the rim is looked up: it differs from that of the free
# dome by less than rounding.
_LEAST = 1e-18
# With an edge: largest strain of the apex, states that are integrated, and places between them.
_HIGH, _STATES, _PLACES = 2.2, 97, 4001
# Places along a line between which its spline over s is made.
_FINE = 800


def inflate_rubber(pad: Pad, pressure: Floats) -> Inflated:
    """Compute the free dome of a pad of a material, as :func:`ros_pad.contact.inflate` does.

    ``sphere_radius`` is that of the cap through rim and apex; the dome itself is no sphere.
    """
    domes, unit = _of(pad)
    rows = np.ravel(pressure)
    code = _past_end(pad, rows)
    if np.ndim(pressure) == 0 and code[0] != OK:
        why = refusal(pad)[int(code[0])]
        raise NoEquilibrium(f'pressure = {pressure:g} Pa on {pad}: {why}', str(STATUS[code[0]]))
    inside = np.where(code == OK, rows, np.nan) if code.any() else rows
    height, volume = np.empty((2, rows.size))
    for start in range(0, rows.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        height[part], volume[part] = domes.free(inside[part] / unit)
    with np.errstate(divide='ignore'):  # a flat pad has an infinite radius
        sphere = 0.5 * pad.radius * (height + 1.0 / height)
    height, sphere, volume = (
        each.reshape(np.shape(pressure))
        for each in (pad.radius * height, sphere, pad.radius**3 * volume)
    )
    if np.ndim(pressure) == 0:
        return Inflated(float(height), float(sphere), float(volume), 'ok')
    return Inflated(height, sphere, volume, words(code.reshape(np.shape(pressure))))


def press_rubber(pad: Pad, pressure: Array, force: Array) -> tuple[Array, Codes]:
    """Return the lengths of pressed domes over the radius as rows, and the status codes.

    As :func:`ros_pad.contact.press` with one-dimensional pressures, Pa, and forces, N.
    """
    domes, unit = _of(pad)
    if isinstance(domes, ThickDomes) and force.any():
        raise InvalidInput(
            f'force = {force.max():g} N on {pad} is not allowed: the correction for thickness is'
            ' known for free domes only; 0 N, or a pad without edge, is needed'
        )
    whole = pressure * (math.pi * pad.radius**2)
    code = np.where(force > 0.0, OK, NO_CONTACT).astype(np.int8)
    code[force >= whole] = FLATTENED
    past = _past_end(pad, pressure)
    code[past != OK] = past[past != OK]
    lengths = np.full((5, code.size), np.nan)
    free = np.flatnonzero(code == NO_CONTACT)
    if free.size:
        height, _ = domes.free(pressure[free] / unit)
        none = np.zeros_like(height)
        lengths[:, free] = height, none, none, 0.5 * (height + 1.0 / height), height
    rows = np.flatnonzero(code == OK)
    for start in range(0, rows.size, _CHUNK):
        part = rows[start : start + _CHUNK]
        p, f, most = pressure[part], force[part], whole[part]
        share, rest = f / most, (most - f) / most
        assert isinstance(domes, Domes)
        lengths[:, part] = cap_through(domes.gap(p / unit, share, rest), share, rest)
    return lengths, code


def rim_angle(pad: Pad, pressure: Array, force: Array) -> Array:
    """Return the angle of the wall at the rim, rad, as :func:`press_rubber` takes its input.

    Pressures are up to the end of the pad's model; 0 where the dome is flattened.
    """
    domes, unit = _of(pad)
    assert isinstance(domes, Domes)
    whole = pressure * (math.pi * pad.radius**2)
    least = _LEAST * whole
    angle = np.zeros_like(pressure)
    for rows in np.split(np.arange(pressure.size), range(_CHUNK, pressure.size, _CHUNK)):
        rows = rows[force[rows] < whole[rows]]
        p, f, most = pressure[rows], np.maximum(force, least)[rows], whole[rows]
        angle[rows] = domes.rim(p / unit, f / most)
    return angle


def pressure_end(pad: Pad) -> tuple[float, str]:
    """Return the largest pressure of a pad of a material, Pa, and the status above it."""
    domes, unit = _of(pad)
    if isinstance(domes, ThickDomes):
        return domes.end * unit, domes.status
    known = pad.material.range_end  # type: ignore[union-attr]
    end = domes.pressure_at(known)
    balloons = domes.balloons and end == domes.end
    return end * unit, str(STATUS[NO_INFLATION if balloons else OUT_OF_RANGE])


def pressure_for_height(pad: Pad, height: Array) -> Array:
    """Return the pressures, Pa, at which free domes of a pad of a material have these heights.

    Parameters
    ----------
    pad : Pad
        A pad of a material.
    height : array
        Heights, m, above 0.

    Raises
    ------
    InvalidInput
        When a height is above the largest one.
    """
    end, status = pressure_end(pad)
    highest = highest_dome(pad)
    if (height > highest).any():
        why = (
            'there it balloons'
            if status == 'no_inflation'
            else f'there its range ends, a uniaxial stretch of {pad.material.uniaxial_end:.4g}'  # type: ignore[union-attr]
        )
        raise InvalidInput(
            f'height = {height.max():g} m of a free dome is not allowed on {pad}: at most'
            f' {highest:.6g} m, at {end:.6g} Pa, is allowed; {why}'
        )
    low, high = np.zeros_like(height), np.full_like(height, end)
    for _ in range(60):
        middle = 0.5 * (low + high)
        short = inflate_rubber(pad, middle).height < height
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.asarray(0.5 * (low + high))


def highest_dome(pad: Pad) -> float:
    """Return the height of the highest free dome of a pad of a material, m."""
    return float(inflate_rubber(pad, pressure_end(pad)[0]).height)


def refusal(pad: Pad) -> dict[int, str]:
    """Return why a pad of a material is refused, by status code."""
    end = pressure_end(pad)[0]
    known = f'a uniaxial stretch of {pad.material.uniaxial_end:.4g}'  # type: ignore[union-attr]
    if pad.edge is not None:
        known += f', or rise above {HIGHEST[pad.edge]:g} radii, the highest in the correction'
    return {
        NO_INFLATION: (
            f'it would balloon: the pressure has its maximum at {end:.6g} Pa, and at most that is'
            ' allowed'
        ),
        OUT_OF_RANGE: (
            f'the dome would stretch the material beyond its range, {known}: at most'
            f' {end:.6g} Pa is allowed'
        ),
    }


def _of(pad: Pad) -> tuple[Domes | ThickDomes, float]:
    """Return the domes of a pad's law, prepared once, and the unit ``μ h/r`` of its pressure."""
    material, unit = pad.material, pad.stiffness / pad.radius
    assert material is not None and pad.thickness is not None
    if pad.edge is not None:
        ratio = pad.thickness / pad.radius
        return _thick(material.unit_law, material.range_end, ratio, pad.edge), unit
    return _prepared(material.unit_law, material.stable_end), unit


@functools.lru_cache(maxsize=64)
def _prepared(law: Law, most: float) -> Domes:
    return Domes(law, most)


@functools.lru_cache(maxsize=64)
def _thick(law: Law, most: float, ratio: float, edge: str) -> ThickDomes:
    return ThickDomes(law, most, ratio, edge)


def _past_end(pad: Pad, pressure: Array) -> Codes:
    end, status = pressure_end(pad)
    return (pressure > end) * np.int8(STATUS.tolist().index(status))


class Shapes(NamedTuple):
    """States of the membrane in units of the pad's radius.

    Attributes
    ----------
    pressure : array
        ``P = p r/(μ h)``.
    contact, rest : array
        Contact radius b, and 1 - b without cancellation.
    gap : array
        Distance from pad base to floor: the height of a free dome.
    volume : array
        Volume under the membrane.
    rim : array
        Angle of the wall at the rim, rad.
    """

    pressure: Array
    contact: Array
    rest: Array
    gap: Array
    volume: Array
    rim: Array


def shapes(law: Law, strain: Array, disc: Array, tolerance: float = _TOLERANCE) -> Shapes:
    """Integrate the membrane from the disc in contact to the rim.

    Parameters
    ----------
    law : tuple
        From :attr:`Material.unit_law`.
    strain : array
        Stretch of the disc, less 1, above 0.
    disc : array
        Undeformed radius of the disc over ``μ h/p``, above 0.
    tolerance : float
        Relative tolerance.

    Notes
    -----
    The states are integrated together. At first the speed along the meridian is proportional to
    λ2 - 1, so that no wall runs past its rim, and to the angle, in which small contacts are
    resolved. When all are close to the rim, λ2 becomes the variable, which ends at 1 exactly.
    """
    from scipy.integrate import solve_ivp

    if strain.size > _TOGETHER:
        parts = math.ceil(strain.size / _TOGETHER)
        pairs = zip(np.array_split(strain, parts), np.array_split(disc, parts), strict=True)
        found = [shapes(law, *pair, tolerance) for pair in pairs]
        return Shapes(*(np.concatenate(each) for each in zip(*found, strict=True)))
    count = itertools.count()
    stretch = 1.0 + strain
    start = disc * stretch**2 / tensions(law, np.log(stretch), np.log(stretch))[0]
    start = start / (2.0 + start)  # angle at which the wall has left the contact

    def rates(angle: Array, run: Array, along: Array, across: Array) -> tuple[Array, ...]:
        """Return the rates of R, λ1, λ2, z and V over the angle."""
        if next(count) > _EVALUATIONS:
            raise InvalidInput(
                f'the law {law[0]} {law[1]} (over its shear modulus) is too steep to be'
                ' integrated: a smaller largest_stretch is needed'
            )
        pull, push, more, cross = tensions(law, np.log1p(along), np.log1p(across))
        one, two = 1.0 + along, 1.0 + across
        flat, sine, drop = disc + run, np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
        d_run = pull / two / (one - push * sine / (two * flat))
        d_across = (along - across - one * drop) / flat * d_run
        d_along = ((push - pull - push * drop) / flat * d_run - cross * d_across) / more
        d_height = one * sine * d_run
        return d_run, d_along, d_across, d_height, (two * flat) ** 2 * d_height

    def leave(time: float, state: Array) -> Array:
        angle, run, along, across, *_ = state.reshape(6, -1)
        speed = (angle + start) * (across / strain)
        return np.concatenate([speed, *(speed * d for d in rates(angle, run, along, across))])

    zero = np.zeros_like(strain)
    state = np.concatenate([zero, zero, strain, strain, zero, zero])
    root = np.sqrt(strain)
    scale = tolerance * np.concatenate([root, root, strain, strain, strain, strain**2])
    options: dict[str, Any] = {'method': 'DOP853', 'rtol': tolerance, 'atol': scale}
    end = 5.0 - math.log(start.min())
    state = solve_ivp(leave, (0.0, end), state, t_eval=[end], **options).y[:, -1]
    left = state.reshape(6, -1)[3].copy()

    def arrive(share: float, state: Array) -> Array:
        angle, run, along, *_ = state.reshape(6, -1)
        d_run, d_along, d_across, *rest = rates(angle, run, along, left * (1.0 - share))
        speed = -left / d_across
        return np.concatenate(
            [speed, speed * d_run, speed * d_along, -left] + [speed * d for d in rest]
        )

    state = solve_ivp(arrive, (0.0, 1.0), state, t_eval=[1.0], **options).y[:, -1]
    angle, run, _, _, height, volume = state.reshape(6, -1)
    rim = disc + run
    return Shapes(
        rim,
        stretch * disc / rim,
        (run - strain * disc) / rim,
        height / rim,
        math.pi * volume / rim**3,
        angle,
    )


class Domes:
    """All domes of a law.

    Parameters
    ----------
    law : tuple
        From :attr:`Material.unit_law`.
    most : float
        Equibiaxial strain of the apex up to which domes are computed.

    Attributes
    ----------
    end : float
        Largest ``P = p r/(μ h)`` of a free dome.
    balloons : bool
        Whether the pressure has its maximum there; else only ``most`` is reached.
    """

    def __init__(self, law: Law, most: float) -> None:
        self._law = law
        strain = _nodes(_FLAT * most, most, _FREE)
        pressure = shapes(law, strain, np.full_like(strain, _POINT)).pressure
        falls = np.flatnonzero(~(np.diff(pressure) > 0.0))
        self.balloons = falls.size > 0
        low = top = most
        if self.balloons:
            low, top = strain[max(falls[0] - 1, 0)], strain[falls[0] + 1]
        strain = _nodes(_FLAT * top, top, _FREE)
        free = shapes(law, strain, np.full_like(strain, _POINT))
        span = (_FLAT * top, top)
        # P^(2/3), height² and volume² are analytic in the strain and begin in proportion to it.
        self._push = push = _series(np.cbrt(free.pressure) ** 2 / strain, span)
        self._most = top
        if self.balloons:
            from scipy.optimize import brentq

            slope = push.deriv()
            self._most = brentq(lambda e: push(e) + e * slope(e), low, top, xtol=1e-14)
        self.end = self.pressure_at(self._most)
        self._turn = self.end if self.balloons else _BEYOND * self.end
        self._free = self._spline(strain, span, free)

    def pressure_at(self, strain: float) -> float:
        """Return P at a strain of the apex; above the largest one, that of the largest."""
        strain = min(strain, self._most)
        return float((strain * self._push(strain)) ** 1.5)

    def free(self, pressure: Array) -> tuple[Array, Array]:
        """Return height and volume of free domes, for P from 0 to ``end``."""
        x = self._coordinate(pressure)
        ratios = self._free(x)
        return x * ratios[..., 0], x * ratios[..., 1]

    def gap(self, pressure: Array, share: Array, rest: Array) -> Array:
        """Return gap over radius of pressed domes.

        Parameters
        ----------
        pressure : array
            ``P``, above 0 and below ``end``, one-dimensional.
        share, rest : array
            ``F/(p π r²)`` and 1 less that, both above 0.
        """
        angle = self._at(self._pressed[1], pressure, share)
        return rest / (1.0 + np.sqrt(share)) * np.tan(0.5 * angle)

    def rim(self, pressure: Array, share: Array) -> Array:
        """Return the angle of the wall at the rim, rad, of pressed domes."""
        return self._at(self._rims, pressure, share)

    def _at(self, table: Array, pressure: Array, share: Array) -> Array:
        """Return the value of a table at P and ``F/(p π r²)``."""
        pushes, _, starts, first, step = self._pressed
        contact = np.sqrt(share)
        place = (np.sqrt(contact) - first) / step
        row = np.rint(self._coordinate(pressure) * ((_ROWS - 1) / self._last)).astype(np.intp)
        column = np.rint(place).astype(np.intp)
        start = starts[row * _CONTACTS + np.clip(column, 0, _CONTACTS - 1)]
        low = np.clip(start.astype(np.intp) - 1, 0, _ROWS - 4)
        left = np.clip(place.astype(np.intp) - 1, 0, _CONTACTS - 4)
        corner, weights = low * _CONTACTS + left, _weights(place - left)
        x = _root(_across(pushes, corner, weights), np.cbrt(pressure), start - low)
        return _sum(_across(table, corner, weights), _weights(x))

    def _coordinate(self, pressure: Array) -> Array:
        """Return x, in which domes are analytic both where P is small and at a maximum of P."""
        share = pressure / self._turn
        return np.cbrt(share / (1.0 + np.sqrt(np.maximum(1.0 - share, 0.0))))

    def _spline(self, strain: Array, span: tuple[float, float], free: Shapes) -> Any:
        """Return the spline of height/x, volume/x and strain/x² over x."""
        from scipy.interpolate import CubicSpline

        self._last = float(self._coordinate(np.array(self.end)))
        x = np.linspace(0.0, self._last, 2049)[1:]
        aim = np.cbrt(self._turn * x**3 * (2.0 - x**3)) ** 2
        low, high = np.zeros_like(x), np.full_like(x, self._most)
        for _ in range(60):
            middle = 0.5 * (low + high)
            under = middle * self._push(middle) < aim
            low, high = np.where(under, middle, low), np.where(under, high, middle)
        e = np.where(x < 0.5, aim / self._push(high), high)
        height, volume = (_series(each / np.sqrt(strain), span)(e) for each in free[3:5])
        root = np.sqrt(e) / x
        return CubicSpline(x, np.stack([root * height, root * volume, root * root], axis=1))

    @functools.cached_property
    def _pressed(self) -> tuple[Array, Array, Array, float, float]:
        """Tables of ``P^(1/3)`` and ψ over x and s, start values, first s and step of s."""
        _, states, _, kept = self._states
        angle = 2.0 * np.arctan2(states.gap, states.rest)
        push, angle = self._tables(np.cbrt(states.pressure), angle)
        x = np.linspace(0.0, self._last, _ROWS)
        even = np.cbrt(self._turn * x**3 * (2.0 - x**3))
        starts = np.array(
            [np.interp(even, np.maximum.accumulate(each), np.arange(_ROWS)) for each in push.T]
        ).T
        return (
            push.ravel(),
            angle.ravel(),
            starts.ravel(),
            float(kept[0]),
            float(kept[1] - kept[0]),
        )

    @functools.cached_property
    def _rims(self) -> Array:
        """Table of the angle at the rim over x and s."""
        (table,) = self._tables(self._states[1].rim)
        return table.ravel()

    @functools.cached_property
    def _states(self) -> tuple[Array, Shapes, Array, Array]:
        """Given x, states over x and lines, s over finer x and lines, and the s of the tables."""
        lines, given = _nodes(*_SPAN, _LINES), _nodes(_LOW, 1.0, _STRAINS) * self._last
        states = self._on_lines(given, self._reach(lines), lines, _TOLERANCE)
        place = _finer(np.sqrt(states.contact))
        if not (np.diff(place, axis=1) > 0.0).all():
            raise InvalidInput(
                f'pressed domes of the law {self._law[0]} {self._law[1]} (over its shear modulus)'
                ' are not known: at large stretch their shape depends on the history of the load;'
                ' a smaller largest_stretch may help if it is above 5'
            )
        kept = np.linspace(place[:, 0].max(), place[:, -1].min(), _CONTACTS)
        return given, states, place, kept

    def _tables(self, *fields: Array) -> Array:
        """Return tables over x and s of fields that are in proportion to x where it is small."""
        from scipy.interpolate import CubicSpline

        given, _, place, kept = self._states
        finer = np.stack([_finer(each / given[:, None]) for each in fields], axis=-1)
        rows = [CubicSpline(*pair)(kept) for pair in zip(place, finer, strict=True)]
        x = np.linspace(0.0, self._last, _ROWS)
        return np.moveaxis(x[:, None, None] * np.array(rows), -1, 0)

    def _reach(self, lines: Array) -> Array:
        """Return the factors on the line of largest x with which P is just above ``end``."""
        shares = np.linspace(0.4, 1.02, 32)
        coarse = _nodes(0.15, _SPAN[1], 20)
        guess = ((1.0 - coarse) ** 1.5 + coarse**2) ** (-2.0 / 3.0)
        last = np.full_like(shares, self._last)
        states = self._on_lines(last, shares[:, None] * guess, coarse, 1e-7)
        reached = np.ones_like(coarse)
        for k, pressure in enumerate(states.pressure.T):
            over = np.flatnonzero(pressure > self.end)
            if over.size:
                reached[k] = np.interp(self.end, pressure[: over[0] + 1], shares[: over[0] + 1])
        # Domes with a small contact need no more than the free one does.
        at, reached = np.append(coarse, (0.0, 0.0)), np.append(reached * guess, (1.0, 1.0))
        curve = np.polynomial.chebyshev.Chebyshev.fit(at, reached, 6)
        return curve(lines) + np.max(reached - curve(at)) + 0.005

    def _on_lines(self, x: Array, reach: Array, lines: Array, tolerance: float) -> Shapes:
        """Return states on lines (columns) from the free domes of x (rows) to flat ones."""
        strain = (self._free(x)[:, 2] * x**2)[:, None] * reach * (1.0 - lines)
        disc = (self._turn * x**3 * (2.0 - x**3))[:, None] * reach**1.5 * lines**2
        states = shapes(self._law, strain.ravel(), disc.ravel(), tolerance)
        return Shapes(*(each.reshape(strain.shape) for each in states))


class ThickDomes:
    """Free domes of one law, thickness and edge (:mod:`ros_pad.contact.thickness`).

    Attributes
    ----------
    end : float
        Largest ``P = p r/(μ h)``.
    status : str
        That of pressures above it: ``no_inflation`` at a maximum of P.
    """

    def __init__(self, law: Law, most: float, ratio: float, edge: str) -> None:
        from scipy.interpolate import CubicSpline

        root = np.linspace(0.0, math.sqrt(min(most, _HIGH)), _STATES)[1:]
        found = shapes(law, root**2, np.full_like(root, _POINT))
        # P^(1/3), height and volume begin in proportion to the root of the strain.
        parts = np.cbrt(found.pressure), found.gap, found.volume
        fine = np.linspace(0.0, root[-1], _PLACES)
        push, height, volume = CubicSpline(
            np.append(0.0, root), np.vstack([np.zeros(3), np.stack(parts, axis=1)])
        )(fine).T
        membrane = push**3, height, volume
        states = np.array(thickened(edge, ratio, law[1], fine**2, membrane))
        beyond = states[1] > HIGHEST[edge]
        end = int(np.argmax(beyond)) if beyond.any() else fine.size
        falls = np.diff(states[0, :end]) <= 0.0
        self.status = str(STATUS[NO_INFLATION if falls.any() else OUT_OF_RANGE])
        self._states = states[:, : int(np.argmax(falls)) + 1 if falls.any() else end]
        self.end = float(self._states[0, -1])

    def free(self, pressure: Array) -> tuple[Array, Array]:
        """Return height of the outer face and volume of free domes, for P from 0 to ``end``."""
        known, height, volume = self._states
        return np.interp(pressure, known, height), np.interp(pressure, known, volume)


def _nodes(low: float, high: float, count: int) -> Array:
    """Return the zeros of a Chebyshev polynomial on an interval, rising."""
    return low + (high - low) * 0.5 * (1.0 + np.polynomial.chebyshev.chebpts1(count))


def _unit(x: Array, span: tuple[float, float]) -> Array:
    """Return the place of x in an interval, from -1 to 1."""
    return (2.0 * x - span[0] - span[1]) / (span[1] - span[0])


def _fit(values: Array) -> Array:
    """Return the coefficients of the polynomials through the columns of values at `_nodes`."""
    count = len(values)
    basis = np.polynomial.chebyshev.chebvander(np.polynomial.chebyshev.chebpts1(count), count - 1)
    return np.asarray(np.linalg.solve(basis, values), dtype=np.float64)


def _finer(values: Array) -> Array:
    """Return a field at the nodes of x and lines on the finer grid of the tables."""
    to_rows = np.polynomial.chebyshev.chebvander(
        _unit(np.linspace(0.0, 1.0, _ROWS), (_LOW, 1.0)), _STRAINS - 1
    )
    to_fine = np.polynomial.chebyshev.chebvander(
        _unit(np.linspace(*_SPAN, _FINE), _SPAN), _LINES - 1
    )
    return np.asarray(to_rows @ _fit((to_fine @ _fit(values.T)).T))


def _series(values: Array, span: tuple[float, float]) -> Any:
    return np.polynomial.chebyshev.Chebyshev(_fit(values), span)


def _weights(x: Array) -> tuple[Array, Array, Array, Array]:
    """Return the weights of nodes 0 to 3 in the cubic interpolation at x."""
    one, two, three = x - 1.0, x - 2.0, x - 3.0
    near, far = x * one, two * three
    return one * far / -6.0, x * far * 0.5, near * three * -0.5, near * two / 6.0


def _sum(values: list[Array], weights: tuple[Array, ...]) -> Array:
    total = values[0] * weights[0]
    for value, weight in zip(values[1:], weights[1:], strict=True):
        total += value * weight
    return total


def _across(table: Array, corner: Any, weights: tuple[Array, ...]) -> list[Array]:
    """Return four rows of a table from a corner on, each interpolated over the columns."""
    return [
        _sum([table[corner + (row * _CONTACTS + k)] for k in range(4)], weights)
        for row in range(4)
    ]


def _root(values: list[Array], aim: Array, x: Array) -> Array:
    """Return where the cubic through values at 0, 1, 2, 3 reaches an aim, by Newton's method."""
    zero, one, two, three = values
    first = one - zero
    second = 0.5 * (two - one - first)
    third = (three - two - (two - one) - 2.0 * second) / 6.0
    # Powers of x, from the differences.
    c1, c2 = first - second + 2.0 * third, second - 3.0 * third
    zero = zero - aim
    for _ in range(6):
        x = x - (zero + x * (c1 + x * (c2 + x * third))) / (c1 + x * (2.0 * c2 + 3.0 * x * third))
    return x

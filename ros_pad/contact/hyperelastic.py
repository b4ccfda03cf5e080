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

from ros_pad.configuration import quantity
from ros_pad.contact.dome import (
    FLATTENED,
    NO_CONTACT,
    NO_INFLATION,
    OK,
    OUT_OF_RANGE,
    STATUS,
    Codes,
    Solved,
)
from ros_pad.contact.material import tensions
from ros_pad.contact.membrane import cap_through
from ros_pad.contact.pad import Array, Pad
from ros_pad.contact.roots import rising_root
from ros_pad.errors import InvalidInput

Law = tuple[str, tuple[float, ...]]

# Relative tolerance of the integration.
_TOLERANCE = 1e-11
# The free dome is one with a contact of this radius, relative to μ h/p.
_POINT = 1e-9
# Smallest strain of the apex, over the largest, that is computed; below it extrapolation is exact.
_FLAT = 3e-3
# Nodes of the free dome, and of pressed domes over x and along lines.
_FREE, _STRAINS, _LINES = 64, 48, 48
# Smallest x of these, over the largest, and ends of the lines: nearly free, and nearly flat.
_LOW, _SPAN = 0.02, (3e-3, 0.9999)
# Rows and columns of the table of pressed domes: x, and s.
_ROWS, _CONTACTS = 512, 512


def inflate_rubber(pad: Pad, pressure: Array) -> Solved:
    """Compute free domes, as :func:`ros_pad.contact.inflate` with one-dimensional pressures, Pa.

    The radius of the sphere is that of the cap through rim and apex; the dome itself is no sphere.
    """
    domes, unit = _of(pad)
    code, most = _past_end(pad, pressure)
    height, volume = domes.free(np.where(code == OK, pressure, np.nan) / unit)
    r = pad.radius
    return np.stack([r * height, r * _sphere(height), r**3 * volume]), code, most


def press_rubber(pad: Pad, pressure: Array, force: Array) -> Solved:
    """Return the lengths of pressed domes over the radius as rows, and the status codes.

    As :func:`ros_pad.contact.press` with one-dimensional pressures, Pa, and forces, N.
    """
    domes, unit = _of(pad)
    whole = pressure * (math.pi * pad.radius**2)
    past, most = _past_end(pad, pressure)
    code = np.where(force > 0.0, OK, NO_CONTACT).astype(np.int8)
    code[force >= whole] = FLATTENED
    code[past != OK] = past[past != OK]
    lengths = np.full((5, code.size), np.nan)
    free, rows = code == NO_CONTACT, code == OK
    if free.any():
        height, _ = domes.free(pressure[free] / unit)
        lengths[:, free] = height, 0.0 * height, 0.0 * height, _sphere(height), height
    if rows.any():
        share, rest = force[rows] / whole[rows], (whole - force)[rows] / whole[rows]
        gap = domes.gap(pressure[rows] / unit, share, rest)
        lengths[:, rows] = cap_through(gap, share, rest)
    return lengths, code, most | {FLATTENED: float(whole[0])}


def _sphere(height: Array) -> Array:
    """Return the radius of the sphere of a cap, infinite for a flat pad."""
    with np.errstate(divide='ignore'):
        return 0.5 * (height + 1.0 / height)


def pressure_end(pad: Pad) -> tuple[float, str]:
    """Return the largest pressure of a pad of a material, Pa, and the status above it."""
    domes, unit = _of(pad)
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
    quantity('height', height, 'm', high=highest_dome(pad))
    end = np.full_like(height, pressure_end(pad)[0])

    def excess(root: Array) -> Array:
        return _height(pad, np.minimum(root**3, end)) - height

    return np.minimum(rising_root(excess, 0.0 * end, np.cbrt(end)) ** 3, end)


def highest_dome(pad: Pad) -> float:
    """Return the height of the highest free dome of a pad of a material, m."""
    return float(_height(pad, np.array([pressure_end(pad)[0]]))[0])


def _height(pad: Pad, pressure: Array) -> Array:
    return np.asarray(inflate_rubber(pad, pressure)[0][0])


def _of(pad: Pad) -> tuple[Domes, float]:
    """Return the domes of a pad's law, prepared once, and the unit ``μ h/r`` of its pressure."""
    assert pad.material is not None
    return _prepared(pad.material.unit_law, pad.material.stable_end), pad.stiffness / pad.radius


@functools.lru_cache(maxsize=64)
def _prepared(law: Law, most: float) -> Domes:
    return Domes(law, most)


def _past_end(pad: Pad, pressure: Array) -> tuple[Codes, dict[int, float]]:
    end, status = pressure_end(pad)
    code = STATUS.tolist().index(status)
    return (pressure > end) * np.int8(code), {code: end}


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
    """

    pressure: Array
    contact: Array
    rest: Array
    gap: Array
    volume: Array


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

    if strain.size > 1000:  # BLAS would start threads for each step
        parts = math.ceil(strain.size / 1000)
        pairs = zip(np.array_split(strain, parts), np.array_split(disc, parts), strict=True)
        found = [shapes(law, *pair, tolerance) for pair in pairs]
        return Shapes(*(np.concatenate(each) for each in zip(*found, strict=True)))
    count = itertools.count()
    stretch = 1.0 + strain
    start = disc * stretch**2 / tensions(law, np.log(stretch), np.log(stretch))[0]
    start = start / (2.0 + start)  # angle at which the wall has left the contact

    def rates(angle: Array, run: Array, along: Array, across: Array) -> tuple[Array, ...]:
        """Return the rates of R, λ1, λ2, z and V over the angle."""
        if next(count) > 20000:  # usual are 2,000
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

    state = np.outer([0.0, 0.0, 1.0, 1.0, 0.0, 0.0], strain).ravel()
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
    _, run, _, _, height, volume = state.reshape(6, -1)
    rim = disc + run
    return Shapes(
        rim,
        stretch * disc / rim,
        (run - strain * disc) / rim,
        height / rim,
        math.pi * volume / rim**3,
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
        # Without a maximum of P, x is made as if one were slightly past the end.
        self._turn = self.end if self.balloons else 1.005 * self.end
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
        push, angle = self._pressed
        place, aim = np.sqrt(np.sqrt(share)), np.cbrt(pressure)
        none = np.zeros_like(aim)
        x = rising_root(lambda x: push(x, place) - aim, none, none + self._last)
        return rest / (1.0 + np.sqrt(share)) * np.tan(0.5 * angle(x, place))

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
        high = rising_root(lambda e: e * self._push(e) - aim, 0.0 * x, 0.0 * x + self._most)
        e = np.where(x < 0.5, aim / self._push(high), high)
        height, volume = (_series(each / np.sqrt(strain), span)(e) for each in free[3:5])
        root = np.sqrt(e) / x
        return CubicSpline(x, np.stack([root * height, root * volume, root * root], axis=1))

    @functools.cached_property
    def _pressed(self) -> tuple[Any, Any]:
        """Splines of ``P^(1/3)`` and ψ over x and s."""
        from scipy.interpolate import CubicSpline, RectBivariateSpline

        lines, given = _nodes(*_SPAN, _LINES), _nodes(_LOW, 1.0, _STRAINS) * self._last
        states = self._on_lines(given, self._reach(lines), lines, _TOLERANCE)
        place = _finer(np.sqrt(states.contact))
        if not (np.diff(place, axis=1) > 0.0).all():
            raise InvalidInput(
                f'pressed domes of the law {self._law[0]} {self._law[1]} (over its shear modulus)'
                ' are not known: at large stretch their shape depends on the history of the load;'
                ' a smaller largest_stretch may help if it is above 5'
            )
        x, kept = np.linspace(0.0, self._last, _ROWS), np.linspace(0.0, 1.0, _CONTACTS)
        found = []
        for field in (np.cbrt(states.pressure), 2.0 * np.arctan2(states.gap, states.rest)):
            rows = zip(place, _finer(field / given[:, None]), strict=True)  # in proportion to x
            table = np.array([CubicSpline(*pair)(kept) for pair in rows])
            found.append(RectBivariateSpline(x, kept, x[:, None] * table).ev)
        return found[0], found[1]

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
        _unit(np.linspace(*_SPAN, 800), _SPAN), _LINES - 1
    )
    return np.asarray(to_rows @ _fit((to_fine @ _fit(values.T)).T))


def _series(values: Array, span: tuple[float, float]) -> Any:
    return np.polynomial.chebyshev.Chebyshev(_fit(values), span)

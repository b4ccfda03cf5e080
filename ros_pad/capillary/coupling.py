# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of an inflated pad and the meniscus around it on a wet floor.

The pad is the exact membrane of :mod:`ros_pad.contact.membrane`, whose tension T follows from its
whole area. The liquid is the wide bath of :mod:`ros_pad.capillary.bath`. It acts on the membrane
in three ways: its suction ``ρ g z`` adds to the pressure inside, wetting lowers the tension of the
wet part to ``T - γ cos θ``, and its surface bends the membrane at the contact line. There the
three tensions are in balance (Neumann's triangle). For T much larger than γ, the angle between wet
wall and surface is the contact angle on a rigid wall.

With arc length s from the edge of the contact disc, where the membrane leaves the floor at a
tangent, inclination φ and tension τ: ``dφ/ds = (p + ρ g z)/τ - sin φ / r`` in the wet part and
``dφ/ds = p/T - sin φ / r`` in the dry part. The unknowns are the contact radius b, T, the length
of the wall and the place of the contact line. The equations: the wall ends at the rim; T belongs
to the area; load and capillary force press the disc, ``F + F_cap = p π b²``; the surface of the
bath has the height of the contact line. As without liquid, the membrane has no adhesion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad.capillary.bath import Wall, bath_height, contact
from ros_pad.configuration import instance, number
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import Array, Pad, need_stiffness
from ros_pad.errors import NoSurface


@dataclass(frozen=True)
class WetPad:
    """A pad in liquid.

    Attributes
    ----------
    gap : float
        Distance from pad base to floor, m.
    contact_radius : float
        Radius of the contact with the floor, m.
    tension : float
        Tension of the dry part of the membrane, N/m.
    height : float
        Height of the contact line above the floor, m.
    kink : float
        Angle by which the membrane bends outwards at the contact line, rad.
    rim_angle : float
        Inclination of the membrane at the rim, rad; above pi/2 it leans inwards.
    force : float
        Vertical force of the liquid on the pad, N, positive towards the floor.
    rigid : WetPad or None
        The same pad without the effect of the liquid on its shape; None in that pad itself.
    """

    gap: float
    contact_radius: float
    tension: float
    height: float
    kink: float
    rim_angle: float
    force: float
    rigid: WetPad | None


def press_wet(pad: Pad, pressure: float, force: float, liquid: Liquid) -> WetPad:
    """Compute a pad that is pressed on a floor with a wide bath at floor level.

    Parameters
    ----------
    pad : Pad
        Size and material. Its adhesion energy is not used.
    pressure : float
        Gauge pressure in the pad, Pa, above 0.
    force : float
        Normal force on the pad, N, above 0, without the force of the liquid.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.

    Returns
    -------
    WetPad
        Gap, contact radius and height, m, tension, N/m, force, N, beside those of the dry shape,
        ``rigid``.

    Raises
    ------
    NoEquilibrium
        Where the dry pad has no equilibrium, see :func:`ros_pad.contact.press`.
    NoSurface
        ``rim`` where the liquid reaches the rim of the pad; ``no_convergence`` where no common
        equilibrium was found near that of the rigid pad.
    InvalidInput
        When a value is not finite or out of range.

    Examples
    --------
    By how much the water of a bath lowers a pad:

    >>> from ros_pad.capillary import press_wet
    >>> from ros_pad.contact import LARGE_PAD, WATER
    >>> found = press_wet(LARGE_PAD, pressure=75e3, force=0.1, liquid=WATER)
    >>> assert found.rigid is not None
    >>> f'{100 * (found.gap / found.rigid.gap - 1):.2f} %'
    '-0.06 %'
    """
    instance('liquid', liquid, Liquid)
    need_stiffness('a pad in a bath', pad)
    p = number('pressure', pressure, 'Pa', above=True)
    load = number('force', force, 'N', above=True)
    case = _Case(
        pressure=p * pad.radius / pad.stiffness,
        force=load / (pad.stiffness * pad.radius),
        tension=liquid.surface_tension / pad.stiffness,
        weight=liquid.weight * pad.radius**2 / pad.stiffness,
        angle=liquid.angle,
        length=liquid.capillary_length / pad.radius,
    )
    pressed = press(pad, p, load, model='membrane')
    size = pad.radius
    dry = _dry(case, float(pressed.contact_radius) / size, float(pressed.gap) / size)
    rigid_wall = _meridian(case, dry[0], dry[2], dry[1], 0.0)
    place, slope, _ = contact(_as_wall(rigid_wall), case.angle, case.length)
    if place >= dry[2]:
        raise NoSurface('the liquid reaches the rim of the pad', 'rim')
    rigid = _result(pad, case, (*dry, place), slope, rigid_wall, rigid_wall)
    found = _root(lambda x: _misfit(case, x), (*dry, place), 'pad and liquid')
    wet = _meridian(case, found[0], found[2], found[1] - case.grip, case.weight)
    slope, kink = _joint(case, found[1], float(wet(found[3])[2]))
    angle = math.pi - slope - float(wet(found[3])[2])
    again = contact(_as_wall(wet), angle, case.length)[0]
    if abs(again - found[3]) > 1e-5 * found[2]:
        raise NoSurface(
            'the equilibrium that was found is not the first one that liquid meets when it rises'
            ' from the floor',
            'no_convergence',
        )
    above = _above(case, found, wet, kink)
    return _result(pad, case, found, slope, wet, above, kink, rigid)


class _Case(NamedTuple):
    """Input in units of the pad's radius and stiffness."""

    pressure: float
    force: float
    tension: float  # of the liquid
    weight: float
    angle: float
    length: float  # capillary length

    @property
    def grip(self) -> float:
        """Reduction of the membrane's tension by wetting."""
        return self.tension * math.cos(self.angle)


# SciPy's OdeSolution over arc length: radius, height, inclination, area of disc and wall, and
# volume inside the wall.
Meridian: TypeAlias = Any


def _rates(s: float, state: Array, push: float, weight: float, tension: float) -> list[float]:
    r, z, phi = state[:3]
    sine = math.sin(phi)
    bend = (push + weight * z) / tension - sine / r
    return [math.cos(phi), sine, bend, 2.0 * math.pi * r, math.pi * r * r * sine]


def _meridian(case: _Case, b: float, length: float, tension: float, weight: float) -> Meridian:
    """Integrate the wall from the contact disc upwards, with the same tension everywhere."""

    def steep(s: float, state: Array, *_: float) -> float:
        return float(state[2]) - (math.pi - 0.02)

    steep.terminal = True  # type: ignore[attr-defined]
    disc = b, 0.0, 0.0, math.pi * b * b, 0.0
    return _integrated((0.0, 2.0 * length + 1.0), disc, (case.pressure, weight, tension), steep)


def _above(case: _Case, unknowns: Any, wet: Meridian, kink: float) -> Meridian:
    """Return the dry wall above the contact line, over arc length from the disc."""
    _, tension, length, place = unknowns
    state = np.array(wet(place))
    state[2] += kink
    return _integrated((place, length), state, (case.pressure, 0.0, tension))


def _integrated(span: Any, start: Any, given: tuple[float, float, float], *ends: Any) -> Meridian:
    from scipy.integrate import solve_ivp

    tight = {'rtol': 1e-11, 'atol': 1e-13}
    path = solve_ivp(_rates, span, start, 'DOP853', None, True, ends, args=given, **tight)
    return path.sol


def _as_wall(meridian: Any) -> Wall:
    def at(place: float) -> tuple[float, float, float]:
        r, z, phi = meridian(place)[:3]
        return float(r), float(z), float(phi)

    return Wall(at, 0.0, float(meridian.t_max), 0.0)


def _dry(case: _Case, b: float, gap: float) -> tuple[float, float, float]:
    """Return contact radius, tension and length of the wall without liquid."""

    def misfit(logs: Array) -> list[float]:
        tension, length = np.exp(np.minimum(logs, 5.0))
        path = _meridian(case, b, length, tension, 0.0)
        end = path(min(length, path.t_max))
        return [end[0] - 1.0 + length - min(length, path.t_max), tension - _tension(end[3])]

    # Start from the circular arc that leaves the floor at a tangent.
    turn = 2.0 * math.atan2(gap, 1.0 - b)
    length = turn / math.sin(turn) * (1.0 - b)
    tension = case.pressure * (1.0 - b * b) / (2.0 * math.sin(turn))
    tension, length = np.exp(_root(misfit, np.log([tension, length]), 'the dry pad'))
    return b, float(tension), float(length)


def _tension(area: float) -> float:
    """Return the tension of a membrane of this whole area (thesis 3.41)."""
    return 1.5 * math.sqrt(area / math.pi) - 1.0


def _joint(case: _Case, tension: float, phi: float) -> tuple[float, float]:
    """Return the slope of the surface at the contact line, and the membrane's kink there."""
    wet, liquid = tension - case.grip, case.tension
    cosine = (wet * wet + liquid * liquid - tension * tension) / (2.0 * wet * liquid)
    if wet <= 0.0 or abs(cosine) > 1.0:
        raise NoSurface(
            f'the surface tension, {liquid:.3g} times the stiffness, is too large for a membrane'
            f' tension of {tension:.3g} times the stiffness',
            'no_convergence',
        )
    slope = math.acos(cosine) - phi
    # The tension of the dry membrane balances the other two.
    across = liquid * math.sin(slope + phi)
    along = wet - liquid * math.cos(slope + phi)
    return slope, math.atan2(across, along)


def _pull(case: _Case, state: Array, slope: float) -> float:
    """Return the force of the liquid on the pad: tension at the line and suction below it."""
    r, z, _, _, volume = state
    surface = 2.0 * math.pi * r * case.tension * math.sin(slope)
    return float(surface + case.weight * (math.pi * r * r * z - volume))


def _misfit(case: _Case, x: Array) -> list[float]:
    """Return the residuals of the four equations."""
    b, tension, length, place = x
    if not (0.0 < b < 1.0 and tension > case.grip and 0.0 < place < length):
        raise NoSurface('no equilibrium of pad and liquid was found', 'no_convergence')
    wet = _meridian(case, b, length, tension - case.grip, case.weight)
    line = wet(place)
    slope, kink = _joint(case, tension, float(line[2]))
    end = _above(case, x, wet, kink)(length)
    height = bath_height(line[0] / case.length, slope) * case.length
    disc = math.pi * case.pressure * b * b
    return [
        end[0] - 1.0,
        tension - _tension(end[3]),
        (disc - case.force - _pull(case, line, slope)) / case.force,
        (height - line[1]) / case.length,
    ]


def _root(misfit: Callable[[Array], list[float]], start: Any, what: str) -> tuple[float, ...]:
    """Return the root near a start, by Powell's hybrid of Newton's method."""
    from scipy.optimize import root

    found = root(misfit, start, method='hybr', options={'xtol': 1e-11, 'eps': 1e-8})
    if not np.max(np.abs(found.fun)) < 1e-7:
        raise NoSurface(f'no equilibrium of {what} was found: {found.message}', 'no_convergence')
    return tuple(float(value) for value in found.x)


def _result(
    pad: Pad, case: _Case, unknowns: Any, slope: float, wet: Meridian, above: Meridian,
    kink: float = 0.0, rigid: WetPad | None = None,
) -> WetPad:  # fmt: skip
    b, tension, length, place = unknowns
    size = pad.radius
    line, end = wet(place), above(length)
    unit = pad.stiffness * size
    return WetPad(
        gap=float(end[1]) * size,
        contact_radius=b * size,
        tension=tension * pad.stiffness,
        height=float(line[1]) * size,
        kink=kink,
        rim_angle=float(end[2]),
        force=_pull(case, line, slope) * unit,
        rigid=rigid,
    )

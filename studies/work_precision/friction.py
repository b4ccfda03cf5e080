# SPDX-License-Identifier: Apache-2.0
"""Compute one step of a planar body on frictional feet by several laws of friction.

The unknown is the twist q = (vx, vy, ω) at the end of the step. Each foot at lever arm (rx, ry)
slides over the floor with s = (vx - ω ry + ux, vy + ω rx + uy) and turns on it with ω + w; u and w
are its velocity and turning rate relative to the body by the gait. A step minimises the function

    ½ (q - b)ᵀ M (q - b) + dt Σ φ_i(z_i),     b = twist before the step + dt M⁻¹ applied wrench

which is convex, so the twist is unique. Sliding and turning share the capacity c of a foot by an
ellipsoidal limit surface: the slip is z = (s, ρ (ω + w)), its force (F, T/ρ), and |(F, T/ρ)| <= c.
Howe and Cutkosky (Int. J. Robotics Research 15, 1996, 531) take this ellipsoid through the largest
force and moment for the limit surface of a sliding contact; an evenly pressed disc of radius R has
ρ = 2/3 R. The laws differ in φ, the potential of the foot's friction with cap c:

``elastic``
    The pad shears with stiffness k, and twists with k ρ², up to the cap: φ' = min(K |z|, c) along
    z = slip + e/dt, with e the shear at the start and K = k dt (a Huber function). Feet that stick
    share the load by their stiffness, so that forces are unique too, and there is no creep. The
    default.
``creeping``
    Pseudo-Huber on the slip, φ' = c |z| / √(z² + ε²): fast and smooth, creeps at about ε; sticking
    feet share the load in proportion to their caps.
``exact_stick``
    Rigid-plastic, φ' = c, by projected gradient on impulses in balls of radius c dt: feet stick to
    rounding, and the twist has a bound on its error. This is the reference. The forces of three or
    more sticking feet are not unique; these are the smallest ones, if none is at its cap.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from math import sqrt
from operator import mul

from ros_pad.configuration import number
from ros_pad.simulation.planar_step import Pushed, newton, push

Twist = tuple[float, float, float]
_Row = tuple[float, float, float, float, float]


class Contact:
    """One foot, or a drag, in a step: lever arm, imposed motion, cap, and pad shear.

    All values are in world axes and SI units; the lever arm is from the centre of mass. After a
    step the contact contains the force and the moment on the body, the distance that its middle
    slid over the floor, and the work lost there. A contact with a turning radius of 0 turns on the
    spot freely.
    """

    __slots__ = (
        'cap', 'force_x', 'force_y', 'lever_x', 'lever_y', 'lost', 'moment', 'motion_turn',
        'motion_x', 'motion_y', 'shear_x', 'shear_y', 'slid', 'stiffness', 'turning_radius',
        'twist',
    )  # fmt: skip

    def __init__(self, stiffness: float, turning_radius: float = 0.0) -> None:
        self.stiffness = stiffness
        self.turning_radius = turning_radius
        self.cap = 0.0
        self.lever_x = self.lever_y = 0.0
        self.motion_x = self.motion_y = self.motion_turn = 0.0
        self.shear_x = self.shear_y = self.twist = 0.0
        self.force_x = self.force_y = self.moment = 0.0
        self.slid = self.lost = 0.0

    def slip(self, twist: Twist) -> tuple[float, float]:
        """Return the velocity of the foot over the floor, m/s, at a twist of the body."""
        vx, vy, omega = twist
        return (
            vx - omega * self.lever_y + self.motion_x,
            vy + omega * self.lever_x + self.motion_y,
        )


def elastic(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    start: Twist,
) -> Twist:
    """Step with sheared pads; set each contact's force on the body, N, and shear, m.

    Parameters
    ----------
    free : tuple
        Twist (m/s, m/s, rad/s) that the body would have without the contacts.
    mass, inertia : float
        Mass, kg, and moment of inertia about the vertical, kg m².
    contacts : sequence of Contact
        Contacts; those with a cap of zero are skipped and lose their shear.
    dt : float
        Step, s, above 0.
    start : tuple
        First guess of the twist, for instance that of the last step.

    Returns
    -------
    tuple
        Twist at the end of the step.

    Raises
    ------
    ArithmeticError
        When Newton's method does not converge, as with pads of 1e8 N/m or more.
    InvalidInput
        When the step is not above zero.
    """
    _check(dt)
    holding = [contact for contact in contacts if contact.cap > 0.0]
    pushed: list[Pushed] = [
        (
            c.lever_x, c.lever_y,
            c.motion_x + c.shear_x / dt, c.motion_y + c.shear_y / dt,
            c.motion_turn + c.twist / dt,
            c.turning_radius, c.cap, c.stiffness * dt,
        )
        for c in holding
    ]  # fmt: skip
    vx, vy, turn, settled = newton(free, mass, inertia, pushed, dt, start, 0.0)
    if not settled:
        raise _unsettled(dt, holding)
    for contact in contacts:
        contact.force_x = contact.force_y = contact.moment = contact.slid = contact.lost = 0.0
    for c, each in zip(holding, pushed, strict=True):
        c.force_x, c.force_y, c.moment, c.slid, c.lost = push(vx, vy, turn, each, dt)
    for c in contacts:
        c.shear_x, c.shear_y = -c.force_x / c.stiffness, -c.force_y / c.stiffness
        if c.turning_radius:
            c.twist = -c.moment / (c.stiffness * c.turning_radius * c.turning_radius)
    return vx, vy, turn


def creeping(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    start: Twist,
    creep: float = 1e-5,
) -> Twist:
    """Step with pseudo-Huber friction of creep speed ε, m/s; set each contact's force.

    Arguments and errors are those of :func:`elastic`, but pads do not shear.
    """
    _check(dt)
    pushed: list[Pushed] = [
        (
            c.lever_x, c.lever_y, c.motion_x, c.motion_y, c.motion_turn,
            c.turning_radius, c.cap, c.cap / creep,
        )
        for c in contacts
        if c.cap > 0.0
    ]  # fmt: skip
    vx, vy, turn, settled = newton(free, mass, inertia, pushed, dt, start, creep)
    if not settled:
        raise _unsettled(dt, pushed)
    for contact in contacts:
        sx, sy = contact.slip((vx, vy, turn))
        turned = contact.turning_radius * (turn + contact.motion_turn)
        square = sx * sx + sy * sy + turned * turned
        gain = contact.cap / sqrt(square + creep * creep)
        contact.force_x, contact.force_y = -gain * sx, -gain * sy
        contact.moment = -gain * contact.turning_radius * turned
        contact.slid = math.hypot(sx, sy) * dt
        contact.lost = gain * square * dt
    return vx, vy, turn


def exact_stick(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    tolerance: float = 1e-8,
    sweeps: int = 20000,
) -> Twist:
    """Step with rigid-plastic friction, to a proven accuracy; set each contact's force.

    Parameters
    ----------
    free, mass, inertia, contacts, dt
        As for :func:`elastic`.
    tolerance : float
        Bound on the error of the twist, √(v² + ω² inertia/mass), m/s. Rounding adds up to
        3e-8 √(Σ c dt |z|/mass) + 1.5e-8 Σ c dt/mass, which is less for bodies of a kilogram.
    sweeps : int
        Largest number of sweeps over the contacts.

    Raises
    ------
    ArithmeticError
        When the bound is not met after all sweeps.
    InvalidInput
        When the step is not above zero.

    Notes
    -----
    Projected gradient on all impulses is accelerated, and restarted whenever its last step turns
    back (Nesterov 1983; O'Donoghue and Candès 2015).

    The primal function is strongly convex, so the gap Σ (c dt |z| + p·z) between it and its dual
    bounds the error: ½ mass error² <= gap.
    """
    _check(dt)
    step = RigidStep(free, mass, inertia, contacts, dt, tolerance)
    impulses = _gradient(step, sweeps)
    twist = step.twist(impulses)
    _set_forces(contacts, step, impulses, twist, dt)
    return twist


class RigidStep:
    """A rigid-plastic step: impulses, three a contact, each three in a ball of radius c dt."""

    def __init__(
        self,
        free: Twist,
        mass: float,
        inertia: float,
        contacts: Sequence[Contact],
        dt: float,
        tolerance: float,
    ) -> None:
        self._free, self.mass, self._inertia = free, mass, inertia
        self.holding = [contact for contact in contacts if contact.cap > 0.0]
        self._limits = [contact.cap * dt for contact in self.holding]
        self.rows = [row for each in self.holding for row in _directions(each, mass, inertia)]
        self._at_first = [
            jx * free[0] + jy * free[1] + jw * free[2] + m for jx, jy, jw, m, _ in self.rows
        ]
        self._along = tuple([row[axis] for row in self.rows] for axis in range(3))
        self._allowed = 0.5 * mass * tolerance * tolerance + 1e-16 * sum(self._limits) ** 2 / mass
        self.gap = 0.0

    @property
    def rate(self) -> float:
        """Upper bound of the compliance of all contacts together, for every impulse."""
        rows = self.rows
        return sum(max(row[4] for row in rows[i : i + 3]) for i in range(0, len(rows), 3))

    def blocks(self) -> Iterator[tuple[int, float]]:
        """Yield for each contact its first row and the radius of its ball, N s."""
        return zip(range(0, 3 * len(self._limits), 3), self._limits, strict=True)

    def twist(self, impulses: Sequence[float]) -> Twist:
        """Return the twist after impulses, N s."""
        x, y, turn = (sum(map(mul, along, impulses)) for along in self._along)
        free, mass = self._free, self.mass
        return free[0] + x / mass, free[1] + y / mass, free[2] + turn / self._inertia

    def slips(self, impulses: Sequence[float]) -> list[float]:
        """Return the slip along each row, m/s."""
        vx, vy, turn = self.twist(impulses)
        return [jx * vx + jy * vy + jw * turn + motion for jx, jy, jw, motion, _ in self.rows]

    def in_balls(self, impulses: Sequence[float]) -> list[float]:
        """Return the nearest impulses inside the balls of the contacts."""
        inside = list(impulses)
        for place, limit in self.blocks():
            size = math.hypot(*impulses[place : place + 3])
            if size > limit:
                inside[place : place + 3] = [
                    each * limit / size for each in impulses[place : place + 3]
                ]
        return inside

    def settled(self, impulses: Sequence[float]) -> bool:
        """Return whether the gap between the primal function and its dual is small enough."""
        slip, lost = self.slips(impulses), 0.0
        for place, limit in self.blocks():
            lost += limit * math.hypot(*slip[place : place + 3])
        self.gap = lost + sum(map(mul, impulses, slip))
        return self.gap <= self._allowed + 4e-16 * lost


def _gradient(step: RigidStep, sweeps: int) -> list[float]:
    """Return settled impulses by accelerated projected gradient.

    Raises
    ------
    ArithmeticError
        When they do not settle within ``sweeps``.
    """
    impulses = ahead = [0.0] * len(step.rows)
    age, rate, count = 1.0, step.rate, 0
    while not step.settled(impulses):
        if count >= sweeps:
            error = sqrt(2.0 * step.gap / step.mass)
            raise ArithmeticError(
                f'the error of the twist may still be {error:g} m/s after {sweeps} sweeps: allow'
                ' more sweeps or a larger tolerance'
            )
        count += 1
        last = impulses
        impulses = step.in_balls(
            [p - z / rate for p, z in zip(ahead, step.slips(ahead), strict=True)]
        )
        turned = sum((a - p) * (p - o) for a, p, o in zip(ahead, impulses, last, strict=True))
        age, older = (1.0, 1.0) if turned > 0.0 else (0.5 + sqrt(0.25 + age * age), age)
        pull = (older - 1.0) / age
        ahead = [p + pull * (p - o) for p, o in zip(impulses, last, strict=True)]
    return impulses


def _set_forces(
    contacts: Sequence[Contact],
    step: RigidStep,
    impulses: Sequence[float],
    twist: Twist,
    dt: float,
) -> None:
    """Set force, moment, slid distance and lost work of each contact."""
    for contact in contacts:
        contact.force_x = contact.force_y = contact.moment = contact.slid = contact.lost = 0.0
    for (place, _), contact in zip(step.blocks(), step.holding, strict=True):
        block = zip(step.rows[place : place + 3], impulses[place:], strict=False)
        for (jx, jy, jw, _, _), impulse in block:
            contact.force_x += jx * impulse / dt
            contact.force_y += jy * impulse / dt
            # The moment of the sole is the moment about the body minus that of the force there.
            arm = contact.lever_x * jy - contact.lever_y * jx
            contact.moment += (jw - arm) * impulse / dt
        sx, sy = contact.slip(twist)
        turned = contact.turning_radius * (twist[2] + contact.motion_turn)
        contact.slid = math.hypot(sx, sy) * dt
        contact.lost = contact.cap * dt * math.hypot(sx, sy, turned)


def _directions(contact: Contact, mass: float, inertia: float) -> list[_Row]:
    """Return three directions of slip in which an impulse moves a contact only along itself.

    They are the eigenvectors of its compliance 1/mass + n nᵀ/inertia, n = (-ry, rx, ρ): one along
    the lever arm, two in the plane of slip across the arm and turning. A row has the factors of
    the twist, the imposed motion in this direction, and its compliance.
    """
    rx, ry, radius = contact.lever_x, contact.lever_y, contact.turning_radius
    arm = sqrt(rx * rx + ry * ry)
    ux, uy = (rx / arm, ry / arm) if arm > 0.0 else (1.0, 0.0)
    across = 1.0 / mass + arm * arm / inertia
    mixed, turning = arm * radius / inertia, radius * radius / inertia
    angle = 0.5 * math.atan2(2.0 * mixed, across - turning)
    cosine, sine = math.cos(angle), math.sin(angle)
    rows = []
    for ex, ey, et in (
        (ux, uy, 0.0), (-cosine * uy, cosine * ux, sine), (sine * uy, -sine * ux, cosine)
    ):  # fmt: skip
        jw = rx * ey - ry * ex + radius * et
        motion = ex * contact.motion_x + ey * contact.motion_y
        compliance = (ex * ex + ey * ey) / mass + jw * jw / inertia
        # Without a turning radius nothing moves in the last direction, so any compliance is valid.
        rows.append((
            ex, ey, jw, motion + et * radius * contact.motion_turn, compliance or 1.0
        ))  # fmt: skip
    return rows


def _check(dt: float) -> None:
    if not 0.0 < dt < math.inf:  # a quick check; the slower `number` raises the error
        number('dt', dt, 's', above=True)


def _unsettled(dt: float, contacts: Sequence[object]) -> ArithmeticError:
    return ArithmeticError(
        f'friction step of {dt:g} s with {len(contacts)} contacts does not settle: take less stiff'
        ' pads or a shorter step'
    )

# SPDX-License-Identifier: Apache-2.0
"""One step of a planar body on frictional feet.

The unknown is the twist q = (vx, vy, ω) at the end of the step. Each foot at lever arm (rx, ry)
slides over the floor with s = (vx - ω ry + ux, vy + ω rx + uy) and turns on it with ω + w, u and w
being what the gait makes it do relative to the body. A step minimises the convex function

    ½ (q - b)ᵀ M (q - b) + dt Σ φ_i(z_i),     b = twist before the step + dt M⁻¹ applied wrench

so the twist is unique. Sliding and turning share the foot's grip through an ellipsoidal limit
surface: the slip is z = (s, ρ (ω + w)), its force (F, T/ρ), and what is bounded is |(F, T/ρ)|.
Howe and Cutkosky (Int. J. Robotics Research 15, 1996, 531) take this ellipsoid through the largest
force and moment for the limit surface of a sliding contact; an evenly pressed disc of radius R has
ρ = 2/3 R. What differs is φ, the potential of the foot's friction with cap c:

``elastic``
    The pad shears with stiffness k, and twists with k ρ², up to the cap: φ' = min(K |z|, c) along
    z = slip + e/dt, with e the shear at the start and K = k dt (a Huber function). Feet that stick
    share the load by their stiffness, so that forces are unique too, and there is no creep. The
    default.
``creeping``
    Pseudo-Huber on the slip, φ' = c |z| / √(z² + ε²): fast and smooth, creeps at about ε; sticking
    feet share the load in proportion to their caps.
``exact_stick``
    Rigid-plastic, φ' = c, by block Gauss-Seidel on impulses in balls of radius c dt: feet stick
    to rounding, and the twist comes with a bound of its error. The reference. The forces of three
    or more sticking feet are not unique.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import sqrt

from ros_pad.simulation.planar_step import Pushed
from ros_pad.simulation.planar_step import newton
from ros_pad.simulation.planar_step import push

Twist = tuple[float, float, float]


class Contact:
    """One foot, or a drag, in a step: lever arm, imposed motion, cap, and pad shear.

    All in world axes and SI units; lever arms from the centre of mass. After a step it holds the
    force and the moment on the body, how far its middle slid over the floor, and the work that it
    lost there. Without a turning radius it turns on the spot freely.
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
        """Velocity of the foot over the floor, m/s."""
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
    """Step with sheared pads; sets each contact's force and shear (N on the body, m).

    Parameters
    ----------
    free : tuple
        Twist (m/s, m/s, rad/s) that the body would have without the contacts.
    mass, inertia : float
        kg and kg m².
    contacts : sequence of Contact
        Those with a cap of zero are skipped and lose their shear.
    dt : float
        Step, s.
    start : tuple
        First guess of the twist; the last twist is a good one.

    Returns
    -------
    tuple
        Twist at the end of the step.

    Raises
    ------
    ArithmeticError
        When Newton's method does not settle: pads of 1e8 N/m or more.
    """
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
    """Step with pseudo-Huber friction of creep speed ε, m/s; sets each contact's force."""
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


def _unsettled(dt: float, contacts: Sequence[object]) -> ArithmeticError:
    return ArithmeticError(
        f'friction step of {dt:g} s with {len(contacts)} contacts does not settle: take less stiff'
        ' pads or a shorter step'
    )


def exact_stick(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    tolerance: float = 1e-8,
    sweeps: int = 20000,
) -> Twist:
    """Step with rigid-plastic friction, to a proven accuracy; sets each contact's force.

    Parameters
    ----------
    free, mass, inertia, contacts, dt
        As for :func:`elastic`.
    tolerance : float
        Bound on the error of the twist, √(v² + ω² inertia/mass), m/s. Rounding adds up to
        3e-8 √(Σ c dt |s|/mass), which is less for bodies of a kilogram.
    sweeps : int
        Most sweeps over the contacts.

    Raises
    ------
    ArithmeticError
        When the bound is not met after all sweeps.

    Notes
    -----
    Accelerated projected gradient on the impulses, begun anew wherever the last step turns back
    (Nesterov 1983; O'Donoghue and Candès 2015). The primal function is strongly convex, so the
    gap Σ (c dt |s| + p·s) between it and its dual bounds the error: ½ mass error² <= gap.
    """
    limits = [contact.cap * dt for contact in contacts]
    levers = [(contact.lever_x, contact.lever_y) for contact in contacts]
    # No direction of impulses is stiffer than all contacts together: 1/rate is a safe step.
    rate = len(levers) / mass + sum(rx * rx + ry * ry for rx, ry in levers) / inertia
    impulses = ahead = [(0.0, 0.0)] * len(levers)

    def twist_after(pushes: Sequence[tuple[float, float]]) -> Twist:
        return (
            free[0] + sum(px for px, _ in pushes) / mass,
            free[1] + sum(py for _, py in pushes) / mass,
            free[2]
            + sum(rx * py - ry * px for (px, py), (rx, ry) in zip(pushes, levers, strict=True))
            / inertia,
        )

    age = 1.0
    for _ in range(sweeps):
        twist = twist_after(ahead)
        last, impulses = impulses, []
        turn = 0.0
        for contact, limit, (ax, ay), (lx, ly) in zip(contacts, limits, ahead, last, strict=True):
            sx, sy = contact.slip(twist)
            px, py = ax - sx / rate, ay - sy / rate
            size = math.hypot(px, py)
            if size > limit:
                px, py = px * limit / size, py * limit / size
            impulses.append((px, py))
            turn += (ax - px) * (px - lx) + (ay - py) * (py - ly)
        twist = twist_after(impulses)
        gap = lost = 0.0
        for contact, limit, (px, py) in zip(contacts, limits, impulses, strict=True):
            sx, sy = contact.slip(twist)
            loss = limit * math.hypot(sx, sy)
            lost += loss
            gap += loss + px * sx + py * sy
        if gap <= 0.5 * mass * tolerance * tolerance + 4e-16 * lost:
            break
        age, older = (1.0, 1.0) if turn > 0.0 else (0.5 + sqrt(0.25 + age * age), age)
        pull = (older - 1.0) / age
        ahead = [
            (px + pull * (px - lx), py + pull * (py - ly))
            for (px, py), (lx, ly) in zip(impulses, last, strict=True)
        ]
    else:
        raise ArithmeticError(
            f'twist is known to {sqrt(2.0 * gap / mass):g} m/s only after {sweeps} sweeps'
        )
    for contact, (px, py) in zip(contacts, impulses, strict=True):
        contact.force_x, contact.force_y = px / dt, py / dt
        contact.slid = math.hypot(*contact.slip(twist)) * dt
    return twist

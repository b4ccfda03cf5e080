# SPDX-License-Identifier: Apache-2.0
"""One step of a planar body on frictional feet.

The unknown is the twist q = (vx, vy, ω) at the end of the step. Each foot at lever arm (rx, ry)
moves over the floor with s = (vx - ω ry + ux, vy + ω rx + uy), u being what the gait makes it do
relative to the body. A step minimises the convex function

    ½ (q - b)ᵀ M (q - b) + dt Σ φ_i(s_i),     b = twist before the step + dt M⁻¹ applied wrench

so the twist is unique. What differs is φ, the potential of the foot's friction with cap c:

``elastic``
    The pad shears with stiffness k up to the cap: φ' = min(K |z|, c) along z = s + e/dt, with e
    the shear at the start and K = k dt (a Huber function). Feet that stick share the load by their
    stiffness, so that forces are unique too, and there is no creep. The default.
``creeping``
    Pseudo-Huber on the slip speed, φ' = c |s| / √(s² + ε²): fast and smooth, creeps at
    about ε; sticking feet share the load in proportion to their caps.
``exact_stick``
    Rigid-plastic, φ' = c, by projected gradient on impulses in discs of radius c dt: feet stick
    to rounding, and the twist comes with a bound of its error. The reference. The forces of three
    or more sticking feet are not unique: started from zero and none at its cap, those reported
    are the smallest (least norm).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence
from math import sqrt

Twist = tuple[float, float, float]


class Contact:
    """One foot, or a drag, in a step: lever arm, imposed motion, cap, and pad shear.

    All in world axes and SI units; lever arms from the centre of mass. After a step it holds the
    force on the body, and how far its contact slid over the floor.
    """

    __slots__ = (
        'cap', 'force_x', 'force_y', 'lever_x', 'lever_y', 'motion_x', 'motion_y',
        'shear_x', 'shear_y', 'slid', 'stiffness',
    )  # fmt: skip

    def __init__(self, stiffness: float) -> None:
        self.stiffness = stiffness
        self.cap = 0.0
        self.lever_x = self.lever_y = 0.0
        self.motion_x = self.motion_y = 0.0
        self.shear_x = self.shear_y = 0.0
        self.force_x = self.force_y = 0.0
        self.slid = 0.0

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
    active = []
    for contact in contacts:
        if contact.cap > 0.0:
            rate = contact.stiffness * dt
            active.append((
                contact.lever_x, contact.lever_y,
                contact.motion_x + contact.shear_x / dt, contact.motion_y + contact.shear_y / dt,
                contact.cap, rate, contact.cap / rate,
            ))  # fmt: skip
        else:
            contact.shear_x = contact.shear_y = contact.force_x = contact.force_y = 0.0
            contact.slid = 0.0
    twist = _newton(free, mass, inertia, active, dt, start, _shear_law)
    for contact, (rx, ry, ox, oy, cap, rate, edge) in zip(
        [c for c in contacts if c.cap > 0.0], active, strict=True
    ):
        zx = twist[0] - twist[2] * ry + ox
        zy = twist[1] + twist[2] * rx + oy
        size = math.hypot(zx, zy)
        gain = rate if size <= edge else cap / size
        contact.slid = (size - edge) * dt if size > edge else 0.0
        contact.force_x, contact.force_y = -gain * zx, -gain * zy
        contact.shear_x = gain * zx / contact.stiffness
        contact.shear_y = gain * zy / contact.stiffness
    return twist


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
    active = [
        (c.lever_x, c.lever_y, c.motion_x, c.motion_y, c.cap, c.cap / creep, creep)
        for c in contacts
        if c.cap > 0.0
    ]
    twist = _newton(free, mass, inertia, active, dt, start, _pseudo_huber_law)
    for contact in contacts:
        sx, sy = contact.slip(twist)
        gain = contact.cap / sqrt(sx * sx + sy * sy + creep * creep)
        contact.force_x, contact.force_y = -gain * sx, -gain * sy
        contact.slid = math.hypot(sx, sy) * dt
    return twist


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


def _newton(
    free: Twist,
    mass: float,
    inertia: float,
    active: Sequence[tuple[float, ...]],
    dt: float,
    start: Twist,
    law: Callable[[float, float, float, float], tuple[float, float]],
) -> Twist:
    """Newton on the convex step, shortened where it overshoots; scalars throughout, for speed.

    ``law`` gives the gain f / |z| of a contact, and by how much its slope along z differs from it.
    """
    bx, by, bw = free
    vx, vy, w = start
    # What the largest gains make of the rounding of a speed is no reason to go on.
    scale = mass
    for contact in active:
        scale += 0.01 * dt * contact[5]
    scale *= 1e-13 + 1e-12 * (abs(bx) + abs(by))
    step_x = step_y = step_w = slope = 0.0
    length = 1.0
    for _ in range(200):
        gx, gy, gw = mass * (vx - bx), mass * (vy - by), inertia * (w - bw)
        hxx = hyy = mass
        hww = inertia
        hxy = hxw = hyw = 0.0
        for rx, ry, ox, oy, cap, rate, edge in active:
            zx = vx - w * ry + ox
            zy = vy + w * rx + oy
            size = sqrt(zx * zx + zy * zy)
            gain, bend = law(size, cap, rate, edge)
            gain *= dt
            fx, fy = gain * zx, gain * zy
            gx += fx
            gy += fy
            gw += rx * fy - ry * fx
            kxx = kyy = gain
            kxy = 0.0
            if bend:
                bend *= dt / (size * size)
                kxx += bend * zx * zx
                kxy = bend * zx * zy
                kyy += bend * zy * zy
            kxw, kyw = rx * kxy - ry * kxx, rx * kyy - ry * kxy
            hxx += kxx
            hxy += kxy
            hyy += kyy
            hxw += kxw
            hyw += kyw
            hww += rx * kyw - ry * kxw
        # The function is convex: its slope along the step has grown since. Where it has turned
        # to rise nearly as steeply as it fell, the step was too long: take half of it back.
        rise = -(gx * step_x + gy * step_y + gw * step_w)
        if rise > 0.9 * slope and length > 1e-9:
            length *= 0.5
            vx += length * step_x
            vy += length * step_y
            w += length * step_w
            continue
        if abs(gx) + abs(gy) + 10.0 * abs(gw) < scale:
            return vx, vy, w
        # Cholesky of the 3 x 3 Hessian, which the masses keep positive definite.
        lyx, lwx = hxy / hxx, hxw / hxx
        dy = hyy - lyx * hxy
        lower = hyw - lyx * hxw
        lwy = lower / dy
        yy = gy - lyx * gx
        step_w = (gw - lwx * gx - lwy * yy) / (hww - lwx * hxw - lwy * lower)
        step_y = yy / dy - lwy * step_w
        step_x = gx / hxx - lyx * step_y - lwx * step_w
        slope = gx * step_x + gy * step_y + gw * step_w
        length = 1.0
        vx -= step_x
        vy -= step_y
        w -= step_w
    raise ArithmeticError(
        f'friction step of {dt:g} s with {len(active)} contacts does not settle: take less stiff'
        ' pads or a shorter step'
    )


def _shear_law(size: float, cap: float, rate: float, edge: float) -> tuple[float, float]:
    if size <= edge:
        return rate, 0.0
    gain = cap / size
    return gain, -gain


def _pseudo_huber_law(size: float, cap: float, rate: float, edge: float) -> tuple[float, float]:
    square = size * size + edge * edge
    gain = cap / sqrt(square)
    return gain, -gain * size * size / square

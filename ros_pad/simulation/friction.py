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
    Rigid-plastic, φ' = c, by projected gradient or block Gauss-Seidel on impulses in balls of
    radius c dt: feet stick to rounding, and the twist comes with a bound of its error. The
    reference. The forces of three or more sticking feet are not unique.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import sqrt
from operator import add
from operator import mul
from operator import sub

from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.simulation.planar_step import Pushed
from ros_pad.simulation.planar_step import newton
from ros_pad.simulation.planar_step import push

Twist = tuple[float, float, float]
_Row = tuple[float, float, float, float, float]

# Sweeps of Gauss-Seidel after which a step counts as one that crawls.
CRAWLING = 100


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
        Step, s, above 0.
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
    """Step with pseudo-Huber friction of creep speed ε, m/s; sets each contact's force."""
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


def viscous(contacts: Sequence[Contact]) -> Twist:
    """Twist of a body without inertia on feet whose friction is viscous; one linear system.

    The cheapest rung: a force in proportion to slip, and to the foot's cap, instead of Coulomb's;
    feet then slip such that Σ c s and Σ c (r × s + ρ² (ω + w)) vanish, whatever the viscosity. It
    is exact where a twist exists at which no foot slips, and tells nothing of forces. Walkers that
    slip are modelled like this in arXiv 2310.20669. Where feet fight it takes the mean of their
    motions where Coulomb takes the median.

    Raises
    ------
    ArithmeticError
        When no foot has a grip, or a single point contact leaves the body free to turn.
    """
    s = sx = sy = turning = ux = uy = uw = 0.0
    for c in contacts:
        s += c.cap
        sx += c.cap * c.lever_x
        sy += c.cap * c.lever_y
        radius = c.turning_radius * c.turning_radius
        turning += c.cap * (c.lever_x * c.lever_x + c.lever_y * c.lever_y + radius)
        ux += c.cap * c.motion_x
        uy += c.cap * c.motion_y
        uw += c.cap * (c.lever_x * c.motion_y - c.lever_y * c.motion_x + radius * c.motion_turn)
    # About the middle of the grip the system falls apart into three.
    spin = turning - (sx * sx + sy * sy) / s if s > 0.0 else 0.0
    if spin <= 1e-12 * turning:
        raise ArithmeticError(f'{len(contacts)} contacts with a grip of {s:g} N leave a body free')
    turn = -(uw - (sx * uy - sy * ux) / s) / spin
    return (turn * sy - ux) / s, -(turn * sx + uy) / s, turn


def exact_stick(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    tolerance: float = 1e-8,
    sweeps: int = 20000,
    method: str = 'gradient',
) -> Twist:
    """Step with rigid-plastic friction, to a proven accuracy; sets each contact's force.

    Parameters
    ----------
    free, mass, inertia, contacts, dt
        As for :func:`elastic`.
    tolerance : float
        Bound on the error of the twist, √(v² + ω² inertia/mass), m/s. Rounding adds up to
        3e-8 √(Σ c dt |z|/mass) + 1.5e-8 Σ c dt/mass, which is less for bodies of a kilogram.
    sweeps : int
        Most sweeps over the contacts.
    method : str
        ``gradient`` or ``gauss_seidel``. Both give the one twist. Of the forces of sticking feet
        the first finds the smallest, if none is at its cap; the second those that come first in
        the order of the contacts, as solvers in use do.

    Raises
    ------
    ArithmeticError
        When the bound is not met after all sweeps.
    InvalidInput
        For another method, or when the step is not above zero.

    Notes
    -----
    ``gradient`` is projected gradient on all impulses, accelerated and begun anew wherever its
    last step turns back (Nesterov 1983; O'Donoghue and Candès 2015). ``gauss_seidel`` finds,
    contact by contact, the impulse in its ball that minimises the energy while the others are
    held, exactly. After each sweep it tries a secant step along the change of the last two
    (Anderson's mixing of depth one), kept where it lowers the energy: plain sweeps crawl where
    contacts nearly agree on a motion. The few steps that still crawl are handed to the gradient.

    The primal function is strongly convex, so the gap Σ (c dt |z| + p·z) between it and its dual
    bounds the error: ½ mass error² <= gap.
    """
    choice('method', method, ('gradient', 'gauss_seidel'))
    _check(dt)
    holding = [contact for contact in contacts if contact.cap > 0.0]
    limits = [contact.cap * dt for contact in holding]
    rows = [row for contact in holding for row in _directions(contact, mass, inertia)]
    # No direction of impulses is stiffer than all contacts together: 1/rate is a safe step.
    rate = sum(max(row[4] for row in rows[i : i + 3]) for i in range(0, len(rows), 3))
    at_first = [jx * free[0] + jy * free[1] + jw * free[2] + m for jx, jy, jw, m, _ in rows]

    along_x, along_y, along_turn = ([row[axis] for row in rows] for axis in range(3))

    def twist_after(impulses: list[float]) -> Twist:
        return (
            free[0] + sum(map(mul, along_x, impulses)) / mass,
            free[1] + sum(map(mul, along_y, impulses)) / mass,
            free[2] + sum(map(mul, along_turn, impulses)) / inertia,
        )

    def slips(impulses: list[float]) -> list[float]:
        vx, vy, turn = twist_after(impulses)
        return [jx * vx + jy * vy + jw * turn + motion for jx, jy, jw, motion, _ in rows]

    def energy(impulses: list[float]) -> float:
        both = map(add, slips(impulses), at_first)
        return 0.5 * sum(map(mul, impulses, both))

    def sweep(impulses: list[float]) -> list[float]:
        (vx, vy, turn), after = twist_after(impulses), list(impulses)
        for place, limit in zip(range(0, len(rows), 3), limits, strict=True):
            block = rows[place : place + 3]
            pulls = [
                (jx * vx + jy * vy + jw * turn + motion - stiffness * impulse, stiffness)
                for (jx, jy, jw, motion, stiffness), impulse in zip(
                    block, impulses[place:], strict=False
                )
            ]
            for index, impulse in enumerate(_least_in_ball(pulls, limit), place):
                after[index], added = impulse, impulse - impulses[index]
                vx += along_x[index] * added / mass
                vy += along_y[index] * added / mass
                turn += along_turn[index] * added / inertia
        return after

    def in_balls(impulses: list[float]) -> list[float]:
        inside = list(impulses)
        for place, limit in zip(range(0, len(rows), 3), limits, strict=True):
            size = math.hypot(*impulses[place : place + 3])
            if size > limit:
                inside[place : place + 3] = [
                    each * limit / size for each in impulses[place : place + 3]
                ]
        return inside

    gap = 0.0
    allowed = 0.5 * mass * tolerance * tolerance + 1e-16 * sum(limits) ** 2 / mass

    def settled(impulses: list[float]) -> bool:
        nonlocal gap
        slip, lost = slips(impulses), 0.0
        for place, limit in zip(range(0, len(rows), 3), limits, strict=True):
            lost += limit * math.hypot(*slip[place : place + 3])
        gap = lost + sum(map(mul, impulses, slip))
        return gap <= allowed + 4e-16 * lost

    impulses = [0.0] * len(rows)
    swept, change = impulses, impulses
    count = 0
    patience = min(sweeps, CRAWLING) if method == 'gauss_seidel' else 0
    while count < patience and not settled(impulses):
        count += 1
        last, before = swept, change
        swept = sweep(impulses)
        change = list(map(sub, swept, impulses))
        impulses = swept
        bend = list(map(sub, change, before))
        if count > 1 and any(bend):
            share = sum(map(mul, change, bend)) / sum(map(mul, bend, bend))
            ahead = in_balls([s - share * (s - o) for s, o in zip(swept, last, strict=True)])
            if energy(ahead) < energy(swept):
                impulses = ahead
    ahead, age = impulses, 1.0
    while not settled(impulses):
        if count >= sweeps:
            raise ArithmeticError(
                f'twist is known to {sqrt(2.0 * gap / mass):g} m/s only after {sweeps} sweeps'
            )
        count += 1
        last = impulses
        impulses = in_balls([p - z / rate for p, z in zip(ahead, slips(ahead), strict=True)])
        turned = sum((a - p) * (p - o) for a, p, o in zip(ahead, impulses, last, strict=True))
        age, older = (1.0, 1.0) if turned > 0.0 else (0.5 + sqrt(0.25 + age * age), age)
        pull = (older - 1.0) / age
        ahead = [p + pull * (p - o) for p, o in zip(impulses, last, strict=True)]
    twist = twist_after(impulses)
    for contact in contacts:
        contact.force_x = contact.force_y = contact.moment = contact.slid = contact.lost = 0.0
    for place, contact in zip(range(0, len(rows), 3), holding, strict=True):
        for (jx, jy, jw, _, _), impulse in zip(
            rows[place : place + 3], impulses[place:], strict=False
        ):
            contact.force_x += jx * impulse / dt
            contact.force_y += jy * impulse / dt
            # A direction's moment about the body less that of its force is the sole's own.
            arm = contact.lever_x * jy - contact.lever_y * jx
            contact.moment += (jw - arm) * impulse / dt
        sx, sy = contact.slip(twist)
        contact.slid = math.hypot(sx, sy) * dt
        contact.lost = (
            contact.cap
            * dt
            * math.hypot(sx, sy, contact.turning_radius * (twist[2] + contact.motion_turn))
        )
    return twist


def _directions(contact: Contact, mass: float, inertia: float) -> list[_Row]:
    """Three directions of a contact's slip in which an impulse moves it along itself only.

    They are the eigenvectors of its compliance 1/mass + n nᵀ/inertia, n = (-ry, rx, ρ): along the
    lever arm, and two in the plane of slip across it and turning. A row has what a twist makes of
    it, the imposed motion along it, and its compliance.
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
        # Without a turning radius nothing moves along the last: any compliance will do.
        rows.append((
            ex, ey, jw, motion + et * radius * contact.motion_turn, compliance or 1.0
        ))  # fmt: skip
    return rows


def _least_in_ball(pulls: Sequence[tuple[float, float]], limit: float) -> list[float]:
    """Minimise Σ (½ d p² + g p) over |p| <= limit, for (g, d) in pulls.

    On the sphere p = -g/(d + λ), λ the root of |p(λ)| = limit: Newton on 1/|p|, which is nearly
    linear and concave, so that from below it never passes the root (Moré and Sorensen 1983).
    """
    found = [-g / d for g, d in pulls]
    if sum(map(mul, found, found)) <= limit * limit:
        return found
    size = sqrt(sum(g * g for g, _ in pulls))
    multiplier = max(0.0, size / limit - max(d for _, d in pulls))
    for _ in range(100):
        found = [-g / (d + multiplier) for g, d in pulls]
        square = sum(map(mul, found, found))
        size = sqrt(square)
        if size <= limit * (1.0 + 1e-15):
            break
        slope = sum(p * p / (d + multiplier) for p, (_, d) in zip(found, pulls, strict=True))
        multiplier += (size / limit - 1.0) * square / slope
    return [p * limit / size for p in found]


def _check(dt: float) -> None:
    if not 0.0 < dt < math.inf:  # cheap, for steps are many: the words are those of `number`
        number('dt', dt, 's', above=True)


def _unsettled(dt: float, contacts: Sequence[object]) -> ArithmeticError:
    return ArithmeticError(
        f'friction step of {dt:g} s with {len(contacts)} contacts does not settle: take less stiff'
        ' pads or a shorter step'
    )

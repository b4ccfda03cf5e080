# SPDX-License-Identifier: Apache-2.0
"""Step a planar body on several feet: with sheared pads, and with rigid ones as the reference.

The unknown is the twist q = (vx, vy, ω) at the end of the step. Each foot at lever arm (rx, ry)
slides over the floor with s = (vx - ω ry + ux, vy + ω rx + uy) and turns on it with ω + w; u and w
are its velocity and turning rate relative to the body by the gait. A step minimises the function

    ½ (q - b)ᵀ M (q - b) + dt Σ φ_i(z_i),     b = twist before the step + dt M⁻¹ applied wrench

which is convex, so the twist is unique. Sliding and turning share the capacity c of a foot by an
ellipsoidal limit surface: the slip is z = (s, ρ (ω + w)), its force (F, T/ρ), and |(F, T/ρ)| <= c.
Howe and Cutkosky (Int. J. Robotics Research 15, 1996, 531) take this ellipsoid through the largest
force and moment for the limit surface of a sliding contact; an evenly pressed disc of radius R has
ρ = 2/3 R.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ros_pad.configuration import number
from ros_pad.simulation.planar_step import Pushed, newton, push

Twist = tuple[float, float, float]


@dataclass(slots=True, eq=False)
class Contact:
    """One foot in a step, in world axes and SI units; the lever arm is from the centre of mass.

    After a step it contains the force and the moment on the body, the distance that its middle
    slid over the floor, and the work lost there. With a turning radius of 0 it turns on the spot
    freely.
    """

    stiffness: float
    turning_radius: float = 0.0
    cap: float = 0.0
    lever_x: float = 0.0
    lever_y: float = 0.0
    motion_x: float = 0.0
    motion_y: float = 0.0
    motion_turn: float = 0.0
    shear_x: float = 0.0
    shear_y: float = 0.0
    twist: float = 0.0
    force_x: float = 0.0
    force_y: float = 0.0
    moment: float = 0.0
    slid: float = 0.0
    lost: float = 0.0

    def slip(self, twist: Twist) -> tuple[float, float]:
        """Return the velocity of the foot over the floor, m/s, at a twist of the body."""
        vx, vy, omega = twist
        return (
            vx - omega * self.lever_y + self.motion_x,
            vy + omega * self.lever_x + self.motion_y,
        )

    def arm(self) -> np.ndarray:
        """Return the (3, 3) matrix from the twist of the body to slip and ρ times turning."""
        return np.array(
            [[1.0, 0.0, -self.lever_y], [0.0, 1.0, self.lever_x], [0.0, 0.0, self.turning_radius]]
        )


def elastic(
    free: Twist, mass: float, inertia: float, contacts: Sequence[Contact], dt: float, start: Twist
) -> Twist:
    """Step with sheared pads; set each contact's force on the body, N, and shear, m.

    The pad shears with stiffness k, and twists with k ρ², up to the cap: φ' = min(K |z|, c) along
    z = slip + e/dt, with e the shear at the start and K = k dt (a Huber function).

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

    Raises
    ------
    ArithmeticError
        When Newton's method does not converge, as with pads of 1e8 N/m or more.
    InvalidInput
        When the step is not above zero.
    """
    number('dt', dt, 's', above=True)
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
    vx, vy, turn, settled = newton(free, mass, inertia, pushed, dt, start)
    if not settled:
        raise ArithmeticError(f'friction step of {dt:g} s with {len(holding)} contacts diverges')
    for contact in contacts:
        contact.force_x = contact.force_y = contact.moment = contact.slid = contact.lost = 0.0
    for c, row in zip(holding, pushed, strict=True):
        c.force_x, c.force_y, c.moment, c.slid, c.lost = push(vx, vy, turn, row, dt)
    for c in contacts:
        c.shear_x, c.shear_y = -c.force_x / c.stiffness, -c.force_y / c.stiffness
        if c.turning_radius:
            c.twist = -c.moment / (c.stiffness * c.turning_radius * c.turning_radius)
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
    """Step with rigid-plastic friction, φ' = c, to a proven accuracy; set each contact's force.

    The forces of three or more sticking feet are not unique; these are the smallest ones, if none
    is at its cap.

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
    back (Nesterov 1983; O'Donoghue and Candès 2015). The primal function is strongly convex, so
    the gap Σ (c dt |z| + p·z) between it and its dual bounds the error: ½ mass error² <= gap.
    """
    number('dt', dt, 's', above=True)
    for contact in contacts:
        contact.force_x = contact.force_y = contact.moment = contact.slid = contact.lost = 0.0
    holding = [contact for contact in contacts if contact.cap > 0.0]
    if not holding:
        return free
    arms = np.concatenate([contact.arm() for contact in holding])
    motion = np.array(
        [(c.motion_x, c.motion_y, c.turning_radius * c.motion_turn) for c in holding]
    ).ravel()
    limits = np.array([contact.cap * dt for contact in holding])
    masses = np.array([mass, mass, inertia])
    rate = float(np.linalg.eigvalsh(arms / masses @ arms.T).max())
    allowed = 0.5 * mass * tolerance**2 + 1e-16 * limits.sum() ** 2 / mass

    def twist_of(impulses: np.ndarray) -> np.ndarray:
        return np.asarray(free + impulses @ arms / masses)

    def slips(impulses: np.ndarray) -> np.ndarray:
        return np.asarray(arms @ twist_of(impulses) + motion)

    impulses = ahead = np.zeros(len(arms))
    age = 1.0
    for _ in range(sweeps + 1):
        slip = slips(impulses)
        lost = float(limits @ np.linalg.norm(slip.reshape(-1, 3), axis=1))
        gap = lost + float(impulses @ slip)
        if gap <= allowed + 4e-16 * lost:
            break
        last = impulses
        moved = (ahead - slips(ahead) / rate).reshape(-1, 3)
        size = np.maximum(np.linalg.norm(moved, axis=1), limits)
        impulses = (moved * (limits / size)[:, None]).ravel()
        back = (ahead - impulses) @ (impulses - last) > 0.0
        age, older = (1.0, 1.0) if back else (0.5 + math.sqrt(0.25 + age * age), age)
        ahead = impulses + (older - 1.0) / age * (impulses - last)
    else:
        raise ArithmeticError(
            f'the error of the twist may still be {math.sqrt(2.0 * gap / mass):g} m/s after'
            f' {sweeps} sweeps: allow more sweeps or a larger tolerance'
        )
    for c, force, moved in zip(
        holding, impulses.reshape(-1, 3) / dt, slip.reshape(-1, 3), strict=True
    ):
        c.force_x, c.force_y, c.moment = (float(x) for x in force * (1.0, 1.0, c.turning_radius))
        c.slid = math.hypot(moved[0], moved[1]) * dt
        c.lost = c.cap * dt * float(np.linalg.norm(moved))
    vx, vy, turn = twist_of(impulses).tolist()
    return vx, vy, turn

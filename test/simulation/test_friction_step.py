# SPDX-License-Identifier: Apache-2.0
"""The friction step of a planar body on elastic feet: laws, limits, and a general minimiser."""

import math
import random

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import minimize

from ros_pad.contact.resistance import DISC_TURNING_RADIUS
from ros_pad.simulation.planar_step import newton, push

MASS, INERTIA = 2.0, 0.03
STILL = (0.0, 0.0, 0.0)


def foot(cap, lever=(0.0, 0.0), motion=(0.0, 0.0, 0.0), radius=0.0, rate=1e4):
    """Return a contact whose force is the rate, N s/m, times its velocity, up to a cap, N."""
    return (*lever, *motion, radius, cap, rate)


def step(feet, dt, free=STILL, start=STILL, mass=MASS, inertia=INERTIA):
    """Return the twist after a step, and force x, y and yaw moment of each foot."""
    *twist, settled = newton(free, mass, inertia, feet, dt, start)
    assert settled
    return twist, [push(*twist, each, dt) for each in feet]


def random_step(rng):
    """Return one to six feet, a step, s, and a free twist, all at random."""
    feet = []
    for _ in range(rng.randint(1, 6)):
        speed, spin = rng.choice([0.0, 1e-3, 0.1, 0.5]), rng.choice([0.0, 0.1, 3.0])
        motion = (
            speed * rng.uniform(-1, 1),
            speed * rng.uniform(-1, 1),
            spin * rng.uniform(-1, 1),
        )
        lever = rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25)
        radius = rng.choice([0.0, rng.uniform(0.002, 0.02)])
        feet.append(foot(rng.uniform(0.05, 8.0), lever, motion, radius, 10.0 ** rng.uniform(1, 4)))
    scale = rng.choice([0.0, 0.01, 1.0])
    free = tuple(scale * rng.uniform(-most, most) for most in (0.4, 0.4, 2.0))
    return feet, rng.choice([1e-4, 1e-3, 4e-3]), free


def energy(twist, feet, dt, free):
    """Return the convex function that a step minimises, written with NumPy."""
    rx, ry, ox, oy, turn, radius, cap, rate = np.array(feet).T
    vx, vy, yaw = twist
    slip = np.array([vx - yaw * ry + ox, vy + yaw * rx + oy, radius * (yaw + turn)])
    size = np.linalg.norm(slip, axis=0)
    held = np.where(rate * size <= cap, 0.5 * rate * size**2, cap * size - 0.5 * cap**2 / rate)
    change = np.subtract(twist, free)
    return 0.5 * change**2 @ (MASS, MASS, INERTIA) + dt * held.sum()


def test_no_other_twist_has_less_energy():
    rng = random.Random(22)
    for _ in range(12):
        feet, dt, free = random_step(rng)
        twist, _ = step(feet, dt, free)
        scale = np.array([1.0, 1.0, math.sqrt(MASS / INERTIA)])
        found = minimize(
            lambda q, feet=feet, dt=dt, free=free, scale=scale: (
                1e3 * energy(q * scale, feet, dt, free)
            ),
            np.array(free) / scale,
            method='Nelder-Mead',
            options={'xatol': 1e-10, 'fatol': 1e-17, 'maxiter': 4000, 'adaptive': True},
        )
        ours = energy(twist, feet, dt, free)
        assert ours <= found.fun / 1e3 + 1e-15
        # By strong convexity ½ m distance² is at most the difference of the function.
        allowed = math.sqrt(2.0 * max(found.fun / 1e3 - ours, 0.0) / MASS)
        assert np.linalg.norm(found.x - twist / scale) <= allowed + 2e-8


def test_the_start_does_not_matter():
    """Where the twist is that far off, most feet slip, as after a wrong guess."""
    rng = random.Random(24)
    for _ in range(100):
        feet, dt, free = random_step(rng)
        bad = (rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-5.0, 5.0))
        one, other = (step(feet, dt, free, start)[0] for start in (free, bad))
        assert one == pytest.approx(other, abs=1e-9)


def test_newton_and_euler_laws_and_the_caps():
    """Changes of momentum and angular momentum are the impulses of the forces of the feet."""
    rng = random.Random(23)
    for _ in range(300):
        feet, dt, free = random_step(rng)
        twist, pushed = step(feet, dt, free)
        fx, fy, turning, slid, lost = np.array(pushed).T
        rx, ry, *_, radius, cap, _ = np.array(feet).T
        moment = (rx * fy - ry * fx + turning).sum()
        after = np.add(free, dt * np.array([fx.sum() / MASS, fy.sum() / MASS, moment / INERTIA]))
        assert twist == pytest.approx(after, abs=1e-9)
        about = np.divide(turning, radius, out=np.zeros_like(radius), where=radius > 0.0)
        assert (np.hypot(np.hypot(fx, fy), about) <= cap * (1 + 1e-12)).all()
        assert (slid >= 0.0).all() and (lost >= 0.0).all()


def test_even_disc_turns_against_two_thirds_of_its_radius():
    """Coulomb friction of an evenly pressed disc that only turns is M = ∫ μ p r dA = 2/3 R μ N."""
    moment, _ = dblquad(lambda r, _: r * r / math.pi, 0.0, 2.0 * math.pi, 0.0, 1.0)
    assert pytest.approx(moment, rel=1e-9) == DISC_TURNING_RADIUS


def test_sliding_and_turning_share_the_grip():
    """A foot moves under a body at rest: F = c s/z, M = ρ c ρω/z, z² = s² + ρ²ω²."""
    one = foot(2.0, motion=(-0.3, 0.1, 20.0), radius=0.012, rate=1e5)
    _, [(fx, fy, moment, slid, lost)] = step([one], 1e-3, mass=1e6, inertia=1e6)
    size = math.sqrt(0.3**2 + 0.1**2 + 0.24**2)
    expected = 2.0 * np.array([0.3, -0.1, -0.012 * 0.24]) / size
    assert [fx, fy, moment] == pytest.approx(expected, rel=1e-6)
    assert slid == pytest.approx(math.hypot(0.3, 0.1) * 1e-3, rel=1e-3)
    assert lost == pytest.approx(2.0 * size * 1e-3, rel=1e-3)


@pytest.mark.parametrize('share', [0.5, 1.2])
@pytest.mark.parametrize('turns', [False, True])
def test_a_standing_foot_holds_up_to_its_cap_without_creep(share, turns):
    """Pushed or twisted, it is sheared by force over stiffness, and moves above its cap.

    The torsional stiffness of a pad is k ρ².
    """
    radius, cap, dt, stiffness = 0.012, 3.0, 1e-3, 1e7
    axis, inertia, arm = (2, INERTIA, radius) if turns else (0, MASS, 1.0)
    twist, sheared = STILL, 0.0
    for _ in range(1000):
        motion = [0.0, 0.0, 0.0]
        motion[axis] = sheared / dt
        free = [0.0, 0.0, 0.0]
        free[axis] = twist[axis] + share * cap * arm / inertia * dt
        one = foot(cap, motion=motion, radius=radius, rate=stiffness * dt)
        twist, [pushed] = step([one], dt, tuple(free), tuple(twist))
        sheared = -pushed[axis] / (stiffness * arm**2)
    held = min(share, 1.0) * arm * cap
    assert pushed[axis] == pytest.approx(-held, rel=1e-5)
    assert twist[axis] == pytest.approx((share * arm * cap - held) / inertia, rel=2e-3, abs=8e-3)
    assert sheared == pytest.approx(held / (stiffness * arm**2), rel=2e-2)

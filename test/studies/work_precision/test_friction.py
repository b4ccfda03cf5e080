# SPDX-License-Identifier: Apache-2.0
import math
import random

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import minimize

from ros_pad.contact.resistance import DISC_TURNING_RADIUS
from ros_pad.errors import InvalidInput
from studies.work_precision.friction import Contact, elastic, exact_stick

MASS, INERTIA, GRAVITY = 2.0, 0.03, 9.81
STILL = (0.0, 0.0, 0.0)
STEPS = {
    'elastic': elastic,
    'exact_stick': lambda free, mass, inertia, contacts, dt, start: exact_stick(
        free, mass, inertia, contacts, dt
    ),
}


def contact(cap, lever=(0.0, 0.0), motion=(0.0, 0.0), stiffness=1e6, radius=0.0, spin=0.0):
    foot = Contact(stiffness, radius)
    foot.motion_turn = spin
    foot.cap = cap
    foot.lever_x, foot.lever_y = lever
    foot.motion_x, foot.motion_y = motion
    return foot


def random_step(rng, stiffness=1e7, soles=False):
    """Return a free twist, one to six feet, some without load, and a step, s, all at random."""
    feet = []
    for _ in range(rng.randint(1, 6)):
        cap = 0.0 if rng.random() < 0.07 else rng.uniform(0.05, 8.0)
        speed = rng.choice([0.0, 1e-3, 0.1, 0.5])
        feet.append(
            contact(
                cap,
                (rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25)),
                (speed * rng.uniform(-1, 1), speed * rng.uniform(-1, 1)),
                stiffness,
            )
        )
        if soles:
            feet[-1].turning_radius = rng.uniform(0.002, 0.02)
            feet[-1].motion_turn = rng.choice([0.0, 0.1, 3.0]) * rng.uniform(-1, 1)
    scale = rng.choice([0.0, 0.01, 1.0])
    free = (
        scale * rng.uniform(-0.4, 0.4),
        scale * rng.uniform(-0.4, 0.4),
        scale * rng.uniform(-2.0, 2.0),
    )
    return free, feet, rng.choice([1e-4, 1e-3, 4e-3])


@pytest.mark.parametrize('name', STEPS)
@pytest.mark.parametrize('dt', [0.0, math.nan])
def test_a_step_of_no_time_is_refused(name, dt):
    with pytest.raises(InvalidInput, match=r'dt = .* is not allowed: .* s is needed'):
        STEPS[name](STILL, MASS, INERTIA, [contact(1.0, motion=(0.1, 0.0))], dt, STILL)


def distance(one, other):
    """Return √(v² + ω² I/m) of the difference of two twists, m/s."""
    dx, dy, dw = (a - b for a, b in zip(one, other, strict=True))
    return math.sqrt(dx * dx + dy * dy + dw * dw * INERTIA / MASS)


def rigid_plastic(twist, free, feet, dt):
    """Return the convex function of a rigid-plastic step, J, independently written with NumPy."""
    twist = np.asarray(twist)
    change = twist - free
    levers = np.array([(f.lever_x, f.lever_y) for f in feet])
    motions = np.array([(f.motion_x, f.motion_y) for f in feet])
    turn = twist[2] * np.column_stack([-levers[:, 1], levers[:, 0]])
    slide = twist[:2] + turn + motions
    scrub = [f.turning_radius * (twist[2] + f.motion_turn) for f in feet]
    slip = np.linalg.norm(np.column_stack([slide, scrub]), axis=1)
    caps = np.array([f.cap for f in feet])
    return 0.5 * (MASS * change[:2] @ change[:2] + INERTIA * change[2] ** 2) + dt * caps @ slip


# --- one contact, by hand ---------------------------------------------------------------------


def held(name, dt, share, duration=4.0):
    """Push one foot with a force that grows for 1 s, then is constant; return positions, m."""
    foot = contact(2.0, stiffness=5000.0)
    twist, x, path = STILL, 0.0, []
    for step in range(1, round(duration / dt) + 1):
        free = (twist[0] + min(1.0, step * dt) * share * 2.0 / MASS * dt, 0.0, 0.0)
        twist = STEPS[name](free, MASS, INERTIA, [foot], dt, twist)
        x += twist[0] * dt
        path.append(x)
    return np.array(path), foot


@pytest.mark.parametrize('dt', [1e-2, 1e-3])
def test_elastic_does_not_creep(dt):
    path, foot = held('elastic', dt, 0.8)
    sheared = 0.8 * 2.0 / 5000.0
    assert path[-1] == pytest.approx(sheared, rel=1e-2)
    assert path.max() <= 1.05 * sheared
    late = path[len(path) // 2 :]
    assert np.ptp(late) < 0.01 * sheared
    assert foot.force_x == pytest.approx(-1.6, rel=1e-2)


@pytest.mark.parametrize('dt', [1e-2, 1e-3])
def test_exact_stick_sticks(dt):
    path, foot = held('exact_stick', dt, 0.8)
    assert abs(path[-1]) < 1e-8
    assert foot.force_x == pytest.approx(-1.6, rel=1e-6)


# --- several contacts -------------------------------------------------------------------------


@pytest.mark.parametrize('soles', [False, True])
def test_elastic_feet_are_near_rigid_ones(soles):
    """Twists of random steps differ from those of exact_stick within the error of the formulation.

    A stiff pad moves at up to cap/(k dt) before it slips, here 8e-3 m/s at 1e7 N/m and 0.1 ms.
    Levers amplify that: the factor 40 is enough.
    """
    rng = random.Random(20)
    sticking = sliding = 0
    for _ in range(300):
        free, feet, dt = random_step(rng, soles=soles)
        exact = exact_stick(free, MASS, INERTIA, feet, dt)
        for foot in feet:
            speed = math.hypot(*foot.slip(exact))
            sticking += foot.cap > 0.0 and speed < 1e-7
            sliding += foot.cap > 0.0 and speed > 1e-3
            assert math.hypot(foot.force_x, foot.force_y) <= foot.cap * (1 + 1e-12)
        give = max(foot.cap for foot in feet) / (1e7 * dt)
        assert distance(elastic(free, MASS, INERTIA, feet, dt, free), exact) < 40 * give + 1e-7
        for foot in feet:
            radius = foot.turning_radius
            turning = foot.moment / radius if radius else 0.0
            assert math.hypot(foot.force_x, foot.force_y, turning) <= foot.cap * (1 + 1e-12)
    # Soles that are turned hardly ever stick.
    assert sticking > (5 if soles else 60) and sliding > 150


def test_against_a_general_minimiser():
    """scipy.optimize finds no better twist than exact_stick."""
    rng = random.Random(22)
    for count in range(8):
        free, feet, dt = random_step(rng, soles=count % 2 == 0)
        twist = exact_stick(free, MASS, INERTIA, feet, dt)
        scale = np.array([1.0, 1.0, math.sqrt(MASS / INERTIA)])
        found = minimize(
            lambda q, free=free, feet=feet, dt=dt, scale=scale: (
                1e3 * rigid_plastic(q * scale, free, feet, dt)
            ),
            np.array(free) / scale,
            method='Nelder-Mead',
            options={'xatol': 1e-10, 'fatol': 1e-17, 'maxiter': 4000, 'adaptive': True},
        )
        ours = rigid_plastic(twist, free, feet, dt)
        assert ours <= found.fun / 1e3 + 1e-15
        # By strong convexity ½ m distance² is at most the difference of the function.
        allowed = math.sqrt(2.0 * max(found.fun / 1e3 - ours, 0.0) / MASS)
        assert distance(found.x * scale, twist) <= allowed + 2e-8


def test_exact_stick_reports_when_it_gives_up():
    feet = [contact(1.0, (0.2, 0.1)), contact(1.0, (-0.2, 0.1)), contact(1.0, (0.0, -0.2))]
    with pytest.raises(ArithmeticError, match=r'm/s after 1 sweeps'):
        exact_stick((1e-4, 2e-4, 3e-3), MASS, INERTIA, feet, 0.004, sweeps=1)


# --- forces -----------------------------------------------------------------------------------


@pytest.mark.parametrize('name', STEPS)
def test_newton_and_euler_laws(name):
    """Changes of momentum and angular momentum are the impulses of the reported forces."""
    rng = random.Random(23)
    for _ in range(300):
        free, feet, dt = random_step(rng, soles=True)
        x, y, turn = STEPS[name](free, MASS, INERTIA, feet, dt, free)
        fx = sum(f.force_x for f in feet)
        fy = sum(f.force_y for f in feet)
        moment = sum(f.lever_x * f.force_y - f.lever_y * f.force_x + f.moment for f in feet)
        small = 1e-10
        assert pytest.approx(free[0] + dt * fx / MASS, abs=small) == x
        assert pytest.approx(free[1] + dt * fy / MASS, abs=small) == y
        assert pytest.approx(free[2] + dt * moment / INERTIA, abs=10 * small) == turn


def test_lifted_foot_forgets_its_shear():
    foot = contact(2.0, motion=(-0.1, 0.0), stiffness=1000.0, radius=0.01, spin=1.0)
    elastic(STILL, MASS, INERTIA, [foot], 0.004, STILL)
    assert foot.shear_x != 0.0 and foot.force_x != 0.0
    assert foot.twist != 0.0 and foot.moment != 0.0
    foot.cap = 0.0
    assert elastic(STILL, MASS, INERTIA, [foot], 0.004, STILL) == STILL
    assert (foot.shear_x, foot.shear_y, foot.force_x, foot.force_y, foot.slid) == (0,) * 5
    assert (foot.twist, foot.moment, foot.lost) == (0,) * 3


# --- soles that turn ----------------------------------------------------------------------------


def test_even_disc_turns_against_two_thirds_of_its_radius():
    """Coulomb friction of an evenly pressed disc that only turns is M = ∫ μ p r dA = 2/3 R μ N."""
    moment, _ = dblquad(lambda r, _: r * r / math.pi, 0.0, 2.0 * math.pi, 0.0, 1.0)
    assert pytest.approx(moment, rel=1e-9) == DISC_TURNING_RADIUS


@pytest.mark.parametrize('name', STEPS)
def test_sliding_and_turning_share_the_grip(name):
    """A foot moves under a body at rest: F = c s/z, M = ρ c ρω/z, z² = s² + ρ²ω²."""
    foot = contact(2.0, motion=(-0.3, 0.1), radius=0.012, spin=20.0, stiffness=1e8)
    STEPS[name](STILL, 1e6, 1e6, [foot], 1e-3, STILL)
    size = math.sqrt(0.3**2 + 0.1**2 + 0.24**2)
    expected = 2.0 * np.array([0.3, -0.1, -0.012 * 0.24]) / size
    assert [foot.force_x, foot.force_y, foot.moment] == pytest.approx(expected, rel=1e-6)
    assert foot.slid == pytest.approx(math.hypot(0.3, 0.1) * 1e-3, rel=1e-3)
    assert foot.lost == pytest.approx(2.0 * size * 1e-3, rel=1e-3)


@pytest.mark.parametrize('name', STEPS)
@pytest.mark.parametrize('share', [0.5, 1.2])
def test_twisting_a_standing_foot(name, share):
    """One sole holds a yaw moment up to ρ c; above, the body turns with α = (M - ρ c)/I."""
    radius, cap, dt = 0.012, 3.0, 1e-3
    foot = contact(cap, radius=radius, stiffness=1e7)
    moment, twist = share * radius * cap, STILL
    for _ in range(1000):
        free = (0.0, 0.0, twist[2] + moment / INERTIA * dt)
        twist = STEPS[name](free, MASS, INERTIA, [foot], dt, twist)
    held = min(share, 1.0) * radius * cap
    assert foot.moment == pytest.approx(-held, rel=1e-5)
    assert twist[2] == pytest.approx((moment - held) / INERTIA, rel=1e-3, abs=8e-3)
    if name == 'elastic' and share < 1.0:
        # The torsional stiffness of the pad is k ρ².
        assert foot.twist == pytest.approx(moment / (1e7 * radius**2), rel=2e-2)

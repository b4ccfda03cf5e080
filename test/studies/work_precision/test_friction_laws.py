# SPDX-License-Identifier: Apache-2.0
"""Closed forms of sliding bodies, and the methods compared on many random steps."""

import math
import random

import pytest

from studies.work_precision.friction import Contact, creeping, elastic, exact_stick

pytestmark = pytest.mark.slow

MASS, INERTIA, GRAVITY = 2.0, 0.03, 9.81
STILL = (0.0, 0.0, 0.0)


def foot(cap, lever=(0.0, 0.0), motion=(0.0, 0.0), stiffness=1e7, radius=0.0):
    contact = Contact(stiffness, radius)
    contact.cap = cap
    contact.lever_x, contact.lever_y = lever
    contact.motion_x, contact.motion_y = motion
    return contact


@pytest.mark.parametrize('load', [0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize('dt', [1e-2, 1e-4])
def test_creep_law(load, dt):
    """Pseudo-Huber feet under a share ρ of their cap creep at ε ρ/√(1 - ρ²), at any step."""
    contact = foot(2.0)
    twist = STILL
    for _ in range(60):
        free = (twist[0] + load * 2.0 / MASS * dt, 0.0, 0.0)
        twist = creeping(free, MASS, INERTIA, [contact], dt, twist)
    assert twist[0] == pytest.approx(1e-5 * load / math.sqrt(1.0 - load * load), rel=1e-6)


def random_step(rng):
    """Return a free twist, one to six feet and a step, s: sliding, sticking, without load."""
    feet = []
    for _ in range(rng.randint(1, 6)):
        speed = rng.choice([0.0, 1e-3, 0.1, 0.5])
        feet.append(
            foot(
                0.0 if rng.random() < 0.07 else rng.uniform(0.05, 8.0),
                (rng.uniform(-0.25, 0.25), rng.uniform(-0.25, 0.25)),
                (speed * rng.uniform(-1, 1), speed * rng.uniform(-1, 1)),
            )
        )
    scale = rng.choice([0.0, 0.01, 1.0])
    free = (
        scale * rng.uniform(-0.4, 0.4),
        scale * rng.uniform(-0.4, 0.4),
        scale * rng.uniform(-2.0, 2.0),
    )
    return free, feet, rng.choice([1e-4, 1e-3, 4e-3])


def distance(one, other):
    dx, dy, dw = (a - b for a, b in zip(one, other, strict=True))
    return math.sqrt(dx * dx + dy * dy + dw * dw * INERTIA / MASS)


def test_exact_stick_against_newton():
    """In 20 000 random steps twists differ by no more than the two friction laws allow.

    If two potentials differ by at most δ, and the function is strongly convex with the mass m, its
    minimisers differ by ½ m d² <= δ. Pseudo-Huber differs from |s| by ε: d² <= 2 dt ε Σc/m.
    """
    rng, tolerance, creep = random.Random(0), 1e-7, 1e-7
    worst = mean = 0.0
    for _ in range(20000):
        free, feet, dt = random_step(rng)
        exact = exact_stick(free, MASS, INERTIA, feet, dt, tolerance=tolerance)
        smooth = creeping(free, MASS, INERTIA, feet, dt, exact, creep=creep)
        bound = math.sqrt(2.0 * dt * creep * sum(f.cap for f in feet) / MASS) + tolerance
        apart = distance(exact, smooth)
        assert apart <= bound
        worst, mean = max(worst, apart / bound), mean + apart / 20000
    # The bound is not far too large, and the mean difference is much smaller.
    assert worst > 1e-3
    assert mean < creep


def test_shear_against_exact_stick():
    """Potentials of pads differ from those of rigid feet by c²/(2 k dt): d² <= Σ c²/(k m)."""
    rng = random.Random(1)
    for _ in range(2000):
        free, feet, dt = random_step(rng)
        exact = exact_stick(free, MASS, INERTIA, feet, dt)
        bound = math.sqrt(sum(f.cap**2 for f in feet) / (1e7 * MASS)) + 1e-8
        assert distance(elastic(free, MASS, INERTIA, feet, dt, exact), exact) <= bound

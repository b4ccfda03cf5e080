# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.contact.film import Film, film_thickness
from ros_pad.contact.resistance import Foot

FOOT = Foot.load('large37')
VISCOSITY = 1.0e-3


def squeezed(start, pressure, radius, time, viscosity):
    """Return the film, m, by integrating the Stefan-Reynolds equation dh/dt = -2 p h³/(3 η a²)."""

    def thinning(_, log_h):
        return -2.0 * pressure * np.exp(2.0 * log_h) / (3.0 * viscosity * radius**2)

    solution = solve_ivp(
        thinning, (0.0, time), [math.log(start)], method='LSODA', rtol=1e-11, atol=1e-12
    )
    assert solution.success
    return math.exp(solution.y[0, -1])


def dome_limit(load, pads, pressure, time):
    """Return the film, m, that a constant load leaves under domes after a long time."""
    return math.sqrt(3.0 * VISCOSITY * load / (4.0 * math.pi * pads * time)) / pressure


# --- film_thickness ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    'start, pressure, radius, time, viscosity',
    [
        (3e-4, 7.5e3, 17e-3, 0.5, 1e-3),
        (3e-4, 75e3, 0.5e-3, 0.3, 1e-3),
        (5e-3, 1e3, 0.01, 30.0, 1.4),
    ],
)
def test_agrees_with_the_integrated_equation(start, pressure, radius, time, viscosity):
    expected = squeezed(start, pressure, radius, time, viscosity)
    assert expected < 0.9999 * start
    found = film_thickness(start, pressure, radius, time, viscosity)
    assert found == pytest.approx(expected, rel=1e-7)


# --- Film -------------------------------------------------------------------------------------


def stand(film, load_of, pressure, duration, dt, on_domes=True):
    for step in range(1, round(duration / dt) + 1):
        load = load_of(step * dt)
        films = film.drain(load if on_domes else 0.0, 0.0 if on_domes else load, pressure, dt)
    return films


@pytest.mark.parametrize('steps', [1, 7])
def test_constant_load_on_domes_whatever_the_steps(steps):
    load, pressure, duration = 6.8, 75e3, 0.3
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    for _ in range(steps):
        under_domes, under_sole = film.drain(load, 0.0, pressure, duration / steps)
    radius = math.sqrt(load / (FOOT.pads * math.pi * pressure))
    expected = squeezed(3e-4, pressure, radius, duration, VISCOSITY)
    assert under_domes == pytest.approx(expected, rel=1e-7)
    # A start of 0.3 mm is so thick that the closed form without it holds.
    assert under_domes == pytest.approx(dome_limit(load, FOOT.pads, pressure, duration), rel=1e-5)
    assert under_sole == pytest.approx(3e-4)


def test_constant_load_on_the_flat_sole():
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    under_domes, under_sole = stand(film, lambda _: 6.8, 0.0, 0.5, 0.004, on_domes=False)
    area = math.pi * 0.017**2
    expected = squeezed(3e-4, 6.8 / area, 0.017, 0.5, VISCOSITY)
    assert under_sole == pytest.approx(expected, rel=1e-7)
    assert under_domes == pytest.approx(3e-4)


def test_growing_contact_averages_over_its_area():
    """For a steadily growing load, integrate d(A/h²)/dt = A 4p/(3ηb²) + (dA/dt)/h0²."""
    pressure, rate, thick = 75e3, 40.0, 2e-6
    film = Film(FOOT, VISCOSITY)
    film.touch_down(thick)
    under_domes, _ = stand(film, lambda time: rate * time, pressure, 0.2, 1e-4)

    def weighted(time, _):
        area = rate * time / pressure
        squeeze = 4.0 * pressure / (3.0 * VISCOSITY) * FOOT.pads * math.pi / area
        return [area * squeeze + rate / pressure / thick**2]

    solution = solve_ivp(weighted, (1e-9, 0.2), [0.0], rtol=1e-9, atol=1e-9)
    expected = math.sqrt(rate * 0.2 / pressure / solution.y[0, -1])
    assert under_domes == pytest.approx(expected, rel=1e-3)

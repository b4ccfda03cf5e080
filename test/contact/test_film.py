# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ros_pad.contact import film as films_of
from ros_pad.contact.dome import inflate
from ros_pad.contact.film import Film, film_thickness
from ros_pad.contact.resistance import Foot

FOOT = Foot.load('large37')
VISCOSITY = 1.0e-3
REFERENCE = pathlib.Path(__file__).parents[1] / 'reference'


def squeezed(start, pressure, radius, time, viscosity):
    """Return the film, m, by integrating the Stefan-Reynolds equation dh/dt = -2 p h³/(3 η a²)."""

    def thinning(_, log_h):
        return -2.0 * pressure * np.exp(2.0 * log_h) / (3.0 * viscosity * radius**2)

    solution = solve_ivp(
        thinning, (0.0, time), [math.log(start)], method='LSODA', rtol=1e-11, atol=1e-12
    )
    assert solution.success
    return math.exp(solution.y[0, -1])


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


def dry(film):
    return math.exp(-((film / FOOT.critical_film) ** FOOT.film_exponent))


def history(row, dt):
    """Return the dry shares of a load history with steps of dt, s."""
    film, pressure = Film(FOOT, row['viscosity_Pa_s']), row['pressure_Pa']
    film.touch_down(row['initial_film_m'])
    times, loads = FOOT.pads * np.array(row['force']).T / [[FOOT.pads], [1.0]]
    film.drain(loads[0], 0.0, pressure, 1e-6)
    shares = {}
    for step in range(1, round(row['times_s'][-1] / dt) + 1):
        load = float(np.interp(step * dt, times, loads))
        shares[round(step * dt, 6)] = dry(film.drain(load, 0.0, pressure, dt)[0])
    return [shares[time] for time in row['times_s']]


def test_load_histories():
    """Beside an elastohydrodynamic film on 300 rings, in points of dry share."""
    rows = json.loads((REFERENCE / 'landing.json').read_text())
    assert len(rows) == 12
    errors = [
        100.0 * (found - true)
        for row in rows
        for found, true in zip(history(row, 1e-3), row['dry_share'], strict=True)
    ]
    assert np.sqrt(np.mean(np.square(errors))) < 3.0
    assert np.abs(errors).max() < 8.0


def test_what_a_growing_contact_lays():
    """By hand: 0.3215 R (24 η V/(p R))^⅔ at half of the radius, for a load in 10 ms."""
    pressure, load, sphere = 70e3, 0.185, float(inflate(FOOT.pad, 70e3).sphere_radius)
    radius = math.sqrt(0.25 * load / math.pi / pressure)
    speed = 0.25 * load / pressure / 2.5e-3 / (2.0 * math.pi * radius)
    laid = 0.3215 * sphere * (24.0 * VISCOSITY * speed / pressure / sphere) ** (2.0 / 3.0)
    assert laid == pytest.approx(0.372e-6, rel=0.01)  # 0.374e-6 by the elastohydrodynamic film
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    film.drain(0.25 * FOOT.pads * load, 0.0, pressure, 2.5e-3)
    before = dry(film.drain(0.25 * FOOT.pads * load, 0.0, pressure, 1e-9)[0])
    after = dry(film.drain(0.26 * FOOT.pads * load, 0.0, pressure, 1e-4)[0])
    assert (0.26 * after - 0.25 * before) / 0.01 == pytest.approx(dry(laid), rel=0.02)


def test_steps_of_any_length():
    """Growth and rest in one step or in many."""
    shares = []
    for steps in (1, 10):
        film = Film(FOOT, VISCOSITY)
        film.touch_down(3e-4)
        for step in range(1, steps + 1):
            film.drain(6.8 * step / steps, 0.0, 75e3, 0.01 / steps)
        for _ in range(steps):
            found = film.drain(6.8, 0.0, 75e3, 0.3 / steps)[0]
        shares.append(dry(found))
    assert shares[0] == pytest.approx(shares[1], abs=0.01)


def landed(change=0.0, slip=0.0):
    """Return the dry share 0.3 s after a landing within 1 ms.

    Until then the load changes by a share, and in one step the foot slips, m/s.
    """
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    for step in range(301):
        load = 6.8 * (1.0 + change * step / 300)
        found = film.drain(load, 0.0, 75e3, 1e-3, slip if step == 50 else 0.0)[0]
    return dry(found)


@pytest.mark.parametrize('change', [1e-12, 1e-3, -1e-12, -1e-3])
def test_levelling_goes_on_while_the_load_creeps(change):
    assert landed(change) == pytest.approx(landed(), abs=0.01)


def test_what_grows_slowly_is_dry():
    """By hand: a tenth of the contact at the end, nearly all of it dry, beside the wet rest."""
    assert landed(0.1 / 0.9) == pytest.approx(0.9 * landed() + 0.1, abs=0.04)


@pytest.mark.parametrize('slip', [1e-9, 1e-3])
def test_a_little_slip_changes_little(slip):
    assert landed(slip=slip) == pytest.approx(landed(), abs=0.01)
    assert landed(slip=0.5) > landed() + 0.01


def test_loads_that_come_evenly_to_domes_and_sole():
    """``stand`` beside small steps of the same loads; the film under the sole is exact."""
    film, films = Film(FOOT, VISCOSITY), []
    film.touch_down(3e-5)
    films.append(film.stand(3.0, 3.0, 75e3, 0.1))
    film.touch_down(3e-5)
    for step in range(1000):
        since = 1e-4 * (step + 0.5)  # loads of the sole act through a step, those of domes after
        shares = [films_of.landed(time, 0.1) for time in (since + 5e-5, since)]
        found = film.drain(3.0 * shares[0], 3.0 * shares[1], 75e3, 1e-4)
    films.append(found)
    assert dry(films[0][0]) == pytest.approx(dry(films[1][0]), abs=0.02)
    assert films[0][1] == pytest.approx(films[1][1], rel=0.02)


@pytest.mark.parametrize('load', [5e-324, 1e-300, 1e-9])
def test_a_load_that_grows_from_almost_nothing(load):
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    assert 0.0 <= film.drain(load, 0.0, 75e3, 1e-3)[0] <= 3e-4
    assert film.drain(6.8, 0.0, 75e3, 1e-3)[0] > 1e-7


def test_lift_off_and_dry_ground():
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    first = stand(film, lambda time: 600.0 * time, 75e3, 0.01, 1e-3)
    film.drain(0.0, 0.0, 75e3, 0.1)
    again = stand(film, lambda time: 600.0 * time, 75e3, 0.01, 1e-3)
    assert again == pytest.approx(first, rel=1e-12)
    film.touch_down(0.0)
    assert film.drain(6.8, 1.0, 75e3, 0.1) == (0.0, 0.0)


def test_constant_load_on_the_flat_sole():
    film = Film(FOOT, VISCOSITY)
    film.touch_down(3e-4)
    under_domes, under_sole = stand(film, lambda _: 6.8, 0.0, 0.5, 0.004, on_domes=False)
    area = math.pi * 0.017**2
    expected = squeezed(3e-4, 6.8 / area, 0.017, 0.5, VISCOSITY)
    assert under_sole == pytest.approx(expected, rel=1e-7)
    assert under_domes == 0.0  # no domes

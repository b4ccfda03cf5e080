# SPDX-License-Identifier: Apache-2.0
"""Soft squeeze films beside Stefan's and Reynolds': time against error, and shapes.

Writes film.png and .json, and prints tables, the last of how fast simulated walks load their feet
(L2, needs mujoco). The pad is the thesis' (1.5 mm), in water 0.3 mm
deep: flat under 0.3 N, and as a dome of 75 kPa under 0.08 to 0.285 N. True films are extrapolated
from 150 and 300 rings with a tolerance of 1e-8.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact import (
    LARGE_PAD,
    HalfSpace,
    Membrane,
    Squeezed,
    film_thickness,
    inflate,
    squeeze,
    trapped_film,
)
from ros_pad.contact.film import WATER_VISCOSITY, Film
from ros_pad.contact.resistance import Foot
from ros_pad.simulation import Scene
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.drawing import BLUE, GREEN, ORANGE, PALE, STYLE, VERMILION
from studies.samples import runs
from studies.work_precision.comparison import Method, Problem, Result, run

RADIUS, LOAD, DEPTH = 1.5e-3, 0.3, 3e-4  # m, N, m
MEAN = LOAD / (math.pi * RADIUS**2)
CRITICAL = 0.5e-6  # m, as in config/feet
AIR = 75e3  # Pa
SPHERE = float(inflate(LARGE_PAD, AIR).sphere_radius)
SOLES = {
    'E = 29.5 kPa, thesis appendix': 4.0 / 3.0 * 29.5e3,
    'Dragon Skin 10 as in the file': 4.0 * 2.0 * 26258.0,
    'Dragon Skin 10, times 1.88': 3.95e5,
    'Dragon Skin 30 as in the file': 4.0 * 2.0 * 141008.0,
    '4 MPa': 4e6,
    '40 MPa': 4e7,
    '400 MPa': 4e8,
}
"""Reduced moduli, Pa."""

WALKS, SEEDS, CYCLES, RATE = ('hexapod_patches', 'quadruped_patches'), (0, 1, 2), 20, 1000.0  # Hz
BOUNCE, SHORTEST = 0.05, 0.2  # s off the floor within a stance, s that a stance lasts at least
HISTORIES, STEP = command.ROOT / 'test' / 'reference' / 'landing.json', 1e-3  # s

TIMES = (1.0, 3.0)  # s, of the thesis' drag
RIM = np.geomspace(1e-6, 10.0, 141)


# --- time against error --------------------------------------------------------------------------


def sole(modulus: float, time: Any, rings: int = 200, tolerance: float = 1e-6) -> Squeezed:
    """Return the film under the flat pad."""
    surface = HalfSpace(RADIUS, modulus)
    return squeeze(surface, DEPTH, time, load=LOAD, rings=rings, tolerance=tolerance)


def contact(load: float) -> float:
    """Return the contact radius of the dome under a load, m."""
    return math.sqrt(load / math.pi / AIR)


def dome(load: float, time: Any, rings: int = 200, tolerance: float = 1e-6) -> Squeezed:
    """Return the film under the dome."""
    surface = Membrane(1.5 * contact(load), 0.5 * AIR * SPHERE, AIR)
    return squeeze(surface, DEPTH, time, load=load, rings=rings, tolerance=tolerance)


def sole_mean(modulus: float, time: float, rings: int, tolerance: float = 1e-6) -> float:
    """Return the mean film under the flat pad, m."""
    return float(sole(modulus, [time], rings, tolerance).mean[0])


def dome_middle(load: float, time: float, rings: int, tolerance: float = 1e-6) -> float:
    """Return the film in the middle under the dome, m."""
    return float(dome(load, [time], rings, tolerance).thickness[0, 0])


def dome_dimple(load: float, time: float) -> float:
    """Return the film, m, in the middle of a dome's contact, as a limit for long times.

    The dimple is a paraboloid, which drains through its rim (Frankel and Mysels, J. Phys. Chem.
    66 (1962) 190); the outer curvature of a rim under constant tension, by d³H/dx³ = 1/H³ and an
    inner slope of 1, is 1.20985.
    """
    drained = 32.0 * 1.20985 * AIR * SPHERE**2 * time
    return (3.0 * WATER_VISCOSITY * contact(load) ** 6 / drained) ** 0.25


Solved = Callable[..., float]


def problem(name: str, film: Solved, inputs: dict[str, list[float]]) -> Problem:
    """Return cases with their true films."""
    cases = list(zip(*inputs.values(), strict=True))
    truth = []
    for case in command.each(cases, f'true films, {name}', 'film'):
        coarse, fine = (film(*case, rings, 1e-8) for rings in (150, 300))
        truth.append(fine + (fine - coarse) / 3.0)
    columns = {key: np.array(values) for key, values in inputs.items()}
    return Problem(name, columns, np.array(truth), np.ones(len(cases), dtype=bool), math.inf)


def soft_methods(film: Solved) -> list[Method]:
    """Return the soft film with more and more rings, and with loose time steps."""
    methods = [
        Method(f'{rings} rings', lambda x, time, n=rings: film(x, time, n), ours=True)
        for rings in (25, 50, 100, 200)
    ]
    loose = Method('50 rings, tolerance 0.0001', lambda x, t: film(x, t, 50, 1e-4), ours=True)
    return [*methods, loose]


def compare() -> list[Result]:
    """Return time and error of each method."""
    moduli = [each for each in SOLES.values() if each > 2e5][::2]
    flat = problem(
        'flat pad, mean film after 1 s',
        sole_mean,
        {'modulus_pa': moduli, 'time_s': [1.0] * len(moduli)},
    )
    flat_methods = [
        Method('Stefan-Reynolds', lambda _, time: film_thickness(DEPTH, MEAN, RADIUS, time)),
        Method('lens of uniform pressure', lambda modulus, _: trapped_film(RADIUS, modulus, MEAN)),
        *soft_methods(sole_mean),
    ]
    loads = [0.08, 0.19, 0.285]
    domed = problem(
        'dome of 75 kPa, film in the middle after 0.3 s',
        dome_middle,
        {'load_n': loads, 'time_s': [0.3] * len(loads)},
    )
    domed_methods = [
        Method(
            'Stefan-Reynolds', lambda load, time: film_thickness(DEPTH, AIR, contact(load), time)
        ),
        Method('limit for long times', dome_dimple),
        *soft_methods(dome_middle),
    ]
    pairs = ((flat, flat_methods), (domed, domed_methods))
    results = []
    for each, methods in command.each(pairs, 'methods', 'problem'):
        results += run(each, methods, 'Stefan-Reynolds')
    return results


# --- the thesis' pad, and the rule ---------------------------------------------------------------


def sensitivity() -> list[dict[str, Any]]:
    """Return for each modulus what the film is and when the rim closes."""
    rows = []
    for name, modulus in command.each(list(SOLES.items()), 'soles', 'sole'):
        times = np.union1d(RIM, TIMES)
        film = sole(modulus, times)
        at = np.isin(times, TIMES)
        rim = film.thickness.min(axis=1)
        rigid = np.array(film_thickness(DEPTH, MEAN, RADIUS, TIMES))
        rows.append(
            {
                'sole': name,
                'modulus_pa': modulus,
                'status': film.status,
                'lens_mean_m': trapped_film(RADIUS, modulus, MEAN),
                'mean_m': film.mean[at].tolist(),
                'middle_m': film.thickness[at, 0].tolist(),
                'rim_closed_s': float(np.interp(-CRITICAL, -rim, times)),
                'dry': film.dry_share(CRITICAL)[at].tolist(),
                'rigid_m': rigid.tolist(),
                'rigid_dry': np.exp(-((rigid / CRITICAL) ** 2)).tolist(),
            }
        )
    return rows


def dry_shares(film: Squeezed, radius: float) -> np.ndarray:
    """Return the dry share of a contact of a radius, m, at each time."""
    inside = film.radius < radius
    dry = np.exp(-((film.thickness[:, inside] / CRITICAL) ** 2))
    return np.asarray(np.average(dry, axis=1, weights=film.area[inside]))


def domes() -> list[dict[str, Any]]:
    """Return the film under domes after 0.3 and 1 s."""
    rows, times = [], [0.3, 1.0]
    for load in command.each([0.08, 0.19, 0.285], 'domes', 'dome'):
        film, b = dome(load, times), contact(load)
        rigid = np.array(film_thickness(DEPTH, AIR, b, times))
        rows.append(
            {
                'load_n': load,
                'contact_m': b,
                'middle_m': film.thickness[:, 0].tolist(),
                'rim_m': film.thickness.min(axis=1).tolist(),
                'dry': dry_shares(film, b).tolist(),
                'rigid_m': rigid.tolist(),
                'rigid_dry': np.exp(-((rigid / CRITICAL) ** 2)).tolist(),
            }
        )
    return rows


def rises() -> list[dict[str, Any]]:
    """Return the film 1 s after a load that has grown linearly in some time, s."""
    rows = []
    for rise in command.each([0.0, 1e-3, 1e-2, 0.1, 1.0], 'rises', 'rise'):
        time, b = [rise + 1.0], contact(0.19)
        flat = squeeze(HalfSpace(RADIUS, 3.95e5), DEPTH, time, load=LOAD, rise=rise, rings=100)
        surface = Membrane(1.5 * b, 0.5 * AIR * SPHERE, AIR)
        domed = squeeze(surface, DEPTH, time, load=0.19, rise=rise, rings=150)
        inside = domed.radius < b
        mean = np.average(domed.thickness[0, inside], weights=domed.area[inside])
        rows.append(
            {
                'rise_s': rise,
                'flat_mean_m': float(flat.mean[0]),
                'flat_dry': float(flat.dry_share(CRITICAL)[0]),
                'dome_mean_m': float(mean),
                'dome_dry': float(dry_shares(domed, b)[0]),
            }
        )
    return rows


def loaded(row: dict[str, Any], step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return steps of a load history, s, and its loads, N."""
    steps = np.arange(1, round(row['times_s'][-1] / step) + 1) * step
    return steps, np.interp(steps, *np.array(row['force']).T)


def reduced(row: dict[str, Any], step: float) -> np.ndarray:
    """Return the dry share after each step of a load history, by the film of walks."""
    foot, pressure = Foot.load('large37'), row['pressure_Pa']
    film = Film(foot, row['viscosity_Pa_s'])
    film.touch_down(row['initial_film_m'])
    film.drain(foot.pads * row['force'][0][1], 0.0, pressure, 1e-6)
    loads = (foot.pads * loaded(row, step)[1]).tolist()
    return _dry(np.array([film.drain(load, 0.0, pressure, step)[0] for load in loads]))


def rigid(row: dict[str, Any], step: float) -> np.ndarray:
    """Return the same by a rigid disc."""
    square = loaded(row, step)[1] / math.pi / row['pressure_Pa']
    growth = 4.0 * row['pressure_Pa'] * step / (3.0 * row['viscosity_Pa_s'] * square)
    return _dry((row['initial_film_m'] ** -2 + np.cumsum(growth)) ** -0.5)


def shares(row: dict[str, Any], film: Callable[..., np.ndarray], step: float) -> np.ndarray:
    """Return the dry shares of a load history at its times, by one of the films."""
    return np.interp(row['times_s'], loaded(row, step)[0], film(row, step))


def histories() -> list[dict[str, Any]]:
    """Return dry shares of load histories, by the film of walks and by rigid discs.

    Beside those of an elastohydrodynamic film on 300 even rings, made outside this project; and
    the time of a step, s.
    """
    rows = []
    for row in json.loads(HISTORIES.read_text(encoding='utf-8')):
        start = perf_counter()
        curves = {'reduced': reduced(row, STEP)}
        taken = (perf_counter() - start) / len(curves['reduced'])
        curves['rigid'] = rigid(row, STEP)
        steps, times = loaded(row, STEP)[0], row['times_s']
        rows.append(
            {key: row[key] for key in ('name', 'times_s', 'dry_share')}
            | {key: np.interp(times, steps, values).tolist() for key, values in curves.items()}
            | {'curves': {key: values[::4].tolist() for key, values in curves.items()}}
            | {'step_s': taken}
        )
    return rows


def squeezed(row: dict[str, Any], rings: int) -> np.ndarray:
    """Return the dry shares of a load that grows linearly and stays, by :func:`squeeze`."""
    pressure, (rise, load) = row['pressure_Pa'], row['force'][-2]
    outer, times = 1.6 * math.sqrt(load / math.pi / pressure), row['times_s']
    surface = Membrane(outer, 0.5 * pressure * row['sphere_radius_m'], pressure)
    film = squeeze(surface, row['initial_film_m'], times, load, rise=rise, rings=rings)
    areas = np.interp(times, *np.array(row['force']).T) / pressure
    ends = np.cumsum(film.area)
    inside = np.clip(areas[:, None] - (ends - film.area), 0.0, film.area)
    return np.asarray((_dry(film.thickness) * inside).sum(1) / areas)


def costs() -> list[dict[str, Any]]:
    """Return time, for 0.3 s of one dome, and errors of the dry share, of every film.

    Over the histories whose load grows linearly and stays.
    """
    known = json.loads(HISTORIES.read_text(encoding='utf-8'))
    ramps = [row for row in known if len(row['force']) < 4]
    films: list[tuple[str, Callable[..., Any], tuple[Any, ...]]] = [
        *((f'film of walks, {ms} ms', shares, (reduced, 1e-3 * ms)) for ms in (1, 2, 4)),
        ('rigid discs, 1 ms', shares, (rigid, STEP)),
        *((f'{rings} rings', squeezed, (rings,)) for rings in (25, 50, 100)),
    ]
    rows = []
    for name, film, values in command.each(films, 'films', 'film'):
        start = perf_counter()
        errors = np.concatenate([film(row, *values) - row['dry_share'] for row in ramps])
        taken = (perf_counter() - start) / len(ramps)
        rows.append(
            {
                'film': name,
                'time_s': taken,
                'rms': float(np.sqrt(np.mean(errors**2))),
                'worst': float(abs(errors).max()),
            }
        )
    return rows


def _dry(film: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-((film / CRITICAL) ** 2)))


def rise_times(force: np.ndarray, period: float) -> list[tuple[float, float]]:
    """Return for each whole stance of a foot the times from 10 to 50 and to 90 % of its load, s.

    The load of a stance is its median; between samples it is taken as linear.
    """
    found = []
    for start, stop in runs(force > 0.0, round(BOUNCE / period)):
        if start == 0 or stop == len(force) or (stop - start) * period < SHORTEST:
            continue
        own = force[start - 1 : stop] / np.median(force[start:stop])
        after = [int(np.argmax(own >= share)) for share in (0.1, 0.5, 0.9)]
        at = [
            period * (k - 1 + (share - own[k - 1]) / (own[k] - own[k - 1]))
            for k, share in zip(after, (0.1, 0.5, 0.9), strict=True)
        ]
        found.append((at[1] - at[0], at[2] - at[0]))
    return found


def landings() -> list[dict[str, Any]]:
    """Return how fast simulated walks load their feet on domes: 5, 50 and 95 % of stances."""
    rows = []
    for name in command.each(WALKS, 'landings', 'scene'):
        scene = replace(Scene.load(name), cycles=CYCLES)
        scene = replace(scene, sensors=replace(scene.sensors, rate=RATE))
        found = []
        for seed in SEEDS:
            loop = ClosedLoop(scene, 'dome', seed, fidelity='L2')
            force = np.array([[f.force[2] for f in loop.robot.feet] for _ in loop.walk()])
            for leg in force.T:
                found += rise_times(leg, 1.0 / RATE)
        half, most = np.quantile(found, (0.05, 0.5, 0.95), axis=0).T.tolist()
        rows.append({'scene': name, 'stances': len(found), 'half_s': half, 'rise_s': most})
    return rows


# --- picture and tables --------------------------------------------------------------------------


def draw(document: dict[str, Any], results: Sequence[Result]) -> Figure:
    """Return the picture: time against error, shapes, and dry shares of load histories."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8.6, 10.2), layout='constrained')
        at = figure.subplot_mosaic('aaabbb;cccddd;eeffgg')
        above, below = (at['a'], at['b']), (at['c'], at['d'])
        names = list(dict.fromkeys(result.problem for result in results))
        for panel, name in zip(above, names, strict=True):
            _work(panel, [result for result in results if result.problem == name])
        _shapes(below[0], sole(3.95e5, [1e-4, 1e-3, 1e-2, 1.0]), RADIUS, MEAN)
        below[0].set_title('flat pad of Dragon Skin 10, times 1.88, under 0.3 N')
        _shapes(below[1], dome(0.19, [1e-3, 1e-2, 0.1, 1.0]), contact(0.19), AIR)
        below[1].set(title='dome of 75 kPa under 0.19 N', ylim=(3e-2, 1e3))
        _histories(at['e'], at['f'], document['histories'])
        _costs(at['g'], document['costs'])
    return figure


def _histories(left: Any, right: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Draw dry shares after loads that came in a time, and in a stance of a walk."""
    ramps = [row for row in rows if row['name'].startswith('ramp')]
    rises = [float(row['name'].split()[1]) for row in ramps]
    colours = {'reduced': BLUE, 'rigid': VERMILION}
    words = {'reduced': 'film of walks', 'rigid': 'rigid discs'}
    for key, colour in colours.items():
        left.plot(rises, [row[key][-1] for row in ramps], 'o-', color=colour, label=words[key])
        curve = rows[-1]['curves'][key]
        right.plot(4e3 * STEP * np.arange(len(curve)), curve, color=colour)
    left.plot(rises, [row['dry_share'][-1] for row in ramps], 'kx', label='elastohydrodynamic')
    right.plot(1e3 * np.array(rows[-1]['times_s']), rows[-1]['dry_share'], 'kx')
    left.set(xscale='log', ylim=(0, 1), xlabel='time in which the load comes (ms)')
    left.set(ylabel='dry share after 0.3 s', title='dome of 70 kPa under 0.185 N')
    right.set(ylim=(0, 1), xlabel='time in stance (ms)', title='a stance of hexapod_patches')
    left.legend(frameon=False, fontsize=7)


def _costs(panel: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Draw time against error of the dry share."""
    for row in rows:
        walks, rings = row['film'].startswith('film'), 'rings' in row['film']
        colour = BLUE if walks else GREEN if rings else VERMILION
        x, low, high = 1e3 * row['time_s'], 100.0 * row['rms'], 100.0 * row['worst']
        panel.plot([x, x], [low, high], '-_', color=colour, lw=1.2)
        panel.plot(x, low, 'o', color=colour, ms=5)
        words = row['film'].removeprefix('film of walks, ')
        panel.annotate(words, (x, low), (-5 if rings else 5, -2), textcoords='offset points',
                       ha='right' if rings else 'left', fontsize=6.5, color=colour)  # fmt: skip
    panel.set(xscale='log', yscale='log', title='six loads that rise and stay')
    panel.set(xlabel='time for 0.3 s of a film (ms)', ylabel='error of dry share, points')
    panel.margins(x=0.2, y=0.15)


def _work(panel: Any, results: Sequence[Result]) -> None:
    panel.set(xscale='log', yscale='log', title=results[0].problem)
    panel.set(xlabel='time for one film (ms)', ylabel='relative error, median to worst')
    for result in results:
        loose = 'tolerance' in result.method
        colour = ORANGE if loose else GREEN if result.ours else VERMILION
        x, low, high = 1e-3 * result.us_per_solve, result.median_error, result.error
        panel.plot([x, x], [low, high], '-_', color=colour, lw=1.2)
        panel.plot(x, low, 'o', color=colour, ms=5)
        panel.annotate(
            result.method,
            (x, low),
            (-4, 4) if loose else (6, -2),
            textcoords='offset points',
            ha='right' if loose else 'left',
            fontsize=6.5,
            color=colour,
        )
    panel.margins(x=0.3, y=0.15)
    panel.grid(color=PALE, alpha=0.3, lw=0.5)


def _shapes(panel: Any, film: Squeezed, radius: float, pressure: float) -> None:
    colours = (PALE, ORANGE, BLUE, GREEN)
    for row, (time, colour) in enumerate(zip(film.time, colours, strict=True)):
        panel.plot(1e3 * film.radius, 1e6 * film.thickness[row], color=colour, label=f'{time:g} s')
        rigid = 1e6 * float(film_thickness(DEPTH, pressure, radius, float(time)))
        panel.plot([0.0, 1e3 * radius], [rigid, rigid], ':', color=colour)
    panel.set(yscale='log', xlabel='radius (mm)', ylabel='film (µm); dotted: Stefan-Reynolds')
    panel.legend(frameon=False, fontsize=7)


def main(words: Sequence[str]) -> int:
    """Measure, print and draw."""
    parser = command.parser('film', __doc__)
    command.add_out(parser)
    options = parser.parse_args(words)
    results = compare()
    document = {
        'rows': [vars(result) for result in results],
        'soles': sensitivity(),
        'domes': domes(),
        'rises': rises(),
        'landings': landings(),
        'histories': histories(),
        'costs': costs(),
    }
    figure = draw(document, results)
    kept = command.write(options.out, 'film', document, {'film': figure})
    parts = ('rows', 'soles', 'domes', 'rises', 'landings', 'histories', 'costs')
    texts = (command.listed(document[part], f'\n{part}') for part in parts)
    command.show(options, kept, '\n'.join(texts))
    return 0

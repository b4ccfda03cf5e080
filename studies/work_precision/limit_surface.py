# SPDX-License-Identifier: Apache-2.0
"""Compare ellipsoids of force and yaw moment with friction summed over the pressure of a contact.

Each point of a contact resists against its own velocity in proportion to its pressure. Summed
over a fine quadrature this gives the force F and the moment M of a sole that slides and turns, the
limit surface. The simulator takes the ellipsoid |(F, M/ρ)| = c with ρ = 2/3 of the sole's radius.

Writes limit_surface.json and .png.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact.dome import press
from ros_pad.contact.layout import Layout
from ros_pad.contact.resistance import DISC_TURNING_RADIUS, DOMED, Foot
from studies import command
from studies.drawing import BLACK, BLUE, ORANGE, SKY, STYLE, VERMILION

FEET = ('large19', 'large37', 'large331', 'small217')
FINE, COARSE = 200, 24
"""Rings of the quadrature of a disc that is alone, and of each disc of many; sectors are twice."""

ANGLES, DIRECTIONS = 91, (0.0, 15.0, 30.0)
"""Mixtures of sliding and turning, and directions of sliding, °, that are tried."""

Force = Callable[[np.ndarray], np.ndarray]


class Patch(NamedTuple):
    """A contact: points (m) with their share of the load, and a radius of the whole, m.

    ``turning`` is the ρ that the simulator takes.
    """

    points: np.ndarray
    shares: np.ndarray
    radius: float
    turning: float

    @property
    def own_turning(self) -> float:
        """Mean distance of the pressure from the middle, m: the moment of turning over the cap."""
        return float(self.shares @ np.hypot(*self.points.T))


# --- contacts ------------------------------------------------------------------------------------


def disc(
    radius: float, rings: int, pressure: str = 'even', middle: Sequence[float] = (0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """Return points and shares of a disc: Gauss' rule along the radius, equal sectors around it.

    The pressure is ``even``, or that of a sphere by ``hertz``, √(1 - r²/R²).
    """
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    r = 0.5 * (nodes + 1.0)
    shares = weights * r * (1.0 if pressure == 'even' else np.sqrt(1.0 - r * r))
    turn = 2.0 * math.pi * (np.arange(2 * rings) + 0.5) / (2 * rings)
    points = radius * np.stack([np.outer(r, np.cos(turn)), np.outer(r, np.sin(turn))], axis=-1)
    spread = np.repeat(shares, 2 * rings)
    return points.reshape(-1, 2) + np.asarray(middle), spread / spread.sum()


def many(places: np.ndarray, radius: float, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and shares of equal, evenly pressed discs that share the load."""
    points, shares = disc(radius, rings)
    spread = np.tile(shares, len(places)) / len(places)
    return (places[:, None] + points[None]).reshape(-1, 2), spread


def domes(foot: Foot, rings: int) -> Patch:
    """Return the contacts of a foot on domes alone, at half of their force limit.

    The air is at :data:`DOMED` of the ceiling. How the pressure spreads under a dome has not been
    measured: by the membrane model it is the air's, all over the contact.
    """
    pressure = DOMED * foot.ceiling
    load = 0.5 * foot.dome_load(math.inf, pressure) / foot.pads
    width = float(press(foot.pad, pressure, load).contact_radius)
    places = Layout.of(foot.pads, foot.pad.radius, foot.sole_radius).places
    points, shares = (
        many(places, width, rings) if rings > 1 else (places, np.full(foot.pads, 1.0 / foot.pads))
    )
    return Patch(points, shares, foot.sole_radius, foot.turning_radius)


def patches() -> dict[str, Patch]:
    """Return all contacts by name."""
    unit = DISC_TURNING_RADIUS
    turn = 2.0 * math.pi * np.arange(6) / 6.0
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    found = {
        'disc, even pressure': Patch(*disc(1.0, FINE), 1.0, unit),
        'disc, Hertz': Patch(*disc(1.0, FINE, 'hertz'), 1.0, unit),
        'ring of 6 small discs': Patch(*many(ring, 0.1, COARSE), 1.0, unit),
    }
    return found | {f'{name} on domes': domes(Foot.load(name), COARSE) for name in FEET}


# --- force and moment ----------------------------------------------------------------------------


def summed(points: np.ndarray, shares: np.ndarray) -> Force:
    """Return force and moment over the cap, for rows of twists (vx, vy, ω)."""
    x, y = np.ascontiguousarray(points.T)

    def of(twists: np.ndarray) -> np.ndarray:
        found = np.empty((len(twists), 3))
        for index, (vx, vy, turn) in enumerate(twists):
            sx, sy = vx - turn * y, vy + turn * x
            scale = shares / np.maximum(np.hypot(sx, sy), 1e-300)
            fx, fy = scale * sx, scale * sy
            # Not by dot products, whose threads wait for each other on a busy machine.
            found[index] = fx.sum(), fy.sum(), (x * fy - y * fx).sum()
        return found

    return of


def ellipsoid(turning: float) -> Force:
    """Return the same by the ellipsoid with a turning radius, m."""

    def of(twists: np.ndarray) -> np.ndarray:
        slip = twists * np.array([1.0, 1.0, turning])
        return slip / np.linalg.norm(slip, axis=1)[:, None] * np.array([1.0, 1.0, turning])

    return of


def twists(patch: Patch) -> np.ndarray:
    """Return rows of twists from sliding to turning; at both ends one alone."""
    mixed = np.linspace(0.0, 0.5 * math.pi, ANGLES)
    rows = [
        [math.cos(a) * math.cos(d), math.cos(a) * math.sin(d), math.sin(a) / patch.turning]
        for d in np.radians(DIRECTIONS)
        for a in mixed
    ]
    return np.array(rows)


def errors(patch: Patch, method: Force, truth: np.ndarray) -> dict[str, float]:
    """Return largest errors over the cap, moments over the true largest one.

    ``size``: by how much the limit surface lies outside (above 0) and inside of the method's: the
    length of the true (F, M/ρ), over that of the method. ``motion``: of force and moment of the
    same motion together.
    """
    scale = np.array([1.0, 1.0, 1.0 / patch.own_turning])
    rows = twists(patch)
    found = method(rows)
    along = np.array([1.0, 1.0, 1.0 / patch.turning])
    lengths = np.linalg.norm(truth * along, axis=1) / np.linalg.norm(found * along, axis=1) - 1.0
    return {
        'outside': float(lengths.max()),
        'inside': float(lengths.min()),
        'motion': float(np.linalg.norm((found - truth) * scale, axis=1).max()),
        'moment': float(abs(found[ANGLES - 1, 2] / truth[ANGLES - 1, 2] - 1.0)),
    }


def timed(method: Force, rows: np.ndarray, repeats: int) -> float:
    """Return the median time of one twist, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        for row in rows[::10]:
            method(row[None])
        times.append((time.perf_counter() - start) / len(rows[::10]))
    return float(np.median(times))


# --- the study -----------------------------------------------------------------------------------


def methods_of(name: str, patch: Patch) -> dict[str, Force]:
    """Return each method for a contact."""
    found = {
        'ellipsoid, 2/3 of the sole': ellipsoid(patch.turning),
        'ellipsoid, own radius': ellipsoid(patch.own_turning),
    }
    if name.endswith('domes'):
        foot = Foot.load(name.split()[0])
        found['one point a pad'] = summed(*domes(foot, 1)[:2])
        found |= {f'sum, {n} rings a pad': summed(*domes(foot, n)[:2]) for n in (2, 4)}
    elif name.startswith('disc'):
        pressure = 'hertz' if 'Hertz' in name else 'even'
        found |= {f'sum, {n} rings': summed(*disc(1.0, n, pressure)) for n in (4, 8, 16)}
    return found


def run(repeats: int) -> dict[str, Any]:
    """Return the document: for each contact its radii, and errors and time of each method."""
    document: dict[str, Any] = {'repeats': repeats, 'contacts': {}}
    for name, patch in command.each(list(patches().items()), 'limit_surface', 'contact'):
        truth = summed(patch.points, patch.shares)(twists(patch))
        methods = {
            method: errors(patch, force, truth) | {'seconds': timed(force, twists(patch), repeats)}
            for method, force in methods_of(name, patch).items()
        }
        document['contacts'][name] = {
            'turning': patch.turning / patch.radius,
            'own_turning': patch.own_turning / patch.radius,
            'points': len(patch.shares),
            'surface': np.column_stack([
                np.hypot(truth[:ANGLES, 0], truth[:ANGLES, 1]),
                truth[:ANGLES, 2] / patch.own_turning,
            ]).round(5).tolist(),
            'methods': methods,
        }  # fmt: skip
    return document


def table(document: dict[str, Any]) -> str:
    """Return errors and times by contact and method."""
    rows = [
        {'contact': name, 'rho/R': row['own_turning'], 'method': method, **found}
        for name, row in document['contacts'].items()
        for method, found in row['methods'].items()
    ]
    return command.listed(rows)


def draw(document: dict[str, Any]) -> Figure:
    """Return the picture: limit surfaces beside the circle, and error against time."""
    shown: dict[str, dict[str, Any]] = {  # three lie on each other
        'disc, even pressure': {'color': BLUE, 'lw': 4.0},
        'disc, Hertz': {'color': SKY, 'lw': 2.0},
        'large37 on domes': {'color': VERMILION, 'ls': '--'},
        'ring of 6 small discs': {'color': ORANGE},
    }
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.0), layout='constrained')
        left, right = figure.subplots(1, 2)
        turn = np.linspace(0.0, 0.5 * math.pi, 91)
        left.plot(np.cos(turn), np.sin(turn), ':', color=BLACK, lw=1.0, label='ellipsoid')
        for name, look in shown.items():
            left.plot(*np.transpose(document['contacts'][name]['surface']), label=name, **look)
        left.set(xlabel='force / cap', ylabel='moment / its largest', aspect='equal',
                 title='a  limit surfaces, each with its own radius')  # fmt: skip
        left.legend(fontsize=7.5, loc='lower left')
        for method, each in document['contacts']['large37 on domes']['methods'].items():
            right.plot(1e6 * each['seconds'], 100 * each['motion'], 'o', color=BLUE)
            right.annotate(method, (1e6 * each['seconds'], 100 * each['motion']), (4, 4),
                           textcoords='offset points', fontsize=7.5)  # fmt: skip
        right.set(xscale='log', yscale='log', xlim=(3.0, 6e4), xlabel='time of one motion (µs)',
                  ylabel='largest error of force and moment (%)',
                  title='b  37 domes of a foot: error against time')  # fmt: skip
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, print, draw and write."""
    parser = command.parser('limit_surface', __doc__)
    command.add_count(parser, '--repeats', 5, 'how often each method is timed')
    command.add_out(parser)
    options = parser.parse_args(words)
    document = run(options.repeats)
    kept = command.write(options.out, 'limit_surface', document, {'limit_surface': draw(document)})
    command.show(options, kept, table(document))
    return 0

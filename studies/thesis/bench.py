# SPDX-License-Identifier: Apache-2.0
"""Compute a bench scene: the numbers of the thesis' figures by the model, and the measured points.

:mod:`studies.thesis.bench_figures` draws the figures. The claims of the thesis about each figure
are checked here; where the thesis gives nothing to check, the result of the model is stated.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ros_pad.contact.calibrate import stiffness_of
from ros_pad.contact.dome import MODELS, inflate, press
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.pad import LARGE_PAD, Array
from ros_pad.errors import ConfigError, NoEquilibrium
from studies.thesis.bench_scene import BenchScene, FootBench, InflationBench, PressBench
from studies.thesis.explained import MINIMAL, Claim, Omission, claim, left_out, notes

FIDELITY = 'analytic'

PRINTED_HEIGHT = 1.9412681941617884e-3  # m at 75 kPa, appendix 7.2.2
ON_ONE_SPHERE = 0.02  # relative error up to which values are of one sphere; not from the thesis

NO_ERROR = 'no error stated'
NOT_CODED = 'no numbers in the thesis'
_POINTS = 161  # of a curve


class Curve(NamedTuple):
    """A line of a figure, in SI units."""

    x: Array
    y: Array


@dataclass(frozen=True)
class Row:
    """A number of a figure: its value by the model, and the measured one.

    Attributes
    ----------
    figure : int
        Number of the figure in the thesis.
    quantity, unit : str
        Name of the quantity, and its SI unit.
    model : str
        ``thesis``, ``membrane``, ``foot``, a criterion of the force limit, or the version of an
        equation.
    condition : str
        Further condition of the row: force, ground or liquid.
    pressure, force : float or None
        Gauge pressure, Pa, and normal force on the pad, N.
    modelled : float
        Value by the model.
    measured : float or None
        Measured value; None where the program of the thesis contains no point.
    claimed : str
        Statement of the thesis about the error or the value.
    """

    figure: int
    quantity: str
    unit: str
    model: str
    condition: str
    pressure: float | None
    force: float | None
    modelled: float
    measured: float | None
    claimed: str

    @property
    def error(self) -> float | None:
        """Relative error, model over measurement - 1; None without a measurement."""
        return None if self.measured is None else self.modelled / self.measured - 1.0

    def as_dict(self) -> dict[str, Any]:
        """Return the row for JSON."""
        found = dataclasses.asdict(self)
        pressure, force = found.pop('pressure'), found.pop('force')
        return found | {'pressure_pa': pressure, 'force_n': force, 'error': self.error}


@dataclass(frozen=True)
class BenchTrial:
    """Result of a bench scene.

    Attributes
    ----------
    scene : BenchScene
    rows : tuple of Row
    claims : tuple of Claim
    curves : mapping of str to Curve
        Curves of the figures, by name.
    notes : tuple of str
        Notes for readers of the figures.
    omitted : tuple of Omission
        Physical terms that the model leaves out.
    """

    scene: BenchScene
    rows: tuple[Row, ...]
    claims: tuple[Claim, ...]
    curves: Mapping[str, Curve]
    notes: tuple[str, ...]
    omitted: tuple[Omission, ...]

    def pick(self, quantity: str, model: str | None = None, condition: str = '') -> list[Row]:
        """Return the rows of a quantity and a model (None: all) with a text in the condition."""
        return pick(self.rows, quantity, model, condition)

    def as_dict(self) -> dict[str, Any]:
        """Return all except the curves, for JSON."""
        return {
            'scene': self.scene.name,
            'fidelity': FIDELITY,
            'description': self.scene.description,
            'rows': [row.as_dict() for row in self.rows],
            'claims': [claim.as_dict() for claim in self.claims],
            'notes': list(self.notes),
            'omitted': [each._asdict() for each in self.omitted],
        }


def run(scene: BenchScene | str | os.PathLike[str]) -> BenchTrial:
    """Compute a bench scene.

    Parameters
    ----------
    scene : BenchScene, str or path
        The scene, or an argument of :meth:`studies.thesis.bench_scene.BenchScene.load`.

    Raises
    ------
    ConfigError
        When the scene cannot be read, or its measurements lack points that the bench needs.
    NoEquilibrium
        Where a scene needs a dome that does not exist.
    """
    if not isinstance(scene, BenchScene):
        scene = BenchScene.load(scene)
    measured = Measurements.read(scene.measurements)
    if isinstance(scene.setup, InflationBench):
        return _inflation(scene, scene.setup, measured)
    if isinstance(scene.setup, PressBench):
        return _press(scene, scene.setup, measured)
    if isinstance(scene.setup, FootBench):
        from studies.thesis import foot_bench

        return foot_bench.compute(scene, scene.setup)
    from studies.thesis import tangential

    return tangential.compute(scene, scene.setup, measured)


# --- inflation: figures 14 and 15 ----------------------------------------------------------------


def _inflation(scene: BenchScene, setup: InflationBench, measured: Measurements) -> BenchTrial:
    pad = scene.pad
    pressures, heights = _free_points(scene, measured)
    model = inflate(pad, pressures)
    claimed = f'±{100.0 * setup.claimed_error:g} %'
    stiffness = stiffness_of(pad, pressures, heights)
    rows = [
        Row(15, quantity, unit, 'thesis', 'free', p, 0.0, own, found, claim)
        for quantity, unit, modelled, measurement, claim in (
            ('height', 'm', model.height, heights, claimed),
            ('sphere radius', 'm', model.sphere_radius, _sphere(pad.radius, heights), claimed),
            (
                'stiffness',
                'N/m',
                np.full(heights.shape, pad.stiffness),
                stiffness,
                'rises with deformation',
            ),
        )
        for p, own, found in zip(
            pressures.tolist(), modelled.tolist(), measurement.tolist(), strict=True
        )
    ]
    p = np.linspace(0.0, setup.highest_pressure, _POINTS)
    curve = inflate(pad, p)
    return BenchTrial(
        scene,
        tuple(rows),
        _inflation_claims(setup, rows, stiffness),
        {'height': Curve(p, curve.height), 'sphere radius': Curve(p[1:], curve.sphere_radius[1:])},
        notes('inflation', k=pad.stiffness),
        left_out('inflation', stiffness=float(np.max(np.abs(stiffness / pad.stiffness - 1.0)))),
    )


def _inflation_claims(
    setup: InflationBench, rows: Sequence[Row], stiffness: Array
) -> tuple[Claim, ...]:
    error = errors(pick(rows, 'height'))
    within = int(np.sum(np.abs(error) <= setup.claimed_error))
    return (
        claim(
            'outline of the free',
            f'{1e3 * inflate(LARGE_PAD, 75e3).height:.16g} mm high.',
            (float(inflate(LARGE_PAD, 75e3).height),),
            bool(abs(inflate(LARGE_PAD, 75e3).height / PRINTED_HEIGHT - 1.0) < 1e-15),
        ),
        claim(
            'calculated heights and radii',
            f'Height: {percents(error)}; sphere radius: '
            f'{percents(errors(pick(rows, "sphere radius")))} ({len(error)} domes, each '
            f'measured once). {within} of {len(error)} heights are within.',
            tuple(error.tolist()),
            within == len(error),
            printed=f'±{100.0 * setup.claimed_error:g} %',
        ),
        claim(
            'errors grow with pressure',
            f'{percents(np.abs(error), sign=False)}: '
            + ('they do.' if rises(np.abs(error)) else 'they do not.'),
            tuple(np.abs(error).tolist()),
            rises(np.abs(error)),
        ),
        claim(
            'the stiffness k grows',
            'The k that gives each measured height '
            + ('rises: ' if rises(stiffness) else 'falls: ' if rises(-stiffness) else 'is: ')
            + ', '.join(f'{k:.2f}' for k in stiffness)
            + ' N/m.',
            tuple(stiffness.tolist()),
            rises(stiffness),
        ),
    )


# --- press: figures 16 to 18 ---------------------------------------------------------------------

_PRESSED = (
    # figure, name of the rows, attribute of Pressed
    (16, 'gap', 'gap'),
    (17, 'height', 'height'),
    (17, 'sphere radius', 'sphere_radius'),
    (18, 'contact radius', 'contact_radius'),
    (18, 'depth', 'depth'),
)
CODED, TEXT = 'force as coded', 'force as in the text'


def _press(scene: BenchScene, setup: PressBench, measured: Measurements) -> BenchTrial:
    pressure = setup.pressure
    forces, points = _pressed_points(scene, setup, measured)
    readings = {CODED: forces}
    if setup.text_forces:
        if len(setup.text_forces) != len(forces):
            raise ConfigError(
                f'{scene.source}: text_forces: {len(setup.text_forces)} forces, but '
                f'{len(forces)} pressed points in {scene.measurements}: equal numbers are needed'
            )
        readings[TEXT] = np.array(setup.text_forces)
    rows, curves = _press_rows(scene, setup, readings, points)
    free_pressure, free_height = _free_points(scene, measured)
    top = inflate(scene.pad, pressure).height
    rows += [  # figure 16 shows the free dome, too
        Row(16, 'free height', 'm', 'thesis', 'free', pressure, 0.0, top, found, NO_ERROR)
        for found in free_height[np.isclose(free_pressure, pressure, rtol=1e-9)].tolist()
    ]
    sphere, exact = (modelled(pick(rows, 'gap', model)) for model in MODELS)
    return BenchTrial(
        scene,
        tuple(rows),
        _press_claims(rows, readings, points, pressure),
        curves,
        notes('press'),
        left_out('press', wall=float(np.max(np.abs(sphere / exact - 1.0)))),
    )


def _press_rows(
    scene: BenchScene,
    setup: PressBench,
    readings: Mapping[str, Array],
    points: Mapping[str, Array],
) -> tuple[list[Row], dict[str, Curve]]:
    """Return rows for the measured points with each version of the forces, and the curves."""
    pad, pressure = scene.pad, setup.pressure
    rows = []
    for model, (condition, loads) in itertools.product(MODELS, readings.items()):
        shapes = press(pad, pressure, loads, model=model)
        _all_stand(scene, setup, shapes.status, loads)
        for figure, quantity, name in _PRESSED:
            rows += [
                Row(figure, quantity, 'm', model, condition, pressure, force, own, found, NO_ERROR)
                for force, own, found in zip(
                    loads.tolist(),
                    getattr(shapes, name).tolist(),
                    points[quantity].tolist(),
                    strict=True,
                )
            ]
    load = np.linspace(0.0, setup.highest_force, _POINTS)[1:]
    curves = {}
    for model in MODELS:
        shapes = press(pad, pressure, load, model=model)
        _all_stand(scene, setup, shapes.status, load)
        for _, quantity, name in _PRESSED:
            curves[f'{quantity}, {model}'] = Curve(load, getattr(shapes, name))
    return rows, curves


def _press_claims(
    rows: Sequence[Row],
    readings: Mapping[str, Array],
    points: Mapping[str, Array],
    pressure: float,
) -> tuple[Claim, ...]:
    coded, text = readings[CODED], readings.get(TEXT, readings[CODED])
    contact, sphere = points['contact radius'], points['sphere radius']
    carried = {condition: loads / (np.pi * contact**2) for condition, loads in readings.items()}
    odd = points['depth'] * (sphere + np.sqrt(sphere**2 - contact**2)) / contact**2 - 1.0
    exact = pick(rows, 'gap', 'membrane', CODED)
    gap = errors(pick(rows, 'gap', 'thesis', CODED))
    high = modelled(pick(rows, 'gap', 'thesis', CODED)) / modelled(exact) - 1.0
    domes = f'{len(coded)} domes, each measured once'
    claims = (
        claim(
            'normal forces on the',
            f'The program of the appendix has {numbers(coded, "g")} N: '
            f'{percents(coded / text - 1.0)}. Measured points are compared with these.',
            tuple(coded.tolist()),
            True if np.allclose(text, coded, rtol=1e-3) else None,
            printed=f'{numbers(text, "g")} N',
        ),
        *(_agreement(rows, domes, *each) for each in _PRESSED_POINTS),
        claim(
            'the wall of the',
            'The gap of the sphere differs from that of the exact membrane of the same energy by '
            f'{percents(high)}; from the measured gap the sphere differs by {percents(gap)}, '
            f'the membrane by {percents(errors(exact))} ({domes}): where the sphere is nearer, '
            'its error compensates another.',
            tuple(high.tolist()),
            bool(np.all(np.abs(high) <= MINIMAL)),
        ),
        claim(
            'the contact carries the',
            f'Load over measured contact area, against {1e-3 * pressure:g} kPa: '
            + '; '.join(f'{numbers(1e-3 * p, ".0f")} kPa ({c})' for c, p in carried.items())
            + f' ({domes}).',
            tuple(carried[CODED].tolist()),
            bool(np.all(np.abs(carried[CODED] / pressure - 1.0) <= MINIMAL)),
        ),
        claim(
            'height contact radius and',
            'The depth in the program differs from that of the sphere with the height and contact '
            f'radius there by {percents(odd)} ({domes}).',
            tuple(odd.tolist()),
            bool(np.all(np.abs(odd) <= ON_ONE_SPHERE)),
        ),
    )
    return claims if TEXT in readings else claims[1:]


_PRESSED_POINTS = (
    # figure, what is compared, its rows
    (16, 'outline', ('height', 'gap')),
    (17, 'height and sphere radius', ('height', 'sphere radius')),
    (18, 'contact radius and depth', ('contact radius', 'depth')),
)


def _agreement(
    rows: Sequence[Row], domes: str, figure: int, what: str, quantities: Sequence[str]
) -> Claim:
    error = {each: errors(pick(rows, each, 'thesis', CODED)) for each in quantities}
    found = np.concatenate(list(error.values()))
    return claim(
        'calculated outline of pressed',
        '; '.join(f'{each} {percents(values)}' for each, values in error.items()) + f' ({domes}).',
        tuple(found.tolist()),
        None,
        figure=figure,
        thesis=f'Calculated {what} of pressed domes beside measured ones.',
    )


# --- measurements, and numbers as text -----------------------------------------------------------


def _free_points(scene: BenchScene, measured: Measurements) -> tuple[Array, Array]:
    """Return pressures and heights of the free domes, by rising pressure."""
    found = measured.free
    _some(scene, len(found.pressure), 'free domes (pressure, height)')
    order = np.argsort(found.pressure)
    return found.pressure[order], found.height[order]


def _pressed_points(
    scene: BenchScene, setup: PressBench, measured: Measurements
) -> tuple[Array, dict[str, Array]]:
    """Return the forces at the bench's pressure, and the values measured under each."""
    found = measured.pressed
    mine = np.isclose(found.pressure, setup.pressure, rtol=1e-9)
    for name in ('height', 'depth', 'contact_radius'):
        mine &= np.isfinite(getattr(found, name))
    _some(
        scene,
        int(mine.sum()),
        f'pressed domes of {setup.pressure:g} Pa (force, height, depth, contact_radius)',
    )
    height, depth = found.height[mine], found.depth[mine]
    return found.force[mine], {
        'height': height,
        'sphere radius': _sphere(scene.pad.radius, height),
        'contact radius': found.contact_radius[mine],
        'depth': depth,
        'gap': height - depth,
    }


def limit_points(scene: BenchScene, measured: Measurements) -> tuple[Array, Array]:
    """Return pressures and measured force limits, by rising pressure."""
    found = measured.force_limits
    _some(scene, len(found.pressure), 'force limits (pressure, force_limit)')
    order = np.argsort(found.pressure)
    return found.pressure[order], found.force_limit[order]


def _some(scene: BenchScene, count: int, what: str) -> None:
    if not count:
        raise ConfigError(f'{scene.source}: {scene.measurements} has no {what}')


def _all_stand(
    scene: BenchScene, setup: PressBench, status: np.ndarray[Any, Any], loads: Array
) -> None:
    """Raise NoEquilibrium if a load of the scene has no dome."""
    bad = status != 'ok'
    if bad.any():
        raise NoEquilibrium(
            f'{scene.source}: at {setup.pressure:g} Pa the pad has no dome under '
            f'{loads[bad][0]:g} N ({status[bad][0]})',
            str(status[bad][0]),
        )


def pick(
    rows: Sequence[Row], quantity: str, model: str | None = None, condition: str = ''
) -> list[Row]:
    return [
        row
        for row in rows
        if row.quantity == quantity and model in (None, row.model) and condition in row.condition
    ]


def errors(rows: Sequence[Row]) -> Array:
    return np.array([row.error for row in rows], dtype=np.float64)


def modelled(rows: Sequence[Row]) -> Array:
    return np.array([row.modelled for row in rows])


def _sphere(radius: float, height: Array) -> Array:
    return (radius**2 + height**2) / (2.0 * height)


def rises(values: Array) -> bool:
    return bool(np.all(np.diff(values) > 0.0))


def percents(values: Array, sign: bool = True) -> str:
    return join([f'{100.0 * v:{"+" if sign else ""}z.1f} %'.replace('-', '−') for v in values])


def numbers(values: Sequence[float] | Array, form: str) -> str:
    return join([f'{value:{form}}' for value in values])


def join(words: list[str]) -> str:
    return ' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)

# SPDX-License-Identifier: Apache-2.0
"""Compute a bench scene: the numbers of the thesis' figures by the model, and the measured points.

:mod:`studies.thesis.bench_figures` draws the figures. The claims of the thesis about each figure
are checked here; where the thesis gives nothing to check, the result of the model is stated.
"""

from __future__ import annotations

import dataclasses
import importlib
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
from ros_pad.errors import ConfigError
from studies.thesis.bench_scene import BenchScene
from studies.thesis.explained import MINIMAL, Claim, Omission, claim, left_out, notes, worded

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
    measured: float | None = None
    claimed: str = NOT_CODED

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
    rows : sequence of Row
    claims : tuple of Claim
    curves : mapping of str to Curve
        Curves of the figures, by name.
    notes : tuple of str
        Notes for readers of the figures.
    omitted : tuple of Omission
        Physical terms that the model leaves out.
    """

    scene: BenchScene
    rows: Sequence[Row]
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
    if scene.kind in _HERE:
        return _HERE[scene.kind](scene)
    name = {'foot': 'foot_bench', 'tangential': 'tangential'}[scene.kind]
    trial: BenchTrial = importlib.import_module(f'studies.thesis.{name}').compute(scene)
    return trial


def measured(scene: BenchScene, kind: str, words: str) -> list[Array]:
    """Return the columns of a kind of measurement, by rising first column.

    Raises
    ------
    ConfigError
        When there are none; ``words`` say of what.
    """
    columns = np.array(getattr(Measurements.read(scene.measurements), kind))[:5]
    if kind == 'pressed':  # the gap beside these is height less depth
        mine = np.isclose(columns[0], scene.setup.pressure, rtol=1e-9)
        columns = columns[:, mine & np.isfinite(columns).all(axis=0)]
    if not columns.size:
        raise ConfigError(f'{scene.source}: {scene.measurements} has no {words}')
    return list(columns[:, np.argsort(columns[0], kind='stable')])


_FREE = 'free', 'free domes (pressure, height)'

# --- inflation: figures 14 and 15 ----------------------------------------------------------------


def _inflation(scene: BenchScene) -> BenchTrial:
    pad, setup = scene.pad, scene.setup
    pressures, heights = measured(scene, *_FREE)
    model = inflate(pad, pressures)
    claimed = f'±{100.0 * setup.claimed_error:g} %'
    stiffness = stiffness_of(pad, pressures, heights)
    same = np.full(heights.shape, pad.stiffness)
    columns = {
        ('height', 'm', claimed): (model.height, heights),
        ('sphere radius', 'm', claimed): (model.sphere_radius, _sphere(pad.radius, heights)),
        ('stiffness', 'N/m', 'rises with deformation'): (same, stiffness),
    }
    rows = [
        Row(15, quantity, unit, 'thesis', 'free', p, 0.0, own, found, stated)
        for (quantity, unit, stated), values in columns.items()
        for p, own, found in np.array([pressures, *values]).T.tolist()
    ]
    p = np.linspace(0.0, setup.highest_pressure, _POINTS)
    curve = inflate(pad, p)
    return BenchTrial(
        scene,
        rows,
        _inflation_claims(setup, rows, stiffness),
        {'height': Curve(p, curve.height), 'sphere radius': Curve(p[1:], curve.sphere_radius[1:])},
        notes('inflation', k=pad.stiffness),
        left_out('inflation', stiffness=float(np.max(np.abs(stiffness / pad.stiffness - 1.0)))),
    )


def _inflation_claims(setup: Any, rows: Sequence[Row], stiffness: Array) -> tuple[Claim, ...]:
    error = errors(pick(rows, 'height'))
    size, height = np.abs(error), float(inflate(LARGE_PAD, 75e3).height)
    both = np.abs([*error, *errors(pick(rows, 'sphere radius'))])
    within = int(np.sum(both <= setup.claimed_error))
    return (
        claim('outline of the free', height, abs(height / PRINTED_HEIGHT - 1.0) < 1e-15,
              height=1e3 * height),
        claim('calculated heights and radii', error, within > 0.5 * len(both), within=within,
              error=error, radius=errors(pick(rows, 'sphere radius')), count=len(error),
              all=len(both), worst=both.max(), claimed=setup.claimed_error),
        claim('errors grow with pressure', size, True if rises(size) else None, size=size),
        claim('the stiffness k grows', stiffness, None, stiffness=stiffness,
              way='rises' if rises(stiffness) else 'falls' if rises(-stiffness) else 'is'),
    )  # fmt: skip


# --- press: figures 16 to 18 ---------------------------------------------------------------------

_PRESSED = (
    # figure, name of the rows, attribute of Pressed
    (16, 'gap', 'gap'),
    (17, 'height', 'height'),
    (17, 'sphere radius', 'sphere_radius'),
    (18, 'contact radius', 'contact_radius'),
    (18, 'depth', 'depth'),
)
_AGREEMENTS = (
    # figure, what is compared, its rows
    (16, 'outline', ('height', 'gap')),
    (17, 'height and sphere radius', ('height', 'sphere radius')),
    (18, 'contact radius and depth', ('contact radius', 'depth')),
)
CODED, TEXT = 'force as coded', 'force as in the text'
ROUNDED = 0.05e-3  # m, to which its author read lengths off


def _press(scene: BenchScene) -> BenchTrial:
    pressure = scene.setup.pressure
    forces, points = _pressed_points(scene)
    readings = {CODED: forces}
    if text := scene.setup.text_forces:
        if len(text) != len(forces):
            raise ConfigError(
                f'{scene.source}: text_forces: {len(text)} forces, but {len(forces)} pressed '
                f'points in {scene.measurements}: equal numbers are needed'
            )
        readings[TEXT] = np.array(text)
    rows, curves = _press_rows(scene, readings, points)
    top = float(inflate(scene.pad, pressure).height)
    rows += [  # figure 16 shows the free dome, too
        Row(16, 'free height', 'm', 'thesis', 'free', pressure, 0.0, top, height, NO_ERROR)
        for p, height in np.transpose(measured(scene, *_FREE)).tolist()
        if np.isclose(p, pressure, rtol=1e-9)
    ]
    sphere, exact = (modelled(pick(rows, 'gap', model)) for model in MODELS)
    return BenchTrial(
        scene,
        rows,
        _press_claims(rows, readings, points, pressure),
        curves,
        notes('press'),
        left_out('press', wall=float(np.max(np.abs(sphere / exact - 1.0)))),
    )


def _press_rows(
    scene: BenchScene, readings: Mapping[str, Array], points: Mapping[str, Array]
) -> tuple[list[Row], dict[str, Curve]]:
    """Return rows for the measured points with each version of the forces, and the curves."""
    pad, pressure = scene.pad, scene.setup.pressure
    load = np.linspace(0.0, scene.setup.highest_force, _POINTS)[1:]
    press(pad, pressure, max(load[-1], *map(max, readings.values())))  # raises if it is too much
    rows, curves = [], {}
    for model, (condition, loads) in itertools.product(MODELS, readings.items()):
        shapes = press(pad, pressure, loads, model=model)
        for figure, quantity, name in _PRESSED:
            columns = np.array([loads, getattr(shapes, name), points[quantity]])
            rows += [
                Row(figure, quantity, 'm', model, condition, pressure, force, own, found, NO_ERROR)
                for force, own, found in columns.T.tolist()
            ]
    for model in MODELS:
        shapes = press(pad, pressure, load, model=model)
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
    over = carried[CODED] / pressure - 1.0
    kilopascals = [
        worded('{p:.0f} kPa ({condition})', p=1e-3 * p, condition=condition)
        for condition, p in carried.items()
    ]
    odd = points['depth'] * (sphere + np.sqrt(sphere**2 - contact**2)) / contact**2 - 1.0
    exact = pick(rows, 'gap', 'membrane', CODED)
    gap = errors(pick(rows, 'gap', 'thesis', CODED))
    high = modelled(pick(rows, 'gap', 'thesis', CODED)) / modelled(exact) - 1.0
    domes = f'{len(coded)} domes'
    claims = (
        claim('normal forces on the', coded, True if np.allclose(text, coded, rtol=1e-3) else None,
              coded=coded, text=text, off=coded / text - 1.0),
        *(_agreement(rows, domes, *each) for each in _AGREEMENTS),
        claim('the wall of the', high, np.all(np.abs(high) <= MINIMAL), high=high, gap=gap,
              exact=errors(exact), domes=domes),
        claim('the contact carries the', carried[CODED],
              True if np.all(np.abs(over) <= MINIMAL) else None, domes=domes, over=over,
              read=2.0 * ROUNDED / contact, pressure=1e-3 * pressure,
              carried='; '.join(kilopascals)),
        claim('height contact radius and', odd, np.all(np.abs(odd) <= ON_ONE_SPHERE), odd=odd,
              domes=domes),
    )  # fmt: skip
    return claims if TEXT in readings else claims[1:]


def _agreement(
    rows: Sequence[Row], domes: str, figure: int, what: str, quantities: Sequence[str]
) -> Claim:
    error = {each: errors(pick(rows, each, 'thesis', CODED)) for each in quantities}
    texts = [worded('{0} {error:+z.1f%}', each, error=e) for each, e in error.items()]
    return claim(
        'calculated outline of pressed', [*error.values()], None,
        figure=figure, what=what, errors='; '.join(texts), domes=domes,
    )  # fmt: skip


# --- measurements, and numbers -------------------------------------------------------------------


def _pressed_points(scene: BenchScene) -> tuple[Array, dict[str, Array]]:
    """Return the forces at the bench's pressure, and the values measured under each."""
    words = 'pressed domes of {:g} Pa (force, height, depth, contact_radius)'
    columns = measured(scene, 'pressed', words.format(scene.setup.pressure))
    _, force, height, depth, contact = columns
    return force, {
        'height': height,
        'sphere radius': _sphere(scene.pad.radius, height),
        'contact radius': contact,
        'depth': depth,
        'gap': height - depth,
    }


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


_HERE = {'inflation': _inflation, 'press': _press}

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
from ros_pad.contact.design import DESIGN_WATER
from ros_pad.contact.dome import MODELS, inflate, press
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.meniscus import THESIS_LIQUID, WATER, hysteresis_force, meniscus
from ros_pad.contact.pad import LARGE_PAD, Array, Pad
from ros_pad.contact.resistance import Foot
from ros_pad.contact.squeeze import trapped_film
from ros_pad.errors import ConfigError, NoEquilibrium
from ros_pad.simulation.margin import SOLE_MODULUS
from ros_pad.simulation.terms import Term as Omission
from studies.thesis.bench_scene import (
    BenchScene,
    FootBench,
    InflationBench,
    PressBench,
    TangentialBench,
)
from studies.thesis.explained import MINIMAL, Claim
from studies.thesis.sole import rise

FIDELITY = 'analytic'

PRINTED_HEIGHT = 1.9412681941617884e-3  # m at 75 kPa, appendix 7.2.2
FOOT, DESIGN = 'model/foot.md#tangential-resistance', 'errata.md#design-of-the-sole'
LIMITS = 'model/force_limit.md#which-one-and-why'
FREE_DOME, PRESSED_DOME = 'errata.md#free-dome', 'errata.md#pressed-dome'
TUNED_FRICTION = (
    'friction, shear strength, conforming pressure, friction on a film and critical film of the '
    'foot'
)
ON_ONE_SPHERE = 0.02  # relative error up to which values are of one sphere; not from the thesis

NO_ERROR = 'no error stated'
NOT_CODED = 'no numbers in the thesis'
_POINTS = 161  # of a curve
STIFFER = 1.2  # times as stiff as the pad of the bench
DRAWS = 100  # of the assumed numbers of a dragged pad
_STEPS = 200  # of the tangential force from 0 to the dry resistance


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
        return {
            'figure': self.figure,
            'quantity': self.quantity,
            'unit': self.unit,
            'model': self.model,
            'condition': self.condition,
            'pressure_pa': self.pressure,
            'force_n': self.force,
            'modelled': self.modelled,
            'measured': self.measured,
            'error': self.error,
            'claimed': self.claimed,
        }


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
        return _pick(self.rows, quantity, model, condition)

    def as_dict(self) -> dict[str, Any]:
        """Return all except the curves, for JSON."""
        return {
            'scene': self.scene.name,
            'fidelity': FIDELITY,
            'description': self.scene.description,
            'rows': [row.as_dict() for row in self.rows],
            'claims': [claim.as_dict() for claim in self.claims],
            'notes': list(self.notes),
            'omitted': [dataclasses.asdict(each) for each in self.omitted],
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
    return _tangential(scene, scene.setup, measured)


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
        (
            'The measured caps are spheres through the rim with the height from the program of '
            'the thesis; their radius was not measured but follows from height and pad radius.',
            f"k = {pad.stiffness:g} N/m belongs to the thesis' pressure law (3.41, 3.60) alone: "
            'with another law, the same membrane has another k.',
        ),
        (
            Omission(
                'change of the stiffness with deformation',
                float(np.max(np.abs(stiffness / pad.stiffness - 1.0))),
                'relative, of k: from the k that gives each measured height',
            ),
            Omission('bending of the skin', None, 'a membrane has none; the skin is 0.4 mm thick'),
            Omission('errors of the microscope', None, 'the thesis gives one value for a point'),
        ),
    )


def _inflation_claims(
    setup: InflationBench, rows: Sequence[Row], stiffness: Array
) -> tuple[Claim, ...]:
    error = _errors(_pick(rows, 'height'))
    within = int(np.sum(np.abs(error) <= setup.claimed_error))
    section = '3.2.1'
    return (
        Claim(
            14,
            "Outline of the free dome at 75 kPa, by the thesis' program.",
            f'{1e3 * inflate(LARGE_PAD, 75e3).height:.16g} mm high.',
            (float(inflate(LARGE_PAD, 75e3).height),),
            bool(abs(inflate(LARGE_PAD, 75e3).height / PRINTED_HEIGHT - 1.0) < 1e-15),
            '3.2.1, 7.2.2',
            printed=f'{1e3 * PRINTED_HEIGHT:.16g} mm',
            rule='To 15 digits. It shows that both solve the same equation, no more.',
            same=True,
        ),
        Claim(
            15,
            'Calculated heights and radii of free domes are near the measured ones.',
            f'Height: {_percents(error)}; sphere radius: '
            f'{_percents(_errors(_pick(rows, "sphere radius")))} ({len(error)} domes, each '
            f'measured once). {within} of {len(error)} heights are within.',
            tuple(error.tolist()),
            within == len(error),
            section,
            printed=f'±{100.0 * setup.claimed_error:g} %',
            rule='All heights within it. k = 40 N/m is that of the thesis; the best is 40.3.',
            see=FREE_DOME,
        ),
        Claim(
            15,
            'Errors grow with pressure.',
            f'{_percents(np.abs(error), sign=False)}: '
            + ('they do.' if _rises(np.abs(error)) else 'they do not.'),
            tuple(np.abs(error).tolist()),
            _rises(np.abs(error)),
            section,
            rule='Errors of the heights, by pressure.',
            see=FREE_DOME,
        ),
        Claim(
            15,
            'The stiffness k grows with strain, hence those errors.',
            'The k that gives each measured height '
            + ('rises: ' if _rises(stiffness) else 'falls: ' if _rises(-stiffness) else 'is: ')
            + ', '.join(f'{k:.2f}' for k in stiffness)
            + ' N/m.',
            tuple(stiffness.tolist()),
            _rises(stiffness),
            section,
            rule='By the law of the thesis, which k belongs to.',
            see=FREE_DOME,
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
    sphere, exact = (_modelled(_pick(rows, 'gap', model)) for model in MODELS)
    return BenchTrial(
        scene,
        tuple(rows),
        _press_claims(rows, readings, points, pressure),
        curves,
        (
            'Text and program of the thesis disagree on the three normal forces. The figures of '
            'the thesis were made with the program; every figure and table here has the forces of '
            'text and program.',
            'Height, depth and sphere radius are those of the sphere through rim and edge of '
            'contact, as the thesis takes them from its measurements. This is so for the exact '
            'membrane, too, although its wall is no sphere.',
            'The membrane has the energy of the thesis, and no adhesion.',
        ),
        (
            Omission(
                'wall that is no sphere',
                float(np.max(np.abs(sphere / exact - 1.0))),
                "relative, of the gap: thesis' sphere over exact membrane at the points",
            ),
            Omission('friction of the plate', None, 'skin that sticks does not stretch freely'),
            Omission('bending of the skin', None, 'a membrane has none; the skin is 0.4 mm thick'),
            Omission('errors of the microscope', None, 'the thesis gives one value for a point'),
        ),
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
    exact = _pick(rows, 'gap', 'membrane', CODED)
    gap = _errors(_pick(rows, 'gap', 'thesis', CODED))
    high = _modelled(_pick(rows, 'gap', 'thesis', CODED)) / _modelled(exact) - 1.0
    domes = f'{len(coded)} domes, each measured once'
    claims = (
        Claim(
            16,
            'Normal forces on the pressed domes.',
            f'The program of the appendix has {_numbers(coded, "g")} N: '
            f'{_percents(coded / text - 1.0)}. Measured points are compared with these.',
            tuple(coded.tolist()),
            True if np.allclose(text, coded, rtol=1e-3) else None,
            '3.2.1',
            printed=f'{_numbers(text, "g")} N',
            rule='Text and program within 0.1 %.',
            missing='the forces that were applied',
            see=PRESSED_DOME,
        ),
        *(_agreement(rows, domes, *each) for each in _PRESSED_POINTS),
        Claim(
            16,
            'The wall of the pressed dome is a sphere (Fig. 6d, 3.48).',
            'The gap of the sphere differs from that of the exact membrane of the same energy by '
            f'{_percents(high)}; from the measured gap the sphere differs by {_percents(gap)}, '
            f'the membrane by {_percents(_errors(exact))} ({domes}): where the sphere is nearer, '
            'its error compensates another.',
            tuple(high.tolist()),
            bool(np.all(np.abs(high) <= MINIMAL)),
            '3.1.1',
            rule=f'Gaps within {100.0 * MINIMAL:g} %.',
            see='model/membrane.md',
        ),
        Claim(
            18,
            'The contact carries the load with the pressure of the air (3.53; adhesion is small).',
            f'Load over measured contact area, against {1e-3 * pressure:g} kPa: '
            + '; '.join(f'{_numbers(1e-3 * p, ".0f")} kPa ({c})' for c, p in carried.items())
            + f' ({domes}).',
            tuple(carried[CODED].tolist()),
            bool(np.all(np.abs(carried[CODED] / pressure - 1.0) <= MINIMAL)),
            '3.1.1',
            rule=f'Its own points within {100.0 * MINIMAL:g} %. 3.53 is exact for a membrane: '
            'what is refuted is that these points are of domes of 75 kPa.',
            see=PRESSED_DOME,
        ),
        Claim(
            18,
            'Height, contact radius and depth are of one sphere.',
            'The depth in the program differs from that of the sphere with the height and contact '
            f'radius there by {_percents(odd)} ({domes}).',
            tuple(odd.tolist()),
            bool(np.all(np.abs(odd) <= ON_ONE_SPHERE)),
            '3.2.1',
            rule=f'Within {100.0 * ON_ONE_SPHERE:g} %. The height was computed by this very '
            'formula: no evidence for a sphere.',
            same=True,
            see=PRESSED_DOME,
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
    error = {each: _errors(_pick(rows, each, 'thesis', CODED)) for each in quantities}
    found = np.concatenate(list(error.values()))
    return Claim(
        figure,
        f'Calculated {what} of pressed domes beside measured ones.',
        '; '.join(f'{each} {_percents(values)}' for each, values in error.items())
        + f' ({domes}).',
        tuple(found.tolist()),
        None,
        '3.2.1',
        printed='none stated',
        rule='Errors with the forces of the program.',
        missing='an error that is allowed, and the scatter of each point',
        see=PRESSED_DOME,
    )


# --- tangential: figures 20, 21 and 10 -----------------------------------------------------------

DRY, WET = 'dry', 'wet'
# Versions of 3.82 for figure 21, with their liquids; the last one is not from 3.82, but a bound on
# the force.
BOUND = 'hysteresis bound, water'
CAPILLARY = {
    'thesis, its tensions': ('thesis', THESIS_LIQUID),
    'thesis, water': ('thesis', WATER),
    'corrected, water': ('corrected', WATER),
    BOUND: ('', WATER),
}
# Versions of 3.101 for figure 10. An area in m² with lengths in mm is like a tension that is 1e6
# times too small.
RISE = {
    'as typed, in mm': ('thesis', DESIGN_WATER),
    'as typed, mm with m²': (
        'thesis',
        dataclasses.replace(DESIGN_WATER, surface_tension=1e-6 * DESIGN_WATER.surface_tension),
    ),
    'corrected': ('corrected', DESIGN_WATER),
}


def slip_force(
    foot: Foot,
    load: float,
    pressure: float,
    film_thickness: float,
    viscosity: float,
    speed: float,
    dwell: float,
) -> float:
    """Return the tangential force at which a dragged foot begins to slip, N.

    The foot stands for a time, then its stage moves at a constant speed: the tangential force
    rises with the shear of the foot while the film below it drains, until it equals the present
    resistance of the foot.

    Parameters
    ----------
    foot : Foot
        The foot; all of its domes, where there are any, carry the load.
    load : float
        Normal force, N, above 0.
    pressure : float
        Gauge pressure, Pa; 0 is the flat foot.
    film_thickness : float
        Depth of the liquid, m; 0 is dry ground.
    viscosity : float
        Viscosity of the liquid, Pa s.
    speed : float
        Speed of the stage, m/s.
    dwell : float
        Time from touch-down until the stage starts, s.
    """
    domes, sole = (load, 0.0) if pressure > 0.0 else (0.0, load)
    dry = foot.resistance_of(domes, sole, pressure, 0.0, 0.0)
    if film_thickness == 0.0:
        return dry
    film = Film(foot, viscosity)
    film.touch_down(film_thickness)
    film.drain(domes, sole, pressure, dwell)
    step = dry / _STEPS
    pull, last = 0.0, 0.0
    while True:
        held = foot.resistance_of(domes, sole, pressure, film.under_domes, film.under_sole)
        if pull >= held:
            # Interpolate linearly between two steps.
            back = (pull - held) / (pull - held + last) if pull else 0.0
            return pull - back * step
        last = held - pull
        pull += step
        film.drain(domes, sole, pressure, step / (foot.shear_stiffness * speed))


def _tangential(scene: BenchScene, setup: TangentialBench, measured: Measurements) -> BenchTrial:
    foot = scene.foot
    pressures, limits = _limit_points(scene, measured)
    ends = dict(zip(pressures.tolist(), limits.tolist(), strict=True))
    curves, rows = {}, []
    for pressure, end in {0.0: setup.highest_load, **ends}.items():
        loads = np.linspace(0.0, end, _POINTS // 2)
        tabled = sorted({*limits[limits <= end].tolist(), end})
        for ground in (DRY, WET):
            name = f'{shape_name(pressure)}, {ground}'
            held = [_held(foot, setup, load, pressure, ground) for load in loads[1:].tolist()]
            curves[name] = Curve(loads, np.array([0.0, *held]))
            rows += [
                Row(20, 'tangential force', 'N', 'foot', name, pressure, load,
                    _held(foot, setup, load, pressure, ground), None, NOT_CODED)
                for load in tabled
            ]  # fmt: skip
    rows += [
        Row(20, 'force limit', 'N', criterion, 'dome', pressure, None,
            float(force_limit(scene.pad, pressure, criterion)), limit, NO_ERROR)
        for criterion in ('thickness', 'flattening')
        for pressure, limit in ends.items()
    ]  # fmt: skip
    rows += [
        Row(21, 'wet less dry', 'N', 'foot', 'without capillary force', pressure, limit,
            _held(foot, setup, limit, pressure, WET) - _held(foot, setup, limit, pressure, DRY),
            None, NOT_CODED)
        for pressure, limit in ends.items()
    ]  # fmt: skip
    rows += _capillary_rows(scene, setup, ends)
    rise_rows, rise_curves = _rise(setup)
    rows += rise_rows
    curves |= rise_curves
    return BenchTrial(
        scene,
        tuple(rows),
        _tangential_claims(scene, setup, rows, curves, ends),
        curves,
        (
            'The thesis gives no friction, no shear strength and no film. Those of the foot are '
            'assumed such that the statements of the thesis hold: this proves only that one '
            'small model can fulfil all of them.',
            f'One pad on a sole of {2e3 * foot.sole_radius:g} mm, {foot.shear_stiffness:.0f} N/m '
            f'of shear stiffness, {1e3 * setup.film_thickness:g} mm of liquid, a stage that '
            f'starts {setup.dwell:g} s after touch-down: all assumed. Its '
            f"{1e3 * setup.speed:g} mm/s are the thesis'.",
            'The program of the thesis contains no measured point of figures 20, 21 and 10: only '
            'the force limits, where the curves of the domes end, can be compared.',
        ),
        _tangential_omitted(scene, rows),
    )


def shape_name(pressure: float) -> str:
    """Return the name of the pad's morphology in a row, at a gauge pressure, Pa."""
    return f'{1e-3 * pressure:g} kPa' if pressure else 'flat'


def _held(foot: Foot, setup: TangentialBench, load: float, pressure: float, ground: str) -> float:
    depth = setup.film_thickness if ground == WET else 0.0
    return slip_force(foot, load, pressure, depth, setup.viscosity, setup.speed, setup.dwell)


def _capillary_rows(
    scene: BenchScene, setup: TangentialBench, ends: Mapping[float, float]
) -> list[Row]:
    """Return the capillary force at the load that all domes carry, and at each force limit."""
    rows = []
    for pressure, limit in ends.items():
        for load in sorted({min(ends.values()), limit}):
            dome = press(scene.pad, pressure, load)
            for name, (reading, liquid) in CAPILLARY.items():
                if name == BOUND:
                    force = hysteresis_force(
                        dome.contact_radius,
                        liquid.surface_tension,
                        setup.advancing_angle,
                        setup.receding_angle,
                    )
                else:
                    force = meniscus(dome, liquid, reading).tangential_force
                rows.append(
                    Row(21, 'capillary force', 'N', name, WET, pressure, load, force, None,
                        NOT_CODED)
                )  # fmt: skip
    return rows


def _rise(setup: TangentialBench) -> tuple[list[Row], dict[str, Curve]]:
    """Return height of rise and its best radius by each version of 3.101, as rows and curves."""
    radii = np.geomspace(setup.smallest_radius, setup.largest_radius, 4 * _POINTS)
    claimed = f'{1e3 * setup.claimed_smallest:g} to {1e3 * setup.claimed_largest:g} mm'
    rows, curves = [], {}
    for name, (reading, liquid) in RISE.items():
        heights = rise(radii, liquid, reading)
        curves[f'rise, {name}'] = Curve(radii, heights)
        best = int(np.nanargmax(heights))
        near = np.linspace(radii[max(best - 1, 0)], radii[min(best + 1, len(radii) - 1)], 1001)
        heights = rise(near, liquid, reading)
        best = int(np.nanargmax(heights))
        for quantity, value, claim in (
            ('radius of greatest rise', near[best], claimed),
            ('greatest rise', heights[best], NOT_CODED),
        ):
            rows.append(
                Row(10, quantity, 'm', name, 'water, 60°', None, None, float(value), None, claim)
            )
    return rows, curves


def _compared(curves: Mapping[str, Curve]) -> tuple[float, float, float, float, Array]:
    """Return least ratios of flat to domes, dry, and of domes to flat, wet; largest losses; ends.

    The losses are the share that domes lose by being wet, and the share that the flat pad keeps.
    """
    domes = [name for name in curves if name.endswith('kPa, dry')]

    def over_flat(ground: str) -> float:
        """Return the least ratio of forces: dome to flat on wet, flat to dome on dry ground."""
        ratios = []
        for name in domes:
            load, dome = curves[name.replace(DRY, ground)]
            flat = np.interp(load[1:], *curves[f'flat, {ground}'])
            ratios.append(dome[1:] / flat if ground == WET else flat / dome[1:])
        return float(min(ratio.min() for ratio in ratios))

    lost = max(
        float(np.max(1.0 - curves[name.replace(DRY, WET)].y[1:] / curves[name].y[1:]))
        for name in domes
    )
    flat_left = float(np.max(curves['flat, wet'].y[1:] / curves['flat, dry'].y[1:]))
    ends = np.array([curves[name].y[-1] for name in domes])
    return over_flat(DRY), over_flat(WET), lost, flat_left, ends


def _tangential_claims(
    scene: BenchScene,
    setup: TangentialBench,
    rows: Sequence[Row],
    curves: Mapping[str, Curve],
    ends_of: Mapping[float, float],
) -> tuple[Claim, ...]:
    pressures, limits = list(ends_of), np.array(list(ends_of.values()))
    dry, wet, lost, flat_left, ends = _compared(curves)
    middle = len(limits) // 2
    drawn = _drawn(scene, setup, pressures[middle], float(limits[middle]))
    section = '3.2.2'
    return (
        Claim(
            20,
            f'Dry, the flat pad holds most, up to {setup.highest_load:g} N.',
            f'At least {dry:.2f} times what a dome holds under the same load '
            f'({_above(drawn.flat_over_dome_dry, 1.0)}).',
            (dry,),
            dry > 1.0,
            section,
            rule='Above 1.',
            tuned=TUNED_FRICTION,
            see=FOOT,
        ),
        Claim(
            20,
            'Wet, the flat pad loses much of it, and domes hold more.',
            f'It keeps at most {flat_left:.2f} of its dry force; a dome holds at least {wet:.1f} '
            f'times as much ({_above(drawn.dome_over_flat_wet, 1.0)}). '
            f'{_smallest_sole(scene, setup, limits)}',
            (flat_left, wet),
            wet > 1.0 and flat_left < 0.5,
            section,
            rule='Loses more than half; a dome holds more. Rigid discs: a soft pad that is loaded '
            'at once floats on any sole.',
            tuned=TUNED_FRICTION + ', width of the sole',
            see='model/film.md#what-a-flat-sole-does',
        ),
        Claim(
            20,
            'Domes hold nearly the same wet and dry.',
            f'They lose at most {100.0 * lost:.1f} % (wet over dry '
            f'{_above(drawn.dome_wet_over_dry, 0.9)}).',
            (lost,),
            lost <= MINIMAL,
            section,
            rule=f'Up to {100.0 * MINIMAL:g} %. Rigid discs: a soft dome is 98 % dry only if its '
            'load comes in 0.1 s or more; loaded at once 9 to 13 %.',
            tuned=TUNED_FRICTION,
            see='model/film.md#the-load-comes-slowly',
        ),
        _adds_claim(
            drawn, _pick(rows, 'wet less dry'), _pick(rows, 'capillary force', BOUND), ends
        ),
        Claim(
            20,
            'More pressure raises the limit of the load, and with it the tangential force.',
            f'At their limits the domes hold {_numbers(ends, ".3f")} N, dry.',
            tuple(ends.tolist()),
            _rises(ends),
            section,
            rule='Both rise. Limits are those measured; the rest holds with any friction that '
            'grows with the load.',
        ),
        *_limits_claims(scene.pad, rows, limits),
        _stiffer_claim(scene.pad, _pick(rows, 'force limit', 'thickness')),
        _capillary_claim(rows),
        _rise_claim(setup, rows),
    )


class _Draws(NamedTuple):
    """Ratios of forces for each draw of the assumed numbers."""

    flat_over_dome_dry: Array
    dome_over_flat_wet: Array
    dome_wet_over_dry: Array
    gain_with_lines: Array


def _drawn(scene: BenchScene, setup: TangentialBench, pressure: float, load: float) -> _Draws:
    """Draw every assumed number anew, as the bench of a foot does, for one dome and flat pad."""
    from studies.thesis import foot_bench

    doubt = BenchScene.load('bench_foot').setup
    assert isinstance(doubt, FootBench)
    own = dataclasses.replace(
        doubt, dwell=setup.dwell, film_thickness=setup.film_thickness, samples=DRAWS
    )
    angles = (WATER.surface_tension, setup.advancing_angle, setup.receding_angle)
    lines = float(hysteresis_force(press(scene.pad, pressure, load).contact_radius, *angles))
    found = []
    for foot, bench, factor in foot_bench.draws(scene.foot, own):
        one = dataclasses.replace(foot, pads=1)
        case = dataclasses.replace(setup, dwell=bench.dwell, film_thickness=bench.film_thickness)
        flat_dry, flat_wet, dry, wet = (
            _held(one, case, load, p, ground)
            for p, ground in itertools.product((0.0, pressure), (DRY, WET))
        )
        found.append((flat_dry / dry, wet / flat_wet, wet / dry, (wet + factor * lines) / dry - 1))
    return _Draws(*np.array(found).T)


def _above(ratios: Array, least: float) -> str:
    return f'above {least:g} in {int(np.sum(ratios > least))} of {len(ratios)} draws'


def _adds_claim(drawn: _Draws, less: Sequence[Row], bound: Sequence[Row], ends: Array) -> Claim:
    """Return the verdict on the title: decided where nearly all draws are on one side of 0."""
    lost = _modelled(less) / ends
    lines = max(row.modelled for row in bound)
    low, high = np.quantile(drawn.gain_with_lines, (0.05, 0.95))
    ours = (
        f'At their limits domes hold less wet than dry, {_percents(lost)}. Pinned lines of '
        f'liquid, an upper bound, return {1e3 * lines:.2f} mN or {100.0 * lines / ends.min():.2f} '
        f'%. With them the dome of 75 kPa gains {100.0 * low:.1f} to {100.0 * high:+.2f} % (5 to '
        f'95 %; {_above(drawn.gain_with_lines, 0.0)}).'
    )
    return Claim(
        20,
        'Title: liquid adds to what a dome holds; F_cap = F_wet − F_dry is above 0.',
        ours.replace('-', '−'),
        (*lost.tolist(), float(low), float(high)),
        True if low > 0.0 else False if high < 0.0 else None,
        'title, 3.2.2',
        printed='more, no number',
        rule='Decided if 5 to 95 % of draws are on one side of 0. What the thesis calls F_cap '
        'also holds the dry friction that the film takes away.',
        missing='F_wet and F_dry of Fig. 20, to 0.1 %',
        see='model/foot.md#the-foot-of-chapter-43',
    )


def _limits_claims(pad: Pad, rows: Sequence[Row], limits: Array) -> tuple[Claim, Claim]:
    flattened = _pick(rows, 'force limit', 'flattening')
    pressures = np.array([row.pressure for row in flattened], dtype=np.float64)
    ratio = _modelled(flattened) / limits
    line, default = (
        force_limit(pad, pressures, criterion) / limits for criterion in ('measured', 'thickness')
    )
    printed = f'{_numbers(limits, "g")} N'
    return (
        Claim(
            20,
            'A dome bears what the energy of its air can balance.',
            f'The model carries until the dome is flat, {_numbers(ratio, ".1f")} times what was '
            f'measured ({len(limits)} domes). No law of pressure times area fits.',
            tuple(ratio.tolist()),
            bool(np.all(np.abs(ratio - 1.0) <= MINIMAL)),
            '3.2.2',
            printed=printed,
            rule=f'Within {100.0 * MINIMAL:g} % of the measured limits.',
            see=PRESSED_DOME,
        ),
        Claim(
            20,
            'Measured limits of the load at 65, 75 and 85 kPa.',
            f'The line `measured`: {_percents(np.asarray(line) - 1.0)}. Without a fitted number '
            f'`thickness`: {_percents(np.asarray(default) - 1.0)}.',
            tuple(np.asarray(line).tolist()),
            bool(np.all(np.abs(np.asarray(line) - 1.0) <= MINIMAL)),
            '3.2.2',
            printed=printed,
            rule=f'Within {100.0 * MINIMAL:g} % by the line. At 65 kPa no criterion without a '
            'fit is.',
            tuned=f'the two constants of the line, to these {len(limits)} points',
            see=LIMITS,
        ),
    )


def _stiffer_claim(pad: Pad, limits: Sequence[Row]) -> Claim:
    """Return whether a stiffer pad carries more at the pressures of the measured limits."""
    pressures = np.array([row.pressure for row in limits], dtype=np.float64)
    stiffer = dataclasses.replace(pad, stiffness=STIFFER * pad.stiffness)
    raised = {
        criterion: force_limit(stiffer, pressures, criterion)
        / force_limit(pad, pressures, criterion)
        for criterion in ('thickness', 'flattening')
    }
    return Claim(
        20,
        'A harder silicone (Dragon Skin 20 or 30 for 10) raises the limit of the load.',
        f'A pad {STIFFER:g} times as stiff carries, at 65, 75 and 85 kPa, '
        + '; '.join(f'{_numbers(each, ".2f")} times by `{name}`' for name, each in raised.items())
        + '. A membrane of the material agrees.',
        tuple(np.concatenate([np.atleast_1d(each) for each in raised.values()]).tolist()),
        bool(all(np.all(each > 1.0) for each in raised.values())),
        '3.2.2',
        printed='none',
        rule='Above 1 at the same pressure. True only if the pressure rises with the stiffness.',
        see='model/force_limit.md#scaling',
    )


def _capillary_claim(rows: Sequence[Row]) -> Claim:
    capillary = {name: _modelled(_pick(rows, 'capillary force', name)) for name in CAPILLARY}
    return Claim(
        21,
        'Measured and estimated capillary forces (3.82) agree, errors included.',
        'Estimates: '
        + '; '.join(
            f'{name} {1e3 * force.min():.3f} to {1e3 * force.max():.3f} mN'
            for name, force in capillary.items()
        )
        + '.',
        tuple(float(force.max()) for force in capillary.values()),
        None,
        '3.2.2',
        printed='10 to 26 %',
        rule='Readings of 3.82 differ by a factor of 20.',
        missing='the points of Fig. 21, and the tensions of its estimate',
        see='errata.md#liquid-ring',
    )


def _rise_claim(setup: TangentialBench, rows: Sequence[Row]) -> Claim:
    best = {row.model: row.modelled for row in _pick(rows, 'radius of greatest rise')}
    inside = [
        name
        for name, radius in best.items()
        if setup.claimed_smallest <= radius <= setup.claimed_largest
    ]
    return Claim(
        10,
        'Liquid rises highest between domes of an optimal pad radius.',
        'The greatest rise is at '
        + '; '.join(f'{1e3 * radius:.3f} mm ({name})' for name, radius in best.items())
        + f': in that range by {_join(inside) if inside else "no reading of 3.101"}.',
        tuple(best.values()),
        bool(inside),
        '3.1.3',
        printed=f'{1e3 * setup.claimed_smallest:g} to {1e3 * setup.claimed_largest:g} mm',
        rule='In the range by any reading.',
        see=DESIGN,
    )


def _smallest_sole(scene: BenchScene, setup: TangentialBench, limits: Array) -> str:
    """Return, as a sentence, the smallest sole that loses half of its force on wet ground.

    The sentence is empty if no sole between pad and foot does so, or all of them do.
    """
    foot = scene.foot
    load = float(limits.max())

    def share(radius: float) -> float:
        sole = dataclasses.replace(foot, sole_radius=radius)
        return _held(sole, setup, load, 0.0, WET) / _held(sole, setup, load, 0.0, DRY)

    low, high = foot.pad.radius, foot.sole_radius
    if share(low) < 0.5 or share(high) > 0.5:
        return ''
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share(middle) > 0.5 else (low, middle)
    return (
        f'This needs a sole at least {2e3 * high:.1f} mm wide: under smaller ones the film drains'
        ' during the slow drag, and the flat pad keeps more than half of its dry force.'
    )


def _tangential_omitted(scene: BenchScene, rows: Sequence[Row]) -> tuple[Omission, ...]:
    wet = _pick(rows, 'tangential force', condition=WET)
    held = {(row.pressure, row.force): row.modelled for row in wet}
    bound = _pick(rows, 'capillary force', BOUND)
    p = np.array([row.pressure for row in bound])
    load = np.array([row.force for row in bound])
    contact = press(scene.pad, p, load).contact_radius
    sole = scene.foot.sole_radius
    return (
        Omission(
            'capillary force, in figure 20',
            max(row.modelled / held[row.pressure, row.force] for row in bound),
            'relative, of the tangential force: the largest force by hysteresis of the ring',
        ),
        Omission(
            'adhesion that widens the contact',
            float(np.max(np.pi * contact**2 * p / load - 1.0)),
            'relative, of the contact area at the loads of the table: 3.53 with and without it',
        ),
        Omission('liquid dragged under the pad', None, 'film taken to travel with the foot'),
        Omission(
            'dimple of the film',
            None,
            'films drain as under rigid discs; under the highest load a soft sole traps'
            f' {1e6 * trapped_film(sole, SOLE_MODULUS, load.max() / scene.foot.sole_area):.2g} um'
            ' in the mean, however wide it is',
        ),
        Omission('dome leaning over as it is dragged', None, 'shape taken from pressing alone'),
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


def _limit_points(scene: BenchScene, measured: Measurements) -> tuple[Array, Array]:
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


def _pick(
    rows: Sequence[Row], quantity: str, model: str | None = None, condition: str = ''
) -> list[Row]:
    return [
        row
        for row in rows
        if row.quantity == quantity and model in (None, row.model) and condition in row.condition
    ]


def _errors(rows: Sequence[Row]) -> Array:
    return np.array([row.error for row in rows], dtype=np.float64)


def _modelled(rows: Sequence[Row]) -> Array:
    return np.array([row.modelled for row in rows])


def _sphere(radius: float, height: Array) -> Array:
    return (radius**2 + height**2) / (2.0 * height)


def _rises(values: Array) -> bool:
    return bool(np.all(np.diff(values) > 0.0))


def _percents(values: Array, sign: bool = True) -> str:
    return _join([f'{100.0 * v:{"+" if sign else ""}z.1f} %'.replace('-', '−') for v in values])


def _numbers(values: Sequence[float] | Array, form: str) -> str:
    return _join([f'{value:{form}}' for value in values])


def _join(words: list[str]) -> str:
    return ' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)

# SPDX-License-Identifier: Apache-2.0
"""Compute the bench of one dragged pad: figures 20, 21 and 10 of the thesis (3.2.2, 3.1.3)."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.contact.design import DESIGN_WATER
from ros_pad.contact.dome import press
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.meniscus import THESIS_LIQUID, WATER, hysteresis_force, meniscus
from ros_pad.contact.pad import Array, Pad
from ros_pad.contact.resistance import Foot
from studies.thesis.bench import (
    NO_ERROR,
    NOT_CODED,
    BenchTrial,
    Curve,
    Row,
    join,
    limit_points,
    modelled,
    numbers,
    percents,
    pick,
    rises,
)
from studies.thesis.bench_scene import BenchScene, FootBench, TangentialBench
from studies.thesis.explained import MINIMAL, Claim, Omission, claim, left_out, notes
from studies.thesis.sole import rise

_POINTS = 161  # of a curve
STIFFER = 1.2  # times as stiff as the pad of the bench
DRAWS = 100  # of the assumed numbers of a dragged pad
_STEPS = 200  # of the tangential force from 0 to the dry resistance

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


def compute(scene: BenchScene, setup: TangentialBench, measured: Measurements) -> BenchTrial:
    foot = scene.foot
    pressures, limits = limit_points(scene, measured)
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
        notes(
            'tangential',
            sole=2e3 * foot.sole_radius,
            stiffness=foot.shear_stiffness,
            film=1e3 * setup.film_thickness,
            dwell=setup.dwell,
            speed=1e3 * setup.speed,
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
        for quantity, value, stated in (
            ('radius of greatest rise', near[best], claimed),
            ('greatest rise', heights[best], NOT_CODED),
        ):
            rows.append(
                Row(10, quantity, 'm', name, 'water, 60°', None, None, float(value), None, stated)
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
    return (
        claim(
            'dry the flat pad',
            f'At least {dry:.2f} times what a dome holds under the same load '
            f'({_above(drawn.flat_over_dome_dry, 1.0)}).',
            (dry,),
            dry > 1.0,
            thesis=f'Dry, the flat pad holds most, up to {setup.highest_load:g} N.',
        ),
        claim(
            'wet the flat pad',
            f'It keeps at most {flat_left:.2f} of its dry force; a dome holds at least {wet:.1f} '
            f'times as much ({_above(drawn.dome_over_flat_wet, 1.0)}). '
            f'{_smallest_sole(scene, setup, limits)}',
            (flat_left, wet),
            wet > 1.0 and flat_left < 0.5,
        ),
        claim(
            'domes hold nearly the',
            f'They lose at most {100.0 * lost:.1f} % (wet over dry '
            f'{_above(drawn.dome_wet_over_dry, 0.9)}).',
            (lost,),
            lost <= MINIMAL,
        ),
        _adds_claim(drawn, pick(rows, 'wet less dry'), pick(rows, 'capillary force', BOUND), ends),
        claim(
            'more pressure raises the',
            f'At their limits the domes hold {numbers(ends, ".3f")} N, dry.',
            tuple(ends.tolist()),
            rises(ends),
        ),
        *_limits_claims(scene.pad, rows, limits),
        _stiffer_claim(scene.pad, pick(rows, 'force limit', 'thickness')),
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
    lost = modelled(less) / ends
    lines = max(row.modelled for row in bound)
    low, high = np.quantile(drawn.gain_with_lines, (0.05, 0.95))
    ours = (
        f'At their limits domes hold less wet than dry, {percents(lost)}. Pinned lines of '
        f'liquid, an upper bound, return {1e3 * lines:.2f} mN or {100.0 * lines / ends.min():.2f} '
        f'%. With them the dome of 75 kPa gains {100.0 * low:.1f} to {100.0 * high:+.2f} % (5 to '
        f'95 %; {_above(drawn.gain_with_lines, 0.0)}).'
    )
    return claim(
        'title liquid adds to',
        ours.replace('-', '−'),
        (*lost.tolist(), float(low), float(high)),
        True if low > 0.0 else False if high < 0.0 else None,
    )


def _limits_claims(pad: Pad, rows: Sequence[Row], limits: Array) -> tuple[Claim, Claim]:
    flattened = pick(rows, 'force limit', 'flattening')
    pressures = np.array([row.pressure for row in flattened], dtype=np.float64)
    ratio = modelled(flattened) / limits
    line, default = (
        force_limit(pad, pressures, criterion) / limits for criterion in ('measured', 'thickness')
    )
    printed = f'{numbers(limits, "g")} N'
    return (
        claim(
            'a dome bears what',
            f'The model carries until the dome is flat, {numbers(ratio, ".1f")} times what was '
            f'measured ({len(limits)} domes). No law of pressure times area fits.',
            tuple(ratio.tolist()),
            bool(np.all(np.abs(ratio - 1.0) <= MINIMAL)),
            printed=printed,
        ),
        claim(
            'measured limits of the',
            f'The line `measured`: {percents(np.asarray(line) - 1.0)}. Without a fitted number '
            f'`thickness`: {percents(np.asarray(default) - 1.0)}.',
            tuple(np.asarray(line).tolist()),
            bool(np.all(np.abs(np.asarray(line) - 1.0) <= MINIMAL)),
            printed=printed,
            tuned=f'the two constants of the line, to these {len(limits)} points',
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
    return claim(
        'a harder silicone dragon',
        f'A pad {STIFFER:g} times as stiff carries, at 65, 75 and 85 kPa, '
        + '; '.join(f'{numbers(each, ".2f")} times by `{name}`' for name, each in raised.items())
        + '. A membrane of the material agrees.',
        tuple(np.concatenate([np.atleast_1d(each) for each in raised.values()]).tolist()),
        bool(all(np.all(each > 1.0) for each in raised.values())),
    )


def _capillary_claim(rows: Sequence[Row]) -> Claim:
    capillary = {name: modelled(pick(rows, 'capillary force', name)) for name in CAPILLARY}
    return claim(
        'measured and estimated capillary',
        'Estimates: '
        + '; '.join(
            f'{name} {1e3 * force.min():.3f} to {1e3 * force.max():.3f} mN'
            for name, force in capillary.items()
        )
        + '.',
        tuple(float(force.max()) for force in capillary.values()),
        None,
    )


def _rise_claim(setup: TangentialBench, rows: Sequence[Row]) -> Claim:
    best = {row.model: row.modelled for row in pick(rows, 'radius of greatest rise')}
    inside = [
        name
        for name, radius in best.items()
        if setup.claimed_smallest <= radius <= setup.claimed_largest
    ]
    return claim(
        'liquid rises highest between',
        'The greatest rise is at '
        + '; '.join(f'{1e3 * radius:.3f} mm ({name})' for name, radius in best.items())
        + f': in that range by {join(inside) if inside else "no reading of 3.101"}.',
        tuple(best.values()),
        bool(inside),
        printed=f'{1e3 * setup.claimed_smallest:g} to {1e3 * setup.claimed_largest:g} mm',
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
    wet = pick(rows, 'tangential force', condition=WET)
    held = {(row.pressure, row.force): row.modelled for row in wet}
    bound = pick(rows, 'capillary force', BOUND)
    p = np.array([row.pressure for row in bound])
    load = np.array([row.force for row in bound])
    contact = press(scene.pad, p, load).contact_radius
    return left_out(
        'tangential',
        capillary=max(row.modelled / held[row.pressure, row.force] for row in bound),
        adhesion=float(np.max(np.pi * contact**2 * p / load - 1.0)),
    )

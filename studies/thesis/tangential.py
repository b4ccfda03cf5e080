# SPDX-License-Identifier: Apache-2.0
"""Compute the bench of one dragged pad: figures 20, 21 and 10 of the thesis (3.2.2, 3.1.3)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ros_pad.contact import laws
from ros_pad.contact.design import DESIGN_WATER
from ros_pad.contact.dome import press
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit
from ros_pad.contact.meniscus import THESIS_LIQUID, WATER, hysteresis_force, meniscus
from ros_pad.contact.pad import Array, Pad
from ros_pad.contact.resistance import Foot
from studies.thesis.bench import (
    NO_ERROR,
    NOT_CODED,
    BenchTrial,
    Curve,
    Row,
    measured,
    modelled,
    pick,
    rises,
)
from studies.thesis.bench_scene import BenchScene
from studies.thesis.explained import MINIMAL, Claim, Omission, claim, join, left_out, notes
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
_THIN = replace(DESIGN_WATER, surface_tension=1e-6 * DESIGN_WATER.surface_tension)
RISE = {
    'as typed, in mm': ('thesis', DESIGN_WATER),
    'as typed, mm with m²': ('thesis', _THIN),
    'corrected': ('corrected', DESIGN_WATER),
}


def slip_force(foot: Foot, setup: Any, load: float, pressure: float, wet: bool) -> float:
    """Return the tangential force at which a dragged foot begins to slip, N.

    The foot stands for a time, then its stage moves at a constant speed: the tangential force
    rises with the shear of the foot while the film below it drains, until it equals the present
    resistance of the foot.

    Parameters
    ----------
    foot : Foot
        The foot; all of its domes, where there are any, carry the load.
    setup : namespace
        Test with ``film_thickness``, m, ``viscosity``, Pa s, ``speed`` of the stage, m/s, and
        ``dwell`` from touch-down until it starts, s.
    load : float
        Normal force, N, above 0.
    pressure : float
        Gauge pressure, Pa; 0 is the flat foot.
    wet : bool
        Whether there is liquid on the ground.
    """
    domes, sole = (load, 0.0) if pressure > 0.0 else (0.0, load)
    dry = laws.resistance(foot, domes, sole, pressure, 0.0, 0.0)
    if not wet:
        return dry
    film = Film(foot, setup.viscosity)
    film.touch_down(setup.film_thickness)
    films = film.drain(domes, sole, pressure, setup.dwell)  # the load comes evenly
    step = dry / _STEPS
    pull, last = 0.0, 0.0
    while True:
        held = laws.resistance(foot, domes, sole, pressure, *films)
        if pull >= held:
            # Interpolate linearly between two steps.
            back = (pull - held) / (pull - held + last) if pull else 0.0
            return pull - back * step
        last = held - pull
        pull += step
        films = film.drain(domes, sole, pressure, step / (foot.shear_stiffness * setup.speed))


def compute(scene: BenchScene) -> BenchTrial:
    foot, setup = scene.foot, scene.setup
    pressures, limits = measured(scene, 'force_limits', 'force limits (pressure, force_limit)')
    ends = dict(zip(pressures.tolist(), limits.tolist(), strict=True))
    curves, rows = {}, []
    for pressure, end in {0.0: setup.highest_load, **ends}.items():
        loads = np.linspace(0.0, end, _POINTS // 2)
        tabled = sorted({*limits[limits <= end].tolist(), end})
        for ground in (DRY, WET):
            name = f'{shape_name(pressure)}, {ground}'

            def held(load: float, p: float = pressure, wet: bool = ground == WET) -> float:
                return slip_force(foot, setup, load, p, wet)

            curves[name] = Curve(loads, np.array([0.0, *map(held, loads[1:].tolist())]))
            rows += [
                Row(20, 'tangential force', 'N', 'foot', name, pressure, load, held(load))
                for load in tabled
            ]
    for criterion in ('thickness', 'flattening'):
        carried = force_limit(scene.pad, pressures, criterion)
        columns = np.array([pressures, carried, limits]).T.tolist()
        rows += [
            Row(20, 'force limit', 'N', criterion, 'dome', p, None, own, limit, NO_ERROR)
            for p, own, limit in columns
        ]
    for p, limit in ends.items():
        less = slip_force(foot, setup, limit, p, True) - slip_force(foot, setup, limit, p, False)
        rows.append(
            Row(21, 'wet less dry', 'N', 'foot', 'without capillary force', p, limit, less)
        )
    rows += _capillary_rows(scene, ends)
    rise_rows, rise_curves = _rise(setup)
    rows += rise_rows
    curves |= rise_curves
    stated = notes(
        'tangential', sole=2e3 * foot.sole_radius, stiffness=foot.shear_stiffness,
        film=1e3 * setup.film_thickness, dwell=setup.dwell, speed=1e3 * setup.speed,
    )  # fmt: skip
    claims = _claims(scene, rows, curves, ends)
    return BenchTrial(scene, rows, claims, curves, stated, _omitted(scene, rows))


def shape_name(pressure: float) -> str:
    """Return the name of the pad's morphology in a row, at a gauge pressure, Pa."""
    return f'{1e-3 * pressure:g} kPa' if pressure else 'flat'


def pinned(radius: Any, setup: Any) -> Any:
    """Return the force that a pinned line of water round a contact holds, N."""
    angles = setup.advancing_angle, setup.receding_angle
    return hysteresis_force(radius, WATER.surface_tension, *angles)


def _capillary_rows(scene: BenchScene, ends: Mapping[float, float]) -> list[Row]:
    """Return the capillary force at the load that all domes carry, and at each force limit."""
    rows = []
    for pressure, limit in ends.items():
        for load in sorted({min(ends.values()), limit}):
            dome = press(scene.pad, pressure, load)
            for name, (reading, liquid) in CAPILLARY.items():
                if name == BOUND:
                    force = pinned(dome.contact_radius, scene.setup)
                else:
                    force = meniscus(dome, liquid, reading).tangential_force
                rows.append(Row(21, 'capillary force', 'N', name, WET, pressure, load, force))
    return rows


def _rise(setup: Any) -> tuple[list[Row], dict[str, Curve]]:
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
        rows += [
            Row(10, quantity, 'm', name, 'water, 60°', None, None, float(value), None, stated)
            for quantity, value, stated in (
                ('radius of greatest rise', near[best], claimed),
                ('greatest rise', heights[best], NOT_CODED),
            )
        ]
    return rows, curves


def _compared(curves: Mapping[str, Curve]) -> tuple[float, float, float, float, Array]:
    """Return least ratios of flat to domes, dry, and of domes to flat, wet; largest losses; ends.

    The losses are the share that domes lose by being wet, and the share that the flat pad keeps.
    """
    domes = [name for name in curves if name.endswith('kPa, dry')]
    flat = {ground: curves[f'flat, {ground}'] for ground in (DRY, WET)}
    dry, wet, lost = [], [], []
    for name in domes:
        load, held = curves[name]
        held, held_wet = held[1:], curves[name.replace(DRY, WET)].y[1:]
        dry.append(np.min(np.interp(load[1:], *flat[DRY]) / held))
        wet.append(np.min(held_wet / np.interp(load[1:], *flat[WET])))
        lost.append(np.max(1.0 - held_wet / held))
    left = float(np.max(flat[WET].y[1:] / flat[DRY].y[1:]))
    ends = np.array([curves[name].y[-1] for name in domes])
    return float(min(dry)), float(min(wet)), float(max(lost)), left, ends


def _claims(
    scene: BenchScene,
    rows: Sequence[Row],
    curves: Mapping[str, Curve],
    ends_of: Mapping[float, float],
) -> tuple[Claim, ...]:
    setup, pressures, limits = scene.setup, list(ends_of), np.array(list(ends_of.values()))
    dry, wet, lost, left, ends = _compared(curves)
    middle = len(limits) // 2
    drawn = _drawn(scene, pressures[middle], float(limits[middle]))
    capillary = {name: modelled(pick(rows, 'capillary force', name)) for name in CAPILLARY}
    estimates = [
        f'{name} {1e3 * force.min():.3f} to {1e3 * force.max():.3f} mN'
        for name, force in capillary.items()
    ]
    return (
        claim('dry the flat pad', dry, dry > 1.0, dry=dry, load=setup.highest_load,
              above=_above(drawn.flat_over_dome_dry, 1.0)),
        claim('wet the flat pad', (left, wet), wet > 1.0 and left < 0.5, left=left, wet=wet,
              above=_above(drawn.dome_over_flat_wet, 1.0)),
        claim('domes hold nearly the', lost, lost <= MINIMAL, lost=lost,
              above=_above(drawn.dome_wet_over_dry, 0.9)),
        _adds_claim(drawn, pick(rows, 'wet less dry'), capillary[BOUND], ends),
        claim('more pressure raises the', ends, rises(ends), ends=ends),
        *_limits_claims(scene.pad, rows, limits),
        claim('measured and estimated capillary', [each.max() for each in capillary.values()],
              None, estimates='; '.join(estimates)),
        _rise_claim(setup, rows),
    )  # fmt: skip


class _Draws(NamedTuple):
    """Ratios of forces for each draw of the assumed numbers."""

    flat_over_dome_dry: Array
    dome_over_flat_wet: Array
    dome_wet_over_dry: Array
    gain_with_lines: Array


def _drawn(scene: BenchScene, pressure: float, load: float) -> _Draws:
    """Draw every assumed number anew, as the bench of a foot does, for one dome and flat pad."""
    from studies.thesis import foot_bench

    setup = scene.setup
    doubt = BenchScene.load('bench_foot').changed(
        dwell=setup.dwell, film_thickness=setup.film_thickness, samples=DRAWS
    )
    lines = float(pinned(press(scene.pad, pressure, load).contact_radius, setup))
    found = []
    for foot, bench, factor in foot_bench.draws(scene.foot, doubt.setup):
        one = replace(foot, pads=1)
        case = scene.changed(dwell=bench.dwell, film_thickness=bench.film_thickness).setup
        flat_dry, flat_wet, dry, wet = (
            slip_force(one, case, load, *drag)
            for drag in itertools.product((0.0, pressure), (False, True))
        )
        found.append((flat_dry / dry, wet / flat_wet, wet / dry, (wet + factor * lines) / dry - 1))
    return _Draws(*np.array(found).T)


def _above(ratios: Array, least: float) -> str:
    return f'above {least:g} in {int(np.sum(ratios > least))} of {len(ratios)} draws'


def _adds_claim(drawn: _Draws, less: Sequence[Row], bound: Array, ends: Array) -> Claim:
    """Return what is left of wet less dry force in draws of the assumed numbers."""
    lost, lines = modelled(less) / ends, float(bound.max())
    low, high = np.quantile(drawn.gain_with_lines, (0.05, 0.95))
    return claim(
        'title liquid adds to', (*lost, low, high), None,
        lost=lost, lines=1e3 * lines, share=lines / ends.min(), low=100.0 * low, high=high,
        above=_above(drawn.gain_with_lines, 0.0),
    )  # fmt: skip


def _limits_claims(pad: Pad, rows: Sequence[Row], limits: Array) -> tuple[Claim, ...]:
    flattened = pick(rows, 'force limit', 'flattening')
    pressures = np.array([row.pressure for row in flattened], dtype=np.float64)
    ratio, count = modelled(flattened) / limits, len(limits)
    line, default = (
        np.asarray(force_limit(pad, pressures, criterion) / limits - 1.0)
        for criterion in ('measured', 'thickness')
    )
    stiffer = replace(pad, stiffness=STIFFER * pad.stiffness)
    raised = {
        name: force_limit(stiffer, pressures, name) / force_limit(pad, pressures, name)
        for name in ('thickness', 'flattening')
    }
    more = np.ravel([*raised.values()])
    return (
        claim('a dome bears what', ratio, None, ratio=ratio, count=count, limits=limits),
        claim('measured limits of the', line + 1.0, np.all(np.abs(line) <= MINIMAL), line=line,
              default=default, count=count, limits=limits),
        claim('a harder silicone dragon', more, None, stiffer=STIFFER, **raised),
    )  # fmt: skip


def _rise_claim(setup: Any, rows: Sequence[Row]) -> Claim:
    best = {row.model: row.modelled for row in pick(rows, 'radius of greatest rise')}
    ends = setup.claimed_smallest, setup.claimed_largest
    inside = [name for name, radius in best.items() if ends[0] <= radius <= ends[1]]
    return claim(
        'liquid rises highest between', [*best.values()], inside,
        best='; '.join(f'{1e3 * radius:.3f} mm ({name})' for name, radius in best.items()),
        inside=join(inside) if inside else 'no reading of 3.101',
        smallest=1e3 * ends[0], largest=1e3 * ends[1], corrected=1e3 * best['corrected'],
    )  # fmt: skip


def _omitted(scene: BenchScene, rows: Sequence[Row]) -> tuple[Omission, ...]:
    wet = pick(rows, 'tangential force', condition=WET)
    held = {(row.pressure, row.force): row.modelled for row in wet}
    bound = pick(rows, 'capillary force', BOUND)
    p, load = np.array([(row.pressure, row.force) for row in bound], dtype=np.float64).T
    contact = press(scene.pad, p, load).contact_radius
    return left_out(
        'tangential',
        capillary=max(row.modelled / held[row.pressure, row.force] for row in bound),
        adhesion=float(np.max(np.pi * contact**2 * p / load - 1.0)),
    )

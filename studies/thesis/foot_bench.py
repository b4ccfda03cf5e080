# SPDX-License-Identifier: Apache-2.0
"""Compute the bench of a whole foot: tangential forces on four floors (thesis 4.3.1, figure 34).

The thesis prints no number of the figure. Intervals draw every assumed number anew, so that a
verdict stands only where it does not depend on them.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.capillary import Mesh, wet
from ros_pad.contact.dome import press
from ros_pad.contact.limits import force_limit
from ros_pad.contact.meniscus import GRAVITY, WATER, Liquid, hysteresis_force, meniscus
from ros_pad.contact.pad import Array
from ros_pad.contact.resistance import Foot
from studies.thesis.bench import NOT_CODED, BenchTrial, Curve, Row
from studies.thesis.bench_scene import BenchScene, FootBench
from studies.thesis.explained import MINIMAL, Claim, Omission, claim, left_out, notes
from studies.thesis.tangential import CAPILLARY, DRY, WET, slip_force

FLAT, DOME = 'flat', 'dome'
SMOOTH, ROUGH = 'smooth', 'rough'
CASES = tuple(itertools.product((FLAT, DOME), (SMOOTH, ROUGH)))
NONE, LINES, SUCTION = 'no capillary force', 'pinned lines', 'pinned lines and suction'
PATTERN = '4.18, gaps full of water'
STRAIGHT = 0.02  # deviation over the largest force up to which a line is straight; ours
LOW, HIGH = 0.05, 0.95  # quantiles of an interval
_POINTS = 45  # of a curve
_ON_FOOT = (
    *('friction', 'shear_strength', 'conforming_pressure', 'boundary_friction'),
    *('critical_film', 'film_exponent', 'shear_stiffness'),
)
_ON_BENCH = ('dwell', 'film_thickness', 'roughness')


class Line(NamedTuple):
    """Line fitted to forces over loads, and the largest deviation over the largest force."""

    slope: float
    intercept: float
    deviation: float


class Pulled(NamedTuple):
    """Tangential forces at the onset of slip, and bounds on what a liquid adds to them, N."""

    dry: float
    wet: float
    lines: float
    suction: float

    def less_dry(self, kind: str) -> float:
        """Return the wet less the dry force, N, with a kind of capillary force."""
        added = {NONE: 0.0, LINES: self.lines, SUCTION: self.lines + self.suction}[kind]
        return self.wet - self.dry + added


def straight(x: Array, y: Array) -> Line:
    """Fit a straight line by least squares."""
    slope, intercept = np.polyfit(x, y, 1)
    deviation = np.max(np.abs(y - slope * x - intercept)) / np.max(np.abs(y))
    # Nine decimals: what rounding leaves of a zero is not printed, nor its sign.
    return Line(float(slope), round(float(intercept), 9) + 0.0, round(float(deviation), 9))


def on_floors(foot: Foot, setup: FootBench) -> dict[str, Foot]:
    """Return the foot as it is on each floor."""
    return {SMOOTH: foot, ROUGH: foot.on_rough(setup.roughness)}


def pull(foot: Foot, setup: FootBench, load: float, shape: str) -> Pulled:
    """Return the forces of a foot, as it is on its floor, under a load, N, flat or domed.

    Pinned lines run around every dome, or around the flat sole. Suction is that of a small ring of
    water, at a contact angle of 0, around each dome on a floor that is moist, not flooded:
    4 π R γ, whatever its volume, times the friction that a further load meets.
    """
    pressure = setup.pressure if shape == DOME else 0.0
    dry, wet = (
        slip_force(foot, load, pressure, depth, setup.viscosity, setup.speed, setup.dwell)
        for depth in (0.0, setup.film_thickness)
    )
    angles = (WATER.surface_tension, setup.advancing_angle, setup.receding_angle)
    if not pressure:
        return Pulled(dry, wet, float(hysteresis_force(foot.sole_radius, *angles)), 0.0)
    pressed = press(foot.pad, pressure, load / foot.pads)
    lines = foot.pads * float(hysteresis_force(pressed.contact_radius, *angles))
    bridges = foot.pads * 4.0 * math.pi * pressed.sphere_radius * WATER.surface_tension
    return Pulled(dry, wet, lines, bridges * dry / load)


def draws(foot: Foot, setup: FootBench) -> list[tuple[Foot, FootBench, float]]:
    """Return feet and benches with every assumed number drawn anew, and a factor on pinned lines.

    Each number has a factor of its own, log-uniform between one over the bench's and that. Pads
    are rounded up, and no more than fit on the sole.
    """
    generator = np.random.default_rng(setup.seed)
    names = (*_ON_FOOT, *_ON_BENCH, 'pads', 'lines')
    drawn = []
    for _ in range(setup.samples):
        random = setup.factor ** generator.uniform(-1.0, 1.0, len(names))
        factors = dict(zip(names, random.tolist(), strict=True))
        own = {name: factors[name] * getattr(foot, name) for name in _ON_FOOT}
        most = int((foot.sole_radius / foot.pad.radius) ** 2)
        own['pads'] = min(math.ceil(factors['pads'] * foot.pads), most)
        bench = {name: factors[name] * getattr(setup, name) for name in _ON_BENCH}
        drawn.append(
            (
                dataclasses.replace(foot, **own),
                dataclasses.replace(setup, **bench),
                factors['lines'],
            )
        )
    return drawn


def compute(scene: BenchScene, setup: FootBench) -> BenchTrial:
    """Compute the bench of a foot.

    Raises
    ------
    NoEquilibrium
        Where a dome of the scene does not exist.
    """
    foot = scene.foot
    loads = np.linspace(setup.lowest_load, setup.highest_load, _POINTS)
    feet = on_floors(foot, setup)
    found = {
        (shape, floor): [pull(feet[floor], setup, load, shape) for load in loads.tolist()]
        for shape, floor in CASES
    }
    curves = _curves(foot, setup, loads, found)
    lines = {name: straight(*curve) for name, curve in curves.items() if name.endswith((DRY, WET))}
    rows = _force_rows(setup, curves, lines)
    rows += _difference_rows(setup, found, _drawn(foot, setup))
    rows += _capillary_rows(foot, setup, curves)
    return BenchTrial(
        scene,
        tuple(rows),
        _claims(scene, setup, rows, found, lines),
        curves,
        _notes(scene, setup),
        _omitted(foot, setup, found),
    )


def _curves(
    foot: Foot, setup: FootBench, loads: Array, found: Mapping[tuple[str, str], Sequence[Pulled]]
) -> dict[str, Curve]:
    """Return tangential forces, wet less dry, and the thesis' estimates over the load."""
    curves = {}
    for (shape, floor), pulled in found.items():
        for ground in (DRY, WET):
            forces = np.array([getattr(each, ground) for each in pulled])
            curves[f'{shape}, {floor}, {ground}'] = Curve(loads, forces)
        for kind in _kinds(shape):
            less = np.array([each.less_dry(kind) for each in pulled])
            curves[f'{shape}, {floor}, {kind}'] = Curve(loads, less)
    pressed = press(foot.pad, setup.pressure, loads / foot.pads)
    for name, (reading, liquid) in CAPILLARY.items():
        if reading:
            force = meniscus(pressed, liquid, reading).tangential_force
            curves[f'3.82, {name}'] = Curve(loads, foot.pads * np.asarray(force))
    # Δp S of 4.18 with Δp = ρ g h and S = 2 h R, up to the base of the pads.
    full = WATER.density * GRAVITY * np.asarray(pressed.gap) ** 2 * 2.0 * foot.sole_radius
    return curves | {PATTERN: Curve(loads, full)}


def _kinds(shape: str) -> tuple[str, ...]:
    return (NONE, LINES, SUCTION) if shape == DOME else (NONE, LINES)


def _drawn(foot: Foot, setup: FootBench) -> dict[tuple[str, str, float, str], Array]:
    """Return wet less dry, N, for all draws, by morphology, floor, load and kind."""
    values: dict[tuple[str, str, float, str], list[float]] = {}
    for own, bench, factor in draws(foot, setup):
        feet = on_floors(own, bench)
        for (shape, floor), load in itertools.product(CASES, _ends(setup)):
            pulled = pull(feet[floor], bench, load, shape)
            pulled = pulled._replace(lines=factor * pulled.lines)
            for kind in _kinds(shape):
                values.setdefault((shape, floor, load, kind), []).append(pulled.less_dry(kind))
    return {key: np.array(each) for key, each in values.items()}


def _ends(setup: FootBench) -> tuple[float, float]:
    return setup.lowest_load, setup.highest_load


def _force_rows(
    setup: FootBench, curves: Mapping[str, Curve], lines: Mapping[str, Line]
) -> list[Row]:
    rows = []
    for name, line in lines.items():
        pressure = setup.pressure if name.startswith(DOME) else 0.0
        for place in (0, -1):
            load, force = (float(each[place]) for each in curves[name])
            rows.append(
                Row(34, 'tangential force', 'N', 'foot', name, pressure, load, force, None,
                    NOT_CODED)
            )  # fmt: skip
        rows += [
            Row(34, quantity, unit, 'foot', name, pressure, None, value, None, 'linear')
            for quantity, unit, value in (
                ('slope', '', line.slope),
                ('intercept', 'N', line.intercept),
                ('deviation from the line', '', line.deviation),
            )
        ]
    return rows


def _difference_rows(
    setup: FootBench,
    found: Mapping[tuple[str, str], Sequence[Pulled]],
    drawn: Mapping[tuple[str, str, float, str], Array],
) -> list[Row]:
    rows = []
    for (shape, floor, load, kind), values in drawn.items():
        pulled = found[shape, floor][0 if load == setup.lowest_load else -1]
        condition = f'{shape}, {floor}, {kind}'
        pressure = setup.pressure if shape == DOME else 0.0
        for model, value in (
            ('foot', pulled.less_dry(kind)),
            ('5 % of draws', float(np.quantile(values, LOW))),
            ('95 % of draws', float(np.quantile(values, HIGH))),
        ):
            rows.append(
                Row(34, 'wet less dry', 'N', model, condition, pressure, load, value, None,
                    NOT_CODED)
            )  # fmt: skip
        share = float(np.mean(values > 0.0))
        rows.append(
            Row(34, 'share of draws above 0', '', 'foot', condition, pressure, load, share, None,
                NOT_CODED)
        )  # fmt: skip
    return rows


def _capillary_rows(foot: Foot, setup: FootBench, curves: Mapping[str, Curve]) -> list[Row]:
    """Return the estimates of the thesis for all domes, as magnitudes."""
    found = [
        (name, float(curve.x[place]), float(curve.y[place]))
        for name, curve in curves.items()
        if name == PATTERN or name.startswith('3.82')
        for place in (0, -1)
    ]
    load = setup.lowest_load
    for (liquid_name, liquid), balance in itertools.product(
        _LIQUIDS.items(), ('energy', 'thesis')
    ):
        force = _by_layers(foot, setup.pressure, load, liquid, balance)
        if math.isfinite(force):  # not where the liquid reaches the base of the pads
            found.append((f'4.18, {balance}, {liquid_name}', load, force))
    claimed = f'within {100 * setup.claimed_lowest:g} to {100 * setup.claimed_highest:g} %'
    return [
        Row(34, 'capillary force of the thesis', 'N', name, WET, setup.pressure, load, force, None,
            claimed)
        for name, load, force in found
    ]  # fmt: skip


_LIQUIDS = {'water': WATER, '4 mN/m': Liquid(0.004, 0.002)}  # the second is that of 4.2.1


def _by_layers(foot: Foot, pressure: float, load: float, liquid: Liquid, balance: str) -> float:
    """Return 4.18 for all domes, each alone, N; NaN where the liquid reaches their base."""
    pressed = press(foot.pad, pressure, load / foot.pads)
    sphere, contact = float(pressed.sphere_radius), float(pressed.contact_radius)
    mesh = Mesh.dome(sphere, contact, float(pressed.gap), rings=48, sectors=48)
    return foot.pads * abs(wet(mesh, liquid, balance, slices=4, strict=False).force(0.0))


# --- claims --------------------------------------------------------------------------------------


def _claims(
    scene: BenchScene,
    setup: FootBench,
    rows: Sequence[Row],
    found: Mapping[tuple[str, str], Sequence[Pulled]],
    lines: Mapping[str, Line],
) -> tuple[Claim, ...]:
    return (
        claim(
            'microscope pictures of a',
            f'The rough one is taken as {1e6 * setup.roughness:g} µm RMS, drawn up to twice and '
            'half.',
            (setup.roughness,),
            None,
        ),
        *(_sign_claim(setup, rows, *case) for case in CASES),
        _linear_claim(setup, lines),
        _small_claim(found),
        _error_claim(setup, rows, found),
        _viscosity_claim(scene.foot, setup, found),
        _pressure_claim(scene.foot, setup),
        _title_claim(found),
    )


def _sign_claim(setup: FootBench, rows: Sequence[Row], shape: str, floor: str) -> Claim:
    """Return the verdict on the sign: decided where an interval is on one side of 0."""
    parts, lows, highs = [], [], []
    for kind in _kinds(shape):
        mine = [row for row in rows if row.condition == f'{shape}, {floor}, {kind}']
        here, low, high = (
            [1e3 * row.modelled for row in mine if row.model == model and row.unit == 'N']
            for model in ('foot', '5 % of draws', '95 % of draws')
        )
        share = [f'{100 * row.modelled:.0f}' for row in mine if not row.unit]
        parts.append(
            f'{kind} {_few(here[0])} and {_few(here[1])} mN, above 0 in {share[0]} and '
            f'{share[1]} % of draws'
        )
        if kind != NONE:
            lows += low
            highs += high
    decided = True if min(lows) > 0.0 else False if max(highs) < 0.0 else None
    loads = f'At {setup.lowest_load:g} and {setup.highest_load:g} N: '
    return claim(
        'f cap f wet',
        loads + '; '.join(parts).replace('-', '−') + f'; {setup.samples} draws.',
        (*lows, *highs),
        decided,
        thesis=f'F_cap = F_wet − F_dry is what the liquid adds ({shape}, {floor}).',
    )


def _few(value: float) -> str:
    """Return a force, mN, with about two digits."""
    return f'{value:.{0 if abs(value) >= 100.0 else 1 if abs(value) >= 1.0 else 2}f}'


def _linear_claim(setup: FootBench, lines: Mapping[str, Line]) -> Claim:
    worst = max(lines, key=lambda name: lines[name].deviation)
    good = sum(line.deviation <= STRAIGHT for line in lines.values())
    return claim(
        'friction is linear in',
        f'Up to {setup.highest_load:g} N {good} of {len(lines)} lines are straight; the worst is '
        f'off by {100 * lines[worst].deviation:.2g} % of its largest force ({worst}).',
        tuple(line.deviation for line in lines.values()),
        True if good == len(lines) else None,
    )


def _small_claim(found: Mapping[tuple[str, str], Sequence[Pulled]]) -> Claim:
    share = max(each.lines / each.wet for each in (*found[DOME, SMOOTH], *found[DOME, ROUGH]))
    first, last = found[DOME, SMOOTH][0], found[DOME, SMOOTH][-1]
    return claim(
        'the capillary force is',
        f'Pinned lines hold at most {100 * share:.2g} % of the force of domes, and '
        f'{last.lines / first.lines:.2f} times as much at the highest as at the lowest load, '
        f'where dry friction is {last.dry / first.dry:.1f} times as much. Suction on moist ground '
        f'may be {100 * first.suction / first.dry:.0f} % of it at the lowest load.',
        (share,),
        share <= MINIMAL and last.lines / first.lines < last.dry / first.dry * (1.0 - MINIMAL),
    )


def _error_claim(
    setup: FootBench, rows: Sequence[Row], found: Mapping[tuple[str, str], Sequence[Pulled]]
) -> Claim:
    mine = [row for row in rows if row.quantity == 'capillary force of the thesis']
    estimates = [1e3 * row.modelled for row in mine]
    last = found[DOME, SMOOTH][-1]
    middle = 0.5 * (setup.claimed_lowest + setup.claimed_highest)
    needed = [middle * force / math.sqrt(2.0) for force in (last.lines, last.suction)]
    return claim(
        'measured and estimated capillary 2',
        f'By {len({row.model for row in mine})} readings and liquids, estimates for the foot are '
        f'{_few(min(estimates))} to {_few(max(estimates))} mN.',
        tuple(estimates),
        None,
        printed=f'{100 * setup.claimed_lowest:g} to {100 * setup.claimed_highest:g} %',
        rule=f'To know F_cap to {100 * middle:.0f} %, each force at {setup.highest_load:g} N must '
        f'be known to {100 * needed[0] / last.dry:.2g} % (if it is that of pinned lines) or '
        f'{100 * needed[1] / last.dry:.2g} % (if that of suction).',
    )


def _shear(foot: Foot, setup: FootBench) -> float:
    """Return Couette shear, N, of the sole on a film as thin as the roughness of the pad."""
    return setup.viscosity * setup.speed * foot.sole_area / foot.critical_film


def _viscosity_claim(
    foot: Foot, setup: FootBench, found: Mapping[tuple[str, str], Sequence[Pulled]]
) -> Claim:
    shear = _shear(foot, setup)
    share = shear / min(each.wet for pulled in found.values() for each in pulled)
    return claim(
        'the stage is slow',
        f'Shear of the film is at most {1e3 * shear:.1g} mN, {100 * share:.1g} % of the smallest '
        'force. But films drain during so slow a pull, which moves F_wet more than any capillary '
        'force.',
        (share,),
        share <= STRAIGHT,
        printed=f'{1e3 * setup.speed:g} mm/s',
    )


def _pressure_claim(foot: Foot, setup: FootBench) -> Claim:
    each = {
        name: foot.pads * float(force_limit(foot.pad, setup.pressure, name))
        for name in ('measured', 'thickness', 'flattening')
    }
    return claim(
        'a foot stands on',
        f'{foot.pads} such domes carry '
        + ', '.join(f'{value:.2f} N by `{name}`' for name, value in each.items())
        + '. The line through the limits of 3.2.2 is 0 below 52 kPa.',
        tuple(each.values()),
        None,
        thesis=f'A foot stands on domes of {1e-3 * setup.pressure:g} kPa.',
    )


def _title_claim(found: Mapping[tuple[str, str], Sequence[Pulled]]) -> Claim:
    shares, gains = [], []
    for floor, place in itertools.product((SMOOTH, ROUGH), (0, -1)):
        dome, flat = found[DOME, floor][place], found[FLAT, floor][place]
        gains.append(dome.wet / flat.wet)
        shares.append((dome.lines + dome.suction) / (dome.wet - flat.wet))
    return claim(
        'title shape enhances wet',
        f'On flooded ground domes hold {min(gains):.1f} to {max(gains):.1f} times what the flat '
        'foot holds, for their pressure drains the film. Pinned lines and suction, upper bounds, '
        f'are {100 * min(shares):.2g} to {100 * max(shares):.2g} % of that gain: here shape '
        'enhances wet friction.',
        tuple(shares),
        None,
    )


# --- notes ---------------------------------------------------------------------------------------


def _notes(scene: BenchScene, setup: FootBench) -> tuple[str, ...]:
    foot = scene.foot
    limit = foot.pads * float(force_limit(foot.pad, setup.pressure, foot.limit))
    full = foot.sole_area * foot.conforming_pressure
    return notes(
        'foot',
        pressure=1e-3 * setup.pressure,
        pads=foot.pads,
        limit=limit,
        criterion=foot.limit,
        full=full,
        samples=setup.samples,
        factor=setup.factor,
        seed=setup.seed,
    )


def _omitted(
    foot: Foot, setup: FootBench, found: Mapping[tuple[str, str], Sequence[Pulled]]
) -> tuple[Omission, ...]:
    shear = _shear(foot, setup)
    gap = press(foot.pad, setup.pressure, setup.lowest_load / foot.pads).gap
    weight = WATER.density * GRAVITY * foot.sole_area * float(gap)
    return left_out(
        'foot',
        shear=shear / min(each.wet for pulled in found.values() for each in pulled),
        weight=weight / setup.lowest_load,
    )

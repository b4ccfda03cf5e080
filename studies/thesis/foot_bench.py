# SPDX-License-Identifier: Apache-2.0
"""Compute the bench of a whole foot: tangential forces on four floors (thesis 4.3.1, figure 34).

The thesis prints no number of the figure. Intervals draw every assumed number anew, so that a
verdict stands only where it does not depend on them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from ros_pad.capillary import Mesh, wet
from ros_pad.contact.dome import press
from ros_pad.contact.limits import force_limit
from ros_pad.contact.meniscus import GRAVITY, WATER, Liquid, meniscus
from ros_pad.contact.pad import Array
from ros_pad.contact.resistance import Foot
from studies.thesis.bench import BenchTrial, Curve, Row
from studies.thesis.bench_scene import BenchScene
from studies.thesis.explained import MINIMAL, Claim, claim, left_out, notes
from studies.thesis.tangential import CAPILLARY, DRY, WET, pinned, slip_force

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


def on_floors(foot: Foot, setup: Any) -> dict[str, Foot]:
    """Return the foot as it is on each floor."""
    return {SMOOTH: foot, ROUGH: foot.on_rough(setup.roughness)}


def pull(foot: Foot, setup: Any, load: float, shape: str) -> Pulled:
    """Return the forces of a foot, as it is on its floor, under a load, N, flat or domed.

    Pinned lines run around every dome, or around the flat sole. Suction is that of a small ring of
    water, at a contact angle of 0, around each dome on a floor that is moist, not flooded:
    4 π R γ, whatever its volume, times the friction that a further load meets.
    """
    pressure = setup.pressure if shape == DOME else 0.0
    dry, wet = (slip_force(foot, setup, load, pressure, wet) for wet in (False, True))
    if not pressure:
        return Pulled(dry, wet, float(pinned(foot.sole_radius, setup)), 0.0)
    pressed = press(foot.pad, pressure, load / foot.pads)
    lines = foot.pads * float(pinned(pressed.contact_radius, setup))
    bridges = foot.pads * 4.0 * math.pi * pressed.sphere_radius * WATER.surface_tension
    return Pulled(dry, wet, lines, bridges * dry / load)


def draws(foot: Foot, setup: Any) -> list[tuple[Foot, Any, float]]:
    """Return feet and benches with every assumed number drawn anew, and a factor on pinned lines.

    Each number has a factor of its own, log-uniform between one over the bench's and that. Pads
    are rounded up, and no more than fit on the sole.
    """
    generator = np.random.default_rng(setup.seed)
    names = (*_ON_FOOT, *_ON_BENCH, 'pads', 'lines')
    most = int((foot.sole_radius / foot.pad.radius) ** 2)
    drawn = []
    for _ in range(setup.samples):
        random = setup.factor ** generator.uniform(-1.0, 1.0, len(names))
        factors = dict(zip(names, random.tolist(), strict=True))
        own = {name: factors[name] * getattr(foot, name) for name in _ON_FOOT}
        own['pads'] = min(math.ceil(factors['pads'] * foot.pads), most)
        bench = {name: factors[name] * getattr(setup, name) for name in _ON_BENCH}
        changed = SimpleNamespace(**vars(setup) | bench)
        drawn.append((replace(foot, **own), changed, factors['lines']))
    return drawn


Found = Mapping[tuple[str, str], Sequence[Pulled]]
"""Forces over the load by morphology and floor."""


def compute(scene: BenchScene) -> BenchTrial:
    """Compute the bench of a foot.

    Raises
    ------
    NoEquilibrium
        Where a dome of the scene does not exist.
    """
    foot, setup = scene.foot, scene.setup
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
    limit = foot.pads * float(force_limit(foot.pad, setup.pressure, foot.limit))
    stated = notes(
        'foot', pressure=1e-3 * setup.pressure, pads=foot.pads, limit=limit, criterion=foot.limit,
        full=foot.sole_area * foot.conforming_pressure, samples=setup.samples,
        factor=setup.factor, seed=setup.seed,
    )  # fmt: skip
    # Couette shear of the sole on a film as thin as the roughness of the pad
    shear = setup.viscosity * setup.speed * foot.sole_area / foot.critical_film
    share = shear / min(each.wet for pulled in found.values() for each in pulled)
    gap = press(foot.pad, setup.pressure, setup.lowest_load / foot.pads).gap
    weight = WATER.density * GRAVITY * foot.sole_area * float(gap)
    omitted = left_out('foot', shear=share, weight=weight / setup.lowest_load)
    claims = _claims(scene, rows, found, lines, shear, share)
    return BenchTrial(scene, rows, claims, curves, stated, omitted)


def _curves(foot: Foot, setup: Any, loads: Array, found: Found) -> dict[str, Curve]:
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


def _drawn(foot: Foot, setup: Any) -> dict[tuple[str, str, float, str], Array]:
    """Return wet less dry, N, for all draws, by morphology, floor, load and kind."""
    values: dict[tuple[str, str, float, str], list[float]] = {}
    for own, bench, factor in draws(foot, setup):
        feet = on_floors(own, bench)
        ends = setup.lowest_load, setup.highest_load
        for (shape, floor), load in itertools.product(CASES, ends):
            pulled = pull(feet[floor], bench, load, shape)
            pulled = pulled._replace(lines=factor * pulled.lines)
            for kind in _kinds(shape):
                values.setdefault((shape, floor, load, kind), []).append(pulled.less_dry(kind))
    return {key: np.array(each) for key, each in values.items()}


def _force_rows(setup: Any, curves: Mapping[str, Curve], lines: Mapping[str, Line]) -> list[Row]:
    rows = []
    for name, line in lines.items():
        pressure = setup.pressure if name.startswith(DOME) else 0.0
        rows += [
            Row(34, 'tangential force', 'N', 'foot', name, pressure, load, force)
            for load, force in np.transpose(curves[name])[[0, -1]].tolist()
        ]
        rows += [
            Row(34, quantity, unit, 'foot', name, pressure, None, value, None, 'linear')
            for (quantity, unit), value in zip(_LINE.items(), line, strict=True)
        ]
    return rows


_LINE = {'slope': '', 'intercept': 'N', 'deviation from the line': ''}


def _difference_rows(
    setup: Any, found: Found, drawn: Mapping[tuple[str, str, float, str], Array]
) -> list[Row]:
    rows = []
    for (shape, floor, load, kind), values in drawn.items():
        pulled = found[shape, floor][0 if load == setup.lowest_load else -1]
        at = f'{shape}, {floor}, {kind}', setup.pressure if shape == DOME else 0.0, load
        low, high = np.quantile(values, (LOW, HIGH)).tolist()
        less = {'foot': pulled.less_dry(kind), '5 % of draws': low, '95 % of draws': high}
        rows += [Row(34, 'wet less dry', 'N', name, *at, value) for name, value in less.items()]
        share = float(np.mean(values > 0.0))
        rows.append(Row(34, 'share of draws above 0', '', 'foot', *at, share))
    return rows


_LIQUIDS = {'water': WATER, '4 mN/m': Liquid(0.004, 0.002)}  # the second is that of 4.2.1


def _capillary_rows(foot: Foot, setup: Any, curves: Mapping[str, Curve]) -> list[Row]:
    """Return the estimates of the thesis for all domes, as magnitudes."""
    found = [
        (name, *end)
        for name, curve in curves.items()
        if name == PATTERN or name.startswith('3.82')
        for end in np.transpose(curve)[[0, -1]].tolist()
    ]
    load = setup.lowest_load
    pressed = press(foot.pad, setup.pressure, load / foot.pads)
    sphere, contact = float(pressed.sphere_radius), float(pressed.contact_radius)
    mesh = Mesh.dome(sphere, contact, float(pressed.gap), rings=48, sectors=48)
    for (name, liquid), balance in itertools.product(_LIQUIDS.items(), ('energy', 'thesis')):
        # 4.18 for all domes, each alone
        force = wet(mesh, liquid, balance, slices=4, strict=False).force(0.0)
        if math.isfinite(force):  # not where the liquid reaches the base of the pads
            found.append((f'4.18, {balance}, {name}', load, foot.pads * abs(force)))
    claimed = f'within {100 * setup.claimed_lowest:g} to {100 * setup.claimed_highest:g} %'
    quantity = 'capillary force of the thesis'
    return [
        Row(34, quantity, 'N', name, WET, setup.pressure, load, force, None, claimed)
        for name, load, force in found
    ]


# --- claims --------------------------------------------------------------------------------------


def _claims(
    scene: BenchScene,
    rows: Sequence[Row],
    found: Found,
    lines: Mapping[str, Line],
    shear: float,
    share: float,
) -> tuple[Claim, ...]:
    foot, setup = scene.foot, scene.setup
    worst = max(lines, key=lambda name: lines[name].deviation)
    good = sum(line.deviation <= STRAIGHT for line in lines.values())
    limits = {
        name: foot.pads * float(force_limit(foot.pad, setup.pressure, name))
        for name in ('measured', 'thickness', 'flattening')
    }
    return (
        claim('microscope pictures of a', setup.roughness, None, roughness=1e6 * setup.roughness),
        *(_sign_claim(setup, rows, *case) for case in CASES),
        claim('friction is linear in', [line.deviation for line in lines.values()],
              True if good == len(lines) else None, load=setup.highest_load, good=good,
              count=len(lines), worst=lines[worst].deviation, name=worst),
        _small_claim(found),
        _error_claim(setup, rows, found[DOME, SMOOTH][-1]),
        claim('the stage is slow', share, share <= STRAIGHT, shear=1e3 * shear, share=share,
              speed=1e3 * setup.speed),
        claim('a foot stands on', [*limits.values()], None, pads=foot.pads, **limits,
              pressure=1e-3 * setup.pressure),
        _title_claim(found),
    )  # fmt: skip


def _sign_claim(setup: Any, rows: Sequence[Row], shape: str, floor: str) -> Claim:
    """Return what is left of wet less dry force, with and without what liquid may add."""
    parts, ends = [], []
    for kind in _kinds(shape):
        mine = [row for row in rows if row.condition == f'{shape}, {floor}, {kind}']
        here, low, high = (
            [1e3 * row.modelled for row in mine if row.model == model and row.unit == 'N']
            for model in ('foot', '5 % of draws', '95 % of draws')
        )
        shares = [f'{100 * row.modelled:.0f}' for row in mine if not row.unit]
        parts.append(f'{kind} {_few(here)} mN, above 0 in {" and ".join(shares)} % of draws')
        ends += [*low, *high] if kind != NONE else []
    return claim(
        'f cap f wet', ends, None, shape=shape, floor=floor,
        loads=(setup.lowest_load, setup.highest_load), parts='; '.join(parts),
        samples=setup.samples,
    )  # fmt: skip


def _few(values: Iterable[float]) -> str:
    """Return forces, mN, with about two digits."""
    return ' and '.join(
        f'{value:.{0 if abs(value) >= 100.0 else 1 if abs(value) >= 1.0 else 2}f}'
        for value in values
    ).replace('-', '−')


def _small_claim(found: Found) -> Claim:
    share = max(each.lines / each.wet for each in (*found[DOME, SMOOTH], *found[DOME, ROUGH]))
    first, last = found[DOME, SMOOTH][0], found[DOME, SMOOTH][-1]
    lines, dry = last.lines / first.lines, last.dry / first.dry
    return claim(
        'the capillary force is', share, share <= MINIMAL and lines < dry * (1.0 - MINIMAL),
        share=share, lines=lines, dry=dry, suction=first.suction / first.dry,
    )  # fmt: skip


def _error_claim(setup: Any, rows: Sequence[Row], last: Pulled) -> Claim:
    mine = [row for row in rows if row.quantity == 'capillary force of the thesis']
    estimates = [1e3 * row.modelled for row in mine]
    ends = setup.claimed_lowest, setup.claimed_highest
    middle = 0.5 * sum(ends)
    lines, suction = (
        middle * force / math.sqrt(2.0) / last.dry for force in (last.lines, last.suction)
    )
    return claim(
        'measured and estimated capillary 2', estimates, None,
        count=len({row.model for row in mine}), least=_few([min(estimates)]),
        most=_few([max(estimates)]), lowest=100 * ends[0], highest=100 * ends[1], middle=middle,
        load=setup.highest_load, lines=lines, suction=suction,
    )  # fmt: skip


def _title_claim(found: Found) -> Claim:
    shares, gains = [], []
    for floor, place in itertools.product((SMOOTH, ROUGH), (0, -1)):
        dome, flat = found[DOME, floor][place], found[FLAT, floor][place]
        gains.append(dome.wet / flat.wet)
        shares.append((dome.lines + dome.suction) / (dome.wet - flat.wet))
    return claim(
        'title shape enhances wet', shares, None, least=min(gains), most=max(gains),
        low=100 * min(shares), high=100 * max(shares),
    )  # fmt: skip

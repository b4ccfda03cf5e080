# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with other methods and with ours.

In each case other methods and those of ros_pad get the same inputs. A number measures the failure,
and a law predicts at which inputs and by how much a method must fail.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.optimize import brentq

from ros_pad.contact import laws
from ros_pad.contact.film import WATER_VISCOSITY, Film, film_thickness
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.pace import Progress
from ros_pad.simulation.planar_step import newton
from ros_pad.simulation.pneumatics import (
    ATMOSPHERE,
    REFERENCE_DENSITY,
    REFERENCE_PRESSURE,
    Hose,
    PneumaticChannel,
    RegulatorModel,
)
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import LeggedBody, RailBody, Scene
from ros_pad.simulation.soles import LOSS, Sole, Soles
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, SKY, VERMILION

# The hexapod of the shipped scenes.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
assert isinstance(_SCENE.body, LeggedBody)
MASS, STIFFNESS = _SCENE.body.mass, _SCENE.foot.shear_stiffness


@dataclass(frozen=True)
class Outcome:
    """Result of a method for one input of a case.

    Attributes
    ----------
    case, method : str
    ours : bool
        Whether the method belongs to ros_pad.
    input, measure : str
        Name and unit of the varied quantity, and of the measure of failure.
    at : float
        Value of the varied quantity.
    value : float or None
        Value of the measure; None if the method reports that it has no result.
    law : float or None
        Value predicted by the law of the case; None if the law gives none.
    fails : bool
        Whether the method fails.
    limit : float or None
        Value of the varied quantity up to which (for a mass, from which) the method must hold.
    """

    case: str
    method: str
    ours: bool
    input: str
    at: float
    measure: str
    value: float | None
    law: float | None
    fails: bool
    limit: float | None = None


@dataclass(frozen=True)
class Case:
    """A case, with names and units of the varied quantity and of the measure of failure."""

    name: str
    input: str
    measure: str
    worst: float

    def of(
        self, method: str, ours: bool, inputs: Sequence[float], value: Callable[[float], float],
        law: Callable[[float], float | None] | float | None = None, limit: float | None = None,
    ) -> list[Outcome]:  # fmt: skip
        """Return the outcomes of a method, which fails where its value is above ``worst``."""
        found = [(at, value(at)) for at in inputs]
        return [
            Outcome(self.name, method, ours, self.input, at, self.measure,
                    each if math.isfinite(each) else None, law(at) if callable(law) else law,
                    not each <= self.worst, limit)
            for at, each in found
        ]  # fmt: skip


def measure(progress: Progress) -> list[Outcome]:
    """Return the outcomes of all cases; report progress, 0 to 1, to ``progress``."""
    outcomes: list[Outcome] = []
    cases = creep, threshold, standing, bouncing, in_series, films, filling
    for number, case in enumerate(cases):
        progress(number / len(cases))
        outcomes += case()
    progress(1.0)
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as text, a line for each case and method."""
    rows = []
    for name in dict.fromkeys(outcome.case for outcome in outcomes):
        for method, part in _methods([row for row in outcomes if row.case == name]).items():
            rows.append({
                'case': f'{name}, {part[0].input}: {part[0].measure}',
                'method': method,
                'inputs': len(part),
                'failures': sum(row.fails for row in part),
                'first at': min((row.at for row in part if row.fails), default=None),
                'worst value': max((row.value or 0.0 for row in part), default=None),
            })  # fmt: skip
    return command.listed(rows)


def _methods(case: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    return {
        name: [outcome for outcome in case if outcome.method == name]
        for name in dict.fromkeys(outcome.method for outcome in case)
    }


# --- a: creep in MuJoCo --------------------------------------------------------------------------

PUSH = 0.8  # force over the friction limit
CREEP_STEPS = (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)
CREEPS = Case('creep in MuJoCo', 'step, s', 'creep, m/s', 1e-4)
_TOUCH = 0.8  # coefficient of friction
_TIME = 0.95 * 0.02  # s: of the default softness
# Settings by name: cone, impratio, iterations of noslip.
SETTINGS = {
    'pyramidal, impratio 1 (default)': ('pyramidal', 1, 0),
    'elliptic, impratio 1': ('elliptic', 1, 0),
    'elliptic, impratio 10': ('elliptic', 10, 0),
    'elliptic, impratio 100': ('elliptic', 100, 0),
    'elliptic, impratio 10, noslip 5': ('elliptic', 10, 5),
}
_BLOCK = """
<mujoco>
  <option timestep="{dt!r}" cone="{cone}" impratio="{ratio}" noslip_iterations="{noslip}"
    tolerance="1e-12" gravity="0 0 -{gravity}"/>
  <worldbody>
    <geom type="plane" size="9 9 1" friction="{friction} 0 0"/>
    <body pos="0 0 0.02">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 1 0"/>
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.02" mass="{mass}" friction="{friction} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def creep_law(ratio: float) -> float:
    """Return the creep of a foot with MuJoCo's default softness, elliptic cone, m/s.

    Without acceleration, the creep v of a contact with force f follows from R f - b v = 0, with b
    = 2/(0.95 0.02 s) and R = (1/d - 1)/(m impratio), which do not depend on the step. The
    impedance d is taken at the depth at which the contact carries the weight, (1/d - 1) g = k d
    depth, k = 1/(0.95 0.02 s)².
    """
    d = _impedance(_depth(GRAVITY))
    return (1.0 / d - 1.0) * PUSH * _TOUCH * GRAVITY * _TIME / 2.0 / ratio


def _impedance(depth: float) -> float:
    """Return the default impedance of a contact at a depth, m."""
    share = min(depth / 1e-3, 1.0)
    bend = 2.0 * share * share if share < 0.5 else 1.0 - 2.0 * (1.0 - share) ** 2
    return 0.9 + 0.05 * bend


def _depth(pressed: float) -> float:
    """Return how deep a force over mass, N/kg, sinks in a contact with the default softness, m."""

    def carries(depth: float) -> float:
        d = _impedance(depth)
        return (1.0 / d - 1.0) * pressed - d * depth / (_TIME * _TIME)

    return float(brentq(carries, 0.0, 10.0, xtol=1e-15))


def mujoco_creep(dt: float, cone: str, ratio: float, noslip: int) -> float:
    """Return the creep of a block in MuJoCo that is pushed below its friction limit, m/s."""
    import mujoco

    text = _BLOCK.format(
        dt=dt, cone=cone, ratio=ratio, noslip=noslip, gravity=GRAVITY, friction=_TOUCH, mass=MASS
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    steps = round(0.5 / dt)
    mujoco.mj_step(model, data, steps)
    data.qfrc_applied[0] = PUSH * _TOUCH * MASS * GRAVITY
    mujoco.mj_step(model, data, steps)
    start = data.qpos[0]
    mujoco.mj_step(model, data, steps)
    return abs(float((data.qpos[0] - start) / (steps * dt)))


def planar_creep(dt: float) -> float:
    """Return the creep of such a block with the step of ros_pad, m/s.

    The push grows over 1 s, so that the pad hardly oscillates; the creep is the slope of the line
    through the path after it.
    """
    cap, rate = _TOUCH * MASS * GRAVITY, STIFFNESS * dt
    speed, sheared, x, path = 0.0, 0.0, 0.0, [0.0]
    for count in range(1, round(3.0 / dt) + 1):
        push = (0.5 - 0.5 * math.cos(math.pi * min(1.0, count * dt))) * PUSH * cap
        free = (speed + push / MASS * dt, 0.0, 0.0)
        foot = (0.0, 0.0, sheared / dt, 0.0, 0.0, 0.0, cap, rate)
        speed, _, _, settled = newton(free, MASS, 1.0, [foot], dt, (speed, 0.0, 0.0))
        assert settled
        sheared += speed * dt  # it never slips
        x += speed * dt
        path.append(x)
    late = np.array(path[round(1.0 / dt) :])
    return float(np.polyfit(dt * np.arange(len(late)), late, 1)[0])


def creep() -> list[Outcome]:
    """Push a block with 0.8 of its friction limit, in MuJoCo and with the step of ros_pad."""
    outcomes = CREEPS.of('elastic', True, CREEP_STEPS, lambda dt: abs(planar_creep(dt)))
    for name, (cone, ratio, noslip) in SETTINGS.items():
        law = creep_law(ratio) if cone == 'elliptic' and not noslip else None
        outcomes += CREEPS.of(
            name, False, CREEP_STEPS,
            partial(mujoco_creep, cone=cone, ratio=ratio, noslip=noslip), law,
        )  # fmt: skip
    return outcomes


# --- b: the threshold of the rail leg ------------------------------------------------------------

RATIOS = (1.03, 1.06, 1.1, 1.17, 1.3, 1.47, 2.0, 3.0, 5.0)  # cap over drag
RAIL_STEPS = (4e-3, 1e-3)
THRESHOLD = Case(
    'threshold of the rail leg', 'cap over drag',
    'change of the distance for one per cent of friction, %', 3.0,
)  # fmt: skip


def rail_distance(ratio: float, dt: float) -> float:
    """Return the distance of a rail leg of 1 kg with a given ratio of cap to drag, m."""
    scene = Scene.load('leg_dry_flat')
    assert isinstance(scene.body, RailBody)
    body = dataclasses.replace(scene.body, mass=1.0, rolling_drag=0.23)
    foot = dataclasses.replace(
        scene.foot, friction=ratio * body.rolling_drag / body.load, shear_strength=0.0
    )
    scene = dataclasses.replace(scene, body=body, foot=foot, settle=0.0)
    leg = RailLeg(scene, scene.floor.build(0), dt)
    for _ in range(round(4 * scene.gait.cycle / dt)):
        leg.step([0.0])
    return leg.body[0]


def condition(ratio: float, dt: float) -> float:
    """Return d ln distance / d ln friction of a rail leg with a ratio of cap to drag."""
    low, high = rail_distance(0.995 * ratio, dt), rail_distance(1.005 * ratio, dt)
    return math.log(high / low) / math.log(1.005 / 0.995)


def threshold() -> list[Outcome]:
    """Change the friction of a rail leg by one per cent; a shorter step has the same effect.

    While the foot slips, the body accelerates in proportion to cap c less drag F, so the law for
    small c - F is c/(c - F).
    """
    return [
        outcome
        for dt in RAIL_STEPS
        for outcome in THRESHOLD.of(
            f'RailLeg, step {1e3 * dt:g} ms', True, RATIOS, partial(condition, dt=dt),
            lambda ratio: ratio / (ratio - 1.0) if ratio <= 1.5 else None,
        )
    ]  # fmt: skip


# --- c, d: the spring and the damper of a foot ---------------------------------------------------

STEPS = tuple(float(dt) for dt in np.geomspace(5e-5, 2e-2, 14))
LANDS = 0.1  # m/s
STANDS = Case('stiff damped foot', 'step, s', 'load off the weight, share', 0.1)
BOUNCES = Case('spring at a large step', 'step, s', 'speed off after a bounce, share', 0.1)
_CARRIED = _SCENE.expected_load / GRAVITY  # kg
_DOMES = laws.spring(_SCENE.foot, 0.0, 75e3)[1]  # N/m
_LOSS = LOSS * math.sqrt(_DOMES / _CARRIED) / GRAVITY  # of the damper over the force, s/m
_FOOT = """
<mujoco>
  <option timestep="{dt!r}" gravity="0 0 -{gravity!r}" tolerance="1e-12"/>
  <worldbody>
    <geom name="floor" type="plane" size="9 9 1" contype="0"/>
    <body pos="0 0 1e-4">
      <joint type="slide" axis="0 0 1"/>
      <geom name="foot_1" size="1e-4" mass="{mass!r}" contype="0"/>
    </body>
  </worldbody>
  <contact><pair name="foot_1" geom1="floor" geom2="foot_1" condim="1"/></contact>
</mujoco>
"""
Motion = tuple[float, float, float]  # height, m, speed, m/s, and load, N
Advance = Callable[[float, float], Motion]


def by_euler(dt: float, pressure: float, loss: float, gravity: float, late: bool) -> Advance:
    """Return a step of a foot by explicit Euler; ``late``: places move at the new speed."""

    def advance(height: float, speed: float) -> Motion:
        force, _ = laws.spring(_SCENE.foot, max(0.0, -height), pressure)
        load = max(0.0, force * (1.0 - loss * speed))
        then = speed + dt * (load / _CARRIED - gravity)
        return height + dt * (then if late else speed), then, load

    return advance


def by_row(dt: float, pressure: float, loss: float, gravity: float) -> Advance:
    """Return a step of a foot as L2 makes it, in MuJoCo."""
    import mujoco

    text = _FOOT.format(dt=dt, gravity=gravity, mass=_CARRIED)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    sole: Any = Sole(Film(_SCENE.foot), 1, model, None)
    soles: Any = SimpleNamespace(foot=_SCENE.foot, _dt=dt, _loss=loss)
    sole.pressure = pressure

    def advance(height: float, speed: float) -> Motion:
        data.qpos[0], data.qvel[0] = height, speed
        Soles._give_way(soles, sole, max(0.0, -height))
        mujoco.mj_step(model, data)
        load = _CARRIED * (float(data.qacc[0]) + gravity)
        return float(data.qpos[0]), float(data.qvel[0]), load

    return advance


METHODS: dict[str, Callable[..., Advance]] = {
    'explicit Euler': partial(by_euler, late=False),
    'semi-implicit Euler': partial(by_euler, late=True),
    'L2': by_row,
}


def _stood(method: Callable[..., Advance], dt: float) -> float:
    """Return by how much of its weight the load of a flat foot is off, 2 s after 1 %."""
    advance = method(dt, 0.0, _LOSS, GRAVITY)
    height, speed, loads = -0.99 * _CARRIED * GRAVITY / _SCENE.foot.sole_stiffness, 0.0, []
    for _ in range(round(2.0 / dt)):
        height, speed, load = advance(height, speed)
        loads.append(load)
    late = np.array(loads[-round(0.2 / dt) :])
    return float(np.abs(late / (_CARRIED * GRAVITY) - 1.0).max())


def stable_steps() -> dict[str, float]:
    """Return the steps, s, up to which a foot comes to rest on its flat sole.

    Explicit Euler needs h < c/K, semi-implicit Euler h² K + 2 h c < 4 m.
    """
    stiffness, damper = _SCENE.foot.sole_stiffness, _LOSS * _CARRIED * GRAVITY
    root = math.sqrt(damper**2 + 4.0 * stiffness * _CARRIED)
    return {
        'explicit Euler': damper / stiffness,
        'semi-implicit Euler': (root - damper) / stiffness,
    }


def standing() -> list[Outcome]:
    """Let a flat foot stand."""
    outcomes, limits = [], stable_steps()
    for name, method in METHODS.items():
        outcomes += STANDS.of(
            name, name == 'L2', STEPS,
            partial(_stood, method),
            limit=limits.get(name),
        )  # fmt: skip
    return outcomes


def bounce_law(name: str, dt: float) -> float | None:
    """Return the share of the speed that a foot without damper gains or loses in a bounce.

    In half an oscillation explicit Euler gains the factor exp(π ω h/2), and an implicit step
    loses it, to first order; semi-implicit Euler has no error of first order.
    """
    first = 0.5 * math.pi * math.sqrt(_DOMES / _CARRIED) * dt
    return {'explicit Euler': math.expm1(first), 'L2': -math.expm1(-first)}.get(name)


def _bounced(method: Callable[..., Advance], dt: float) -> float:
    """Return the share of its speed that a foot without damper gains or loses in a bounce."""
    advance, height, speed = method(dt, 75e3, 0.0, 0.0), 0.0, -LANDS
    while height < 0.0 or speed < 0.0:
        height, speed, _ = advance(height, speed)
    return abs(speed / LANDS - 1.0)


def bouncing() -> list[Outcome]:
    """Let a foot without damper bounce from its domes, without gravity."""
    outcomes, rate = [], math.sqrt(_DOMES / _CARRIED)
    for name, method in METHODS.items():
        first_order = bounce_law(name, STEPS[0]) is not None
        outcomes += BOUNCES.of(
            name, name == 'L2', STEPS,
            partial(_bounced, method),
            partial(bounce_law, name),
            2.0 * BOUNCES.worst / (math.pi * rate) if first_order else 2.0 / rate,
        )  # fmt: skip
    return outcomes


# --- e: a light block on a spring ----------------------------------------------------------------

BLOCKS = tuple(float(mass) for mass in np.geomspace(5e-3, 30.0, 12))  # kg
SERIES = Case('light block in series', 'mass of the block, kg', 'depth over that of the pads', 2.0)
_SERIES = """
<mujoco>
  <option timestep="2e-4" gravity="0 0 -{gravity!r}" tolerance="1e-12"/>
  <worldbody>
    <body pos="0 0 -1" gravcomp="1">
      <joint type="slide" axis="0 0 1" stiffness="{stiffness!r}" damping="{damping!r}"/>
      <geom name="block" type="box" size="1 1 1" mass="{block!r}" contype="0"/>
    </body>
    <body pos="0 0 1e-4">
      <joint type="slide" axis="0 0 1"/>
      <geom name="foot" size="1e-4" mass="{mass!r}" contype="0"/>
    </body>
  </worldbody>
  <contact><pair geom1="block" geom2="foot" condim="1"/></contact>
</mujoco>
"""


def sunk_law(scene: Scene, block: float) -> float:
    """Return how deep a foot on domes sinks under its load on a block, over its pads alone.

    A block of mass m, kg, has the pads' spring below it. Its contact with the foot is a spring in
    series, of stiffness d²/((1 - d) w T²) with w = 1/m + 1/M, M the mass on the foot.
    """
    stiffness, load = laws.spring(scene.foot, 0.0, 75e3)[1], scene.expected_load
    return 1.0 + _depth(load / block + GRAVITY) * stiffness / load


def sunk(scene: Scene, block: float) -> float:
    """Return the same in MuJoCo."""
    import mujoco

    stiffness, mass = laws.spring(scene.foot, 0.0, 75e3)[1], scene.expected_load / GRAVITY
    damping = 2.0 * math.sqrt(stiffness * mass)
    text = _SERIES.format(
        gravity=GRAVITY, stiffness=stiffness, damping=damping, block=block, mass=mass
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 20_000)
    return -float(data.qpos[1]) * stiffness / scene.expected_load


def sunk_on_l2() -> float:
    """Return the same for a foot that has the pads' spring as its contact."""
    advance, height, speed = by_row(1e-3, 75e3, _LOSS, GRAVITY), 0.0, 0.0
    for _ in range(4000):
        height, speed, _ = advance(height, speed)
    return -height * _DOMES / _SCENE.expected_load


def in_series() -> list[Outcome]:
    """Let feet stand on blocks with the pads' spring below."""
    ours = sunk_on_l2()
    outcomes = SERIES.of('L2, no block', True, BLOCKS, lambda mass: ours, 1.0)
    for robot, scene in (('hexapod', _SCENE), ('quadruped', Scene.load('quadruped_patches'))):
        law = partial(sunk_law, scene)
        limit = brentq(lambda mass: math.log(law(mass) / SERIES.worst), 1e-3, 1e3)  # noqa: B023
        outcomes += SERIES.of(robot, False, BLOCKS, partial(sunk, scene), law, limit)
    return outcomes


# --- f: the film under a foot --------------------------------------------------------------------

THICK, FILM_STEPS = 0.3e-3, 200  # m; steps of a film
FILMS = Case('explicit film', 'step, s', 'error of the film, share', 0.1)
# Pressure, Pa, and radius, m, of rigid discs.
DISCS = {
    'sole': (_SCENE.expected_load / _SCENE.foot.sole_area, _SCENE.foot.sole_radius),
    'dome': (75e3, math.sqrt(0.185 / (math.pi * 75e3))),
}
FILM_TIMES = tuple(float(dt) for dt in np.geomspace(1e-8, 1e-2, 19))


def film_limit(pressure: float, radius: float) -> float:
    """Return the step, s, above which explicit Euler takes a film below zero."""
    return 3.0 * WATER_VISCOSITY * radius**2 / (2.0 * pressure * THICK**2)


def thinned(dt: float, disc: tuple[float, float]) -> float:
    """Return the relative error of a film that was thinned by explicit steps."""
    film, rate = THICK, 1.0 / (film_limit(*disc) * THICK**2)
    for _ in range(FILM_STEPS):
        film -= rate * film**3 * dt
        if abs(film) > 1.0:
            return math.inf
    return abs(film / float(film_thickness(THICK, *disc, FILM_STEPS * dt)) - 1.0)


def thinned_on_l2(dt: float) -> float:
    """Return the same for the flat sole with the film of walks."""
    film, thickness = Film(_SCENE.foot), THICK
    film.touch_down(THICK)
    for _ in range(FILM_STEPS):
        _, thickness = film.drain(0.0, _SCENE.expected_load, 0.0, dt)
    return abs(thickness / float(film_thickness(THICK, *DISCS['sole'], FILM_STEPS * dt)) - 1.0)


def films() -> list[Outcome]:
    """Drain the films of rigid discs: a flat sole, and a dome."""
    outcomes = FILMS.of('Film, sole', True, FILM_TIMES, thinned_on_l2)
    for name, disc in DISCS.items():
        outcomes += FILMS.of(
            f'explicit Euler, {name}', False, FILM_TIMES,
            partial(thinned, disc=disc), limit=film_limit(*disc),
        )  # fmt: skip
    return outcomes


# --- g: a hose near equal pressures --------------------------------------------------------------

FILL = 75e3  # Pa
FILL_STEPS = tuple(float(dt) for dt in np.geomspace(1e-5, 0.02, 12))
_LINE, _VOLUME = Hose(4e-3, 1.0), _SCENE.foot.air_volume(0.0)
FILLS = Case('pad filled through a hose', 'step, s', 'pressure off the set-point, Pa', 1.0)
_REGULATOR = RegulatorModel(natural_frequency=1000.0, damping=1.0, dead_time=0.0, dead_band=0.0)
_CAPACITY = REFERENCE_DENSITY * (_VOLUME + _LINE.volume) / REFERENCE_PRESSURE  # kg/Pa


def iso_flow(up: float, down: float) -> float:
    """Return the mass flow of ISO 6358 without a linear range, kg/s (absolute Pa)."""
    x = max(0.0, (min(up, down) / max(up, down) - _LINE.critical_ratio))
    share = math.sqrt(1.0 - (x / (1.0 - _LINE.critical_ratio)) ** 2)
    return math.copysign(
        _LINE.sonic_conductance * REFERENCE_DENSITY * max(up, down) * share, up - down
    )


def fill_law(dt: float) -> float:
    """Return the chatter of explicit Euler, Pa: (A dt/2)², never zero.

    Where dp/dt = A √|Δp|, a step takes Δp to -Δp when A dt √Δp = 2 Δp.
    """
    up, critical = FILL + ATMOSPHERE, 1.0 - _LINE.critical_ratio
    slope = _LINE.sonic_conductance * REFERENCE_DENSITY * math.sqrt(2.0 * up / critical)
    return (0.5 * slope / _CAPACITY * dt) ** 2


def filled(dt: float) -> list[float]:
    """Return the pressures of a pad that is filled by explicit Euler, Pa."""
    pressures = [ATMOSPHERE]
    for _ in range(round(0.5 / dt)):
        flow = iso_flow(FILL + ATMOSPHERE, pressures[-1])
        pressures.append(max(1.0, pressures[-1] + dt * flow / _CAPACITY))
    return [pressure - ATMOSPHERE for pressure in pressures]


def filled_by_channel(dt: float) -> list[float]:
    """Return the pressures of a pad that our channel fills, with a fast regulator, Pa."""
    channel = PneumaticChannel(_REGULATOR, _LINE, _VOLUME)
    return [channel.step(FILL, dt) for _ in range(round(0.5 / dt))]


def filling() -> list[Outcome]:
    """Fill a pad; chatter is the distance of the full pad from the pressure that is wanted."""

    def chatter(pressures: list[float]) -> float:
        return max(abs(pressure - FILL) for pressure in pressures[-10:])

    # The law holds for small differences of pressure.
    near = [dt for dt in FILL_STEPS if fill_law(dt) < 0.1 * FILL]
    return [
        *FILLS.of('explicit Euler', False, FILL_STEPS, lambda dt: chatter(filled(dt)),
                  lambda dt: fill_law(dt) if dt in near else None),
        *FILLS.of('PneumaticChannel', True, FILL_STEPS,
                  lambda dt: chatter(filled_by_channel(dt))),
    ]  # fmt: skip


# --- picture -------------------------------------------------------------------------------------

_OTHERS = ((VERMILION, 'o'), (ORANGE, 's'), (PURPLE, 'D'), (BLUE, '^'), (SKY, 'v'))
_LAW: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'zorder': 1.5}
# Cases, factors of input and value, least and largest value drawn, and what the axes are called.
_PANELS = (
    (CREEPS, 1e3, 1e3, 1e-5, 1e3, 'step, ms', 'creep at 0.8 of the limit, mm/s'),
    (THRESHOLD, 1.0, 1.0, 0.1, 100.0, 'cap over drag', 'distance for 1 % of friction, %'),
    (STANDS, 1e3, 1e2, 1e-4, 1e4, 'step, ms', 'load off the weight after 2 s, %'),
    (BOUNCES, 1e3, 1e2, 1e-2, 1e3, 'step, ms', 'speed off after a bounce, %'),
    (SERIES, 1.0, 1.0, 0.8, 400.0, 'mass of the block, kg', 'depth over that of the pads'),
    (FILMS, 1e3, 1e2, 1e-4, 1e4, 'step, ms', 'film off after 200 steps, %'),
    (FILLS, 1e3, 1e-3, 1e-4, 1e3, 'step, ms', 'pressure off, kPa'),
)


def figures(outcomes: list[Outcome], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name: a panel for each case; green is ours, black the law."""
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.5, 11.0), layout='constrained')
        panels = figure.subplots(3, 3).ravel()
        for letter, panel, (case, across, up, low, high, x, y) in zip(
            'abcdefg', panels, _PANELS, strict=False
        ):
            part = [outcome for outcome in outcomes if outcome.case == case.name]
            _draw(panel, part, across, up, (low, high))
            panel.set(xscale='log', yscale='log', title=f'{letter}  {case.name}')
            panel.set(xlabel=x, ylabel=y, ylim=(0.7 * low, 1.4 * high))
            panel.axhline(up * case.worst, color=PALE, lw=0.9, ls='--', zorder=1)
            panel.legend(fontsize=7.5, framealpha=0.85, frameon=True, edgecolor='none')
        for panel in panels[len(_PANELS) :]:
            panel.set_axis_off()
        handles = [
            Line2D([], [], **_LAW, label='law, not fitted'),
            Line2D([], [], color=BLACK, lw=1.1, ls=':', label='limit by the law, of its colour'),
            Line2D([], [], color=PALE, lw=0.9, ls='--', label='fails above'),
        ]
        panels[-2].legend(handles=handles, loc='center', fontsize=9.0)
    return {'stability': figure}


def _draw(
    panel: Axes, case: Sequence[Outcome], across: float, up: float, span: tuple[float, float]
) -> None:
    looks = iter(_OTHERS)
    for name, part in _methods(case).items():
        colour, marker = (GREEN, '.') if part[0].ours else next(looks)
        x = [across * row.at for row in part]
        y = np.clip([np.inf if row.value is None else up * row.value for row in part], *span)
        panel.plot(x, y, marker, color=colour, ms=4.0, ls='-', lw=0.9, label=name)
        law = [(across * row.at, up * row.law) for row in part if row.law]
        if law:
            panel.plot(*zip(*law, strict=True), **_LAW)
        if part[0].limit:
            panel.axvline(across * part[0].limit, color=colour, lw=1.1, ls=':', zorder=1)

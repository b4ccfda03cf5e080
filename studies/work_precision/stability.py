# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with other methods and with ours.

In each case other methods and those of ros_pad get the same inputs. A number measures the failure,
and a law predicts at which inputs and by how much a method must fail.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ros_pad.contact import laws
from ros_pad.contact.film import WATER_VISCOSITY, Film, film_thickness
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.pace import Progress
from ros_pad.simulation.planar_step import newton
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import LeggedBody, RailBody, Scene
from ros_pad.simulation.soles import LOSS, Sole, Soles
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, SKY, VERMILION

# The hexapod of the shipped scenes.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
assert isinstance(_SCENE.body, LeggedBody)
MASS, STIFFNESS = _SCENE.body.mass, _SCENE.foot.shear_stiffness


# Result of a method for one input of a case.
# ours: whether the method belongs to ros_pad; input, measure: name and unit of the varied quantity
# and of the measure of failure; at: value of the varied quantity; value: of the measure, None if
# there is none; law: what the law of the case predicts for it, if it does; limit: value of the
# varied quantity up to which (for a mass, from which) the method must hold
Outcome = SimpleNamespace


@dataclass(frozen=True)
class Case:
    """A case, with names and units of the varied quantity and of the measure of failure.

    A method fails where its value is above ``worst``; values are drawn from ``low`` to ``high``.
    """

    name: str
    input: str
    measure: str
    worst: float
    low: float
    high: float

    def of(
        self, method: str, ours: bool, inputs: Sequence[float], value: Callable[[float], float],
        law: Callable[[float], float | None] | float | None = None, limit: float | None = None,
    ) -> list[Outcome]:  # fmt: skip
        """Return the outcomes of a method for many inputs."""
        return [
            Outcome(
                case=self.name, method=method, ours=ours, input=self.input, at=at,
                measure=self.measure, value=each if math.isfinite(each) else None,
                law=law(at) if callable(law) else law, fails=not each <= self.worst, limit=limit,
            )
            for at, each in zip(inputs, map(value, inputs), strict=True)
        ]  # fmt: skip


def measure(progress: Progress) -> list[Outcome]:
    """Return the outcomes of all cases; report progress, 0 to 1, to ``progress``."""
    outcomes: list[Outcome] = []
    for number, case in enumerate((creep, threshold, feet, in_series, films)):
        progress(number / 5)
        outcomes += case()
    progress(1.0)
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as text, a line for each case and method."""
    rows = [
        {
            'case': f'{name}, {part[0].input}: {part[0].measure}',
            'method': method,
            'failures': sum(row.fails for row in part),
            'first at': min((row.at for row in part if row.fails), default=None),
            'worst value': max((row.value or 0.0 for row in part), default=None),
        }
        for (name, method), part in _methods(outcomes).items()
    ]
    return command.listed(rows)


def _methods(outcomes: Sequence[Outcome]) -> dict[tuple[str, str], list[Outcome]]:
    """Return the outcomes of each case and method."""
    parts: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        parts.setdefault((outcome.case, outcome.method), []).append(outcome)
    return parts


# --- a: creep in MuJoCo --------------------------------------------------------------------------

PUSH = 0.8  # force over the friction limit
CREEP_STEPS = (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)
CREEPS = Case('creep in MuJoCo', 'step, s', 'creep at 0.8 of the limit, m/s', 1e-4, 1e-13, 1.0)
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
    'threshold of the rail leg', 'cap over drag', 'distance for 1 % of friction, %', 3.0, 0.1, 50.0
)


def rail_distance(ratio: float, dt: float) -> float:
    """Return the distance of a rail leg of 1 kg with a given ratio of cap to drag, m."""
    scene = Scene.load('leg_dry_flat')
    assert isinstance(scene.body, RailBody)
    body = replace(scene.body, mass=1.0, rolling_drag=0.23)
    foot = replace(scene.foot, friction=ratio * body.rolling_drag / body.load, shear_strength=0.0)
    scene = replace(scene, body=body, foot=foot, settle=0.0)
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

STEPS = (5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)
STANDS = Case('stiff damped foot', 'step, s', 'load off the weight, share', 0.01, 1e-6, 100.0)
BOUNCES = Case(
    'spring at a large step', 'step, s', 'speed off by a bounce, share', 0.1, 1e-5, 10.0
)
_CARRIED = _SCENE.expected_load / GRAVITY  # kg
_DOMES = laws.spring(_SCENE.foot, 0.0, 75e3)[1]  # N/m
_LOSS = LOSS * math.sqrt(_DOMES / _CARRIED) / GRAVITY  # of the damper over the force, s/m
_FOOT = """
<mujoco> <option timestep="{dt!r}" gravity="0 0 -{gravity!r}" tolerance="1e-12"/>
  <worldbody> {floor}
    <body pos="0 0 1e-4"> <joint type="slide" axis="0 0 1"/>
      <geom name="foot_1" size="1e-4" mass="{mass!r}" contype="0"/> </body>
  </worldbody>
  <contact><pair name="foot_1" geom1="floor" geom2="foot_1" condim="1"/></contact>
</mujoco>
"""
_FLOOR = '<geom name="floor" type="plane" size="9 9 1" contype="0"/>'
# Of height, m, and speed, m/s, to those after a step, and the load, N.
Advance = Callable[[float, float], tuple[float, float, float]]


def by_euler(dt: float, pressure: float, loss: float, gravity: float, late: bool) -> Advance:
    """Return a step of a foot by explicit Euler; ``late``: places move at the new speed."""

    def advance(height: float, speed: float) -> tuple[float, float, float]:
        force, _ = laws.spring(_SCENE.foot, max(0.0, -height), pressure)
        load = max(0.0, force * (1.0 - loss * speed))
        then = speed + dt * (load / _CARRIED - gravity)
        return height + dt * (then if late else speed), then, load

    return advance


def by_row(dt: float, pressure: float, loss: float, gravity: float) -> Advance:
    """Return a step of a foot as L2 makes it, in MuJoCo."""
    import mujoco

    text = _FOOT.format(dt=dt, gravity=gravity, floor=_FLOOR, mass=_CARRIED)
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(text))
    sole: Any = Sole(Film(_SCENE.foot), 1, model, None)
    soles: Any = SimpleNamespace(foot=_SCENE.foot, _dt=dt, _loss=loss)
    sole.pressure = pressure

    def advance(height: float, speed: float) -> tuple[float, float, float]:
        data.qpos[0], data.qvel[0] = height, speed
        Soles._give_way(soles, sole, max(0.0, -height))
        mujoco.mj_step(model, data)
        load = _CARRIED * (float(data.qacc[0]) + gravity)
        return float(data.qpos[0]), float(data.qvel[0]), load

    return advance


def _stood(method: Callable[..., Advance], dt: float) -> float:
    """Return by how much of its weight the load of a flat foot is off, 2 s after 1 %."""
    advance = method(dt, 0.0, _LOSS, GRAVITY)
    height, speed, loads = -0.99 * _CARRIED * GRAVITY / _SCENE.foot.sole_stiffness, 0.0, []
    for _ in range(round(2.0 / dt)):
        height, speed, load = advance(height, speed)
        loads.append(load)
    late = np.array(loads[-round(0.2 / dt) :])
    return float(np.abs(late / (_CARRIED * GRAVITY) - 1.0).max())


def bounce_law(name: str, dt: float) -> float | None:
    """Return the share of the speed that a foot without damper gains or loses in a bounce.

    In half an oscillation explicit Euler gains the factor exp(π ω h/2), and a step that is
    implicit by half loses the root of it, to first order; semi-implicit Euler has no error of
    first order.
    """
    first = 0.5 * math.pi * math.sqrt(_DOMES / _CARRIED) * dt
    if first > 0.5:
        return None
    return {'explicit Euler': math.expm1(first), 'L2': -math.expm1(-0.5 * first)}.get(name)


def _bounced(method: Callable[..., Advance], dt: float) -> float:
    """Return the share of its speed that a foot without damper gains or loses in a bounce."""
    advance, height, speed = method(dt, 75e3, 0.0, 0.0), 0.0, -0.1
    while height < 0.0 or speed < 0.0:
        height, speed, _ = advance(height, speed)
    return abs(speed / 0.1 - 1.0)


def feet() -> list[Outcome]:
    """Let a flat foot stand, and a foot without damper bounce from its domes without gravity.

    To stand, explicit Euler needs h < c/K and semi-implicit Euler h² K + 2 h c < 4 m.
    """
    stiffness, damper = _SCENE.foot.sole_stiffness, _LOSS * _SCENE.expected_load
    rate, root = math.sqrt(_DOMES / _CARRIED), math.sqrt(damper**2 + 4.0 * stiffness * _CARRIED)
    first = 2.0 * BOUNCES.worst / (math.pi * rate)
    methods: tuple[tuple[str, Callable[..., Advance], float | None, float], ...] = (
        ('explicit Euler', partial(by_euler, late=False), damper / stiffness, first),
        ('semi-implicit Euler', partial(by_euler, late=True),
         (root - damper) / stiffness, 2.0 / rate),
        ('L2', by_row, None, 2.0 * first),
    )  # fmt: skip
    outcomes = []
    for name, method, stands, bounces in methods:
        law, ours = partial(bounce_law, name), name == 'L2'
        outcomes += STANDS.of(name, ours, STEPS, partial(_stood, method), limit=stands)
        outcomes += BOUNCES.of(name, ours, STEPS, partial(_bounced, method), law, bounces)
    return outcomes


# --- e: a light block on a spring ----------------------------------------------------------------

BLOCKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)  # kg
SERIES = Case(
    'light block in series', 'mass of the block, kg', 'depth over that of pads', 2.0, 0.8, 100.0
)
_BLOCK_ON_SPRING = """
<body pos="0 0 -1" gravcomp="1">
  <joint type="slide" axis="0 0 1" stiffness="{stiffness!r}" damping="{damping!r}"/>
  <geom name="floor" type="box" size="1 1 1" mass="{block!r}" contype="0"/> </body>
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
    given = {'stiffness': stiffness, 'damping': 2.0 * math.sqrt(stiffness * mass)}
    floor = _BLOCK_ON_SPRING.format(block=block, **given)
    text = _FOOT.format(dt=2e-4, gravity=GRAVITY, floor=floor, mass=mass)
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(text))
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
FILMS = Case('explicit film', 'step, s', 'film off after 200 steps, share', 0.1, 1e-6, 100.0)
_SOLE = _SCENE.expected_load / _SCENE.foot.sole_area, _SCENE.foot.sole_radius  # Pa and m
FILM_LIMIT = 3.0 * WATER_VISCOSITY * _SOLE[1] ** 2 / (2.0 * _SOLE[0] * THICK**2)  # s
FILM_TIMES = tuple(float(dt) for dt in np.geomspace(1e-5, 1e-2, 13))


def thinned(dt: float, explicit: bool) -> float:
    """Return the relative error of the film under a flat sole: by explicit Euler, or on L2."""
    thickness, rate, film = THICK, 1.0 / (FILM_LIMIT * THICK**2), Film(_SCENE.foot)
    film.touch_down(THICK)
    for _ in range(FILM_STEPS):
        if explicit:
            thickness -= rate * thickness**3 * dt
        else:
            _, thickness = film.drain(0.0, _SCENE.expected_load, 0.0, dt)
        if abs(thickness) > 1.0:
            return math.inf
    return abs(thickness / float(film_thickness(THICK, *_SOLE, FILM_STEPS * dt)) - 1.0)


def films() -> list[Outcome]:
    """Drain the film under a flat sole; explicit Euler takes it below zero above its limit."""
    return [
        *FILMS.of('L2', True, FILM_TIMES, partial(thinned, explicit=False)),
        *FILMS.of('explicit Euler', False, FILM_TIMES, partial(thinned, explicit=True),
                  limit=FILM_LIMIT),
    ]  # fmt: skip


# --- picture -------------------------------------------------------------------------------------

_OTHERS = ((VERMILION, 'o'), (ORANGE, 's'), (PURPLE, 'D'), (BLUE, '^'), (SKY, 'v'))
_LAW: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'ls': '--', 'zorder': 3}


def figures(outcomes: list[Outcome], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name: a panel for each case; green is ours, black the law.

    A method fails above the grey line, and by the law beyond the dotted one of its colour.
    """
    cases = CREEPS, THRESHOLD, STANDS, BOUNCES, SERIES, FILMS
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.5, 7.4), layout='constrained')
        for letter, panel, case in zip('abcdef', figure.subplots(2, 3).flat, cases, strict=True):
            _draw(panel, case, [outcome for outcome in outcomes if outcome.case == case.name])
            panel.set(xscale='log', yscale='log', title=f'{letter}  {case.name}')
            span = 0.7 * case.low, 1.4 * case.high
            panel.set(xlabel=case.input, ylabel=case.measure, ylim=span)
            panel.axhline(case.worst, color=PALE, lw=0.9, ls='--', zorder=1)
            panel.legend(fontsize=7.5)
    return {'stability': figure}


def _draw(panel: Axes, case: Case, outcomes: Sequence[Outcome]) -> None:
    others, ours = iter(_OTHERS), iter(((GREEN, '.'), (GREEN, 'x')))
    for (_, name), part in _methods(outcomes).items():
        colour, marker = next(ours if part[0].ours else others)
        x = [row.at for row in part]
        y = np.clip(
            [np.inf if row.value is None else row.value for row in part], case.low, case.high
        )
        panel.plot(x, y, marker, color=colour, ms=4.0, ls='-', lw=0.9, label=name)
        panel.plot(x, [row.law or np.nan for row in part], **_LAW)
        if part[0].limit:
            panel.axvline(part[0].limit, color=colour, lw=1.1, ls=':', zorder=1)

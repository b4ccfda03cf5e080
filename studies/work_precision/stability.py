# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with other methods and with ours.

In each case other methods and those of ros_pad get the same inputs. A number measures the failure,
and a law predicts at which inputs and by how much a method must fail.
"""

from __future__ import annotations

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
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ros_pad.contact import laws
from ros_pad.contact.film import WATER_VISCOSITY, Film, film_thickness
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.pace import Progress
from ros_pad.records import Array
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.soles import LOSS, Sole, Soles
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, SKY, VERMILION

# Methods that are in several cases.
L2, RK4, LSODA, EXACT = 'L2', 'RK4', 'LSODA, defaults', 'LSODA, 1e-9'
DIRECT, LOOSE = 'direct solref', 'and default solimp'

# The hexapod of the shipped scenes.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
_CARRIED = _SCENE.expected_load / GRAVITY  # kg
_DOMES = laws.spring(_SCENE.foot, 0.0, 75e3)[1]  # N/m
_LOSS = LOSS * math.sqrt(_DOMES / _CARRIED) / GRAVITY  # of the damper over the force, s/m
_FOOT = """
<mujoco>
  <option timestep="{dt!r}" gravity="0 0 -{gravity!r}" tolerance="1e-12" {option}/>
  <worldbody> {floor}
    <body pos="0 0 1e-4"> <joint type="slide" axis="0 0 1"/> {joints}
      <geom name="foot_1" size="1e-4" mass="{mass!r}" contype="0"/> </body>
  </worldbody>
  <contact>
    <pair name="foot_1" geom1="floor" geom2="foot_1" condim="{condim}" friction="0.8 0.8"/>
  </contact>
</mujoco>
"""
_FLOOR = '<geom name="floor" type="plane" size="9 9 1" contype="0"/>'
_TOUCH = 0.8  # its coefficient of friction


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
    for number, case in enumerate((creep, feet, in_series, films)):
        progress(number / 4)
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


def modelled(dt: float, gravity: float, mass: float = _CARRIED, **parts: str) -> tuple[Any, Any]:
    """Return model and data in MuJoCo of a foot on a floor."""
    import mujoco

    given = {'floor': _FLOOR, 'joints': '', 'option': '', 'condim': '1'} | parts
    text = _FOOT.format(dt=dt, gravity=gravity, mass=mass, **given)
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def springing(model: Any, dt: float, pressure: float, loss: float) -> Callable[[float], None]:
    """Return what makes the contact of a foot at a depth, m, the spring that it has on L2."""
    sole: Any = Sole(Film(_SCENE.foot), 1, model, None)
    soles: Any = SimpleNamespace(foot=_SCENE.foot, _dt=dt, _loss=loss)
    sole.pressure = pressure
    return partial(Soles._give_way, soles, sole)


# --- a: creep ------------------------------------------------------------------------------------

PUSH = 0.8  # force over the friction limit
CREEP_STEPS = (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)
CREEPS = Case('creep', 'step, s', 'creep at 0.8 of the limit, m/s', 1e-4, 1e-18, 1.0)
_TIME = 0.95 * 0.02  # s: of the default softness
SOFT = 3000  # impratio of L2
# Settings of MuJoCo by name, with the impratio if the law of creep holds.
SETTINGS: dict[str, tuple[str, int | None]] = {
    "MuJoCo's defaults": ('', None),
    'elliptic cone': ('cone="elliptic"', 1),
    'elliptic, impratio 100': ('cone="elliptic" impratio="100"', 100),
    'elliptic, impratio 3000': ('cone="elliptic" impratio="3000"', SOFT),
    'elliptic, noslip': ('cone="elliptic" impratio="10" noslip_iterations="5"', None),
}
_ALONG = '<joint type="slide" axis="1 0 0"/> <joint type="slide" axis="0 1 0"/>'


def creep_law(ratio: float) -> float:
    """Return the creep of a foot with MuJoCo's default softness, elliptic cone, m/s.

    Without acceleration, the creep v of a contact with force f follows from R f - b v = 0, with b
    = 2/(0.95 0.02 s) and R = (1/d - 1)/(m impratio), which do not depend on the step. The
    impedance d is taken at the depth at which the contact carries the weight, (1/d - 1) g = k d
    depth, k = 1/(0.95 0.02 s)².
    """
    d = _impedance(_depth(GRAVITY))
    return (1.0 / d - 1.0) * PUSH * _TOUCH * GRAVITY * _TIME / 2.0 / ratio


def creep_law_of_l2(dt: float) -> float:
    """Return the creep of a foot on L2, m/s.

    With the spring K and the damper c of the pads its contact has R = 1/((K h²/2 + c h) impratio)
    and b = 1/h.
    """
    force = _CARRIED * GRAVITY
    return PUSH * _TOUCH * force / ((0.5 * _DOMES * dt + _LOSS * force) * SOFT)


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


def mujoco_creep(dt: float, option: str, soft: bool = False) -> float:
    """Return the creep of a foot in MuJoCo that is pushed below its friction limit, m/s.

    ``soft``: with the spring of its pads as its contact, as on L2.
    """
    import mujoco

    model, data = modelled(dt, GRAVITY, option=option, joints=_ALONG, condim='3')
    give_way = springing(model, dt, 75e3, _LOSS) if soft else None
    places = []
    for push in (0.0, PUSH, PUSH):
        data.qfrc_applied[1] = push * _TOUCH * _CARRIED * GRAVITY
        for _ in range(round(0.5 / dt)):
            if give_way:
                give_way(max(0.0, -float(data.qpos[0])))
            mujoco.mj_step(model, data)
        places.append(float(data.qpos[1]))
    return abs(places[2] - places[1]) / 0.5


def creep() -> list[Outcome]:
    """Push a foot with 0.8 of its friction limit, in MuJoCo and on L2."""
    l2 = partial(mujoco_creep, option=SETTINGS['elliptic, impratio 3000'][0], soft=True)
    outcomes = CREEPS.of(L2, True, CREEP_STEPS, l2, creep_law_of_l2)
    for name, (option, ratio) in SETTINGS.items():
        law = creep_law(ratio) if ratio else None
        creeps = partial(mujoco_creep, option=option)
        outcomes += CREEPS.of(name, False, CREEP_STEPS, creeps, law)
    return outcomes


# --- b, c, d: the spring and the damper of a foot ------------------------------------------------

STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2)
LANDS = Case('landing at 0.1 m/s', 'step, s', 'peak load off, share', 0.1, 1e-8, 3.0)
STANDS = Case('standing', 'step, s', 'load off the weight, share', 0.01, 1e-16, 10.0)
BOUNCES = Case(
    'bounce without damper', 'step, s', 'speed off by a bounce, share', 0.1, 1e-10, 30.0
)
# Of height, m, and speed, m/s, to those after a step, and the load, N.
Advance = Callable[[float, float], tuple[float, float, float]]


def acted(height: float, speed: float, pressure: float, loss: float) -> float:
    """Return the load of a foot, N."""
    force, _ = laws.spring(_SCENE.foot, max(0.0, -height), pressure)
    return max(0.0, force * (1.0 - loss * speed))


def by_ivp(
    dt: float, pressure: float, loss: float, gravity: float, method: str = 'LSODA', **given: float
) -> Advance:
    """Return a step of a foot by a solver of SciPy, or by one step of classical Runge-Kutta."""

    def rate(_: float, at: Any) -> Array:
        load = acted(at[0], at[1], pressure, loss)
        return np.array((float(at[1]), load / _CARRIED - gravity))

    def advance(height: float, speed: float) -> tuple[float, float, float]:
        start = np.array((height, speed))
        if method == RK4:
            slope = total = rate(0.0, start)
            for part, weight in ((0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
                slope = rate(0.0, start + part * dt * slope)
                total = total + weight * slope
            end = start + dt / 6.0 * total
        else:
            end = solve_ivp(rate, (0.0, dt), start, method, **given).y[:, -1]
        height, speed = end.tolist()
        return height, speed, acted(height, speed, pressure, loss)

    return advance


def by_mujoco(dt: float, pressure: float, loss: float, gravity: float, way: str = L2) -> Advance:
    """Return a step of a foot in MuJoCo: as on L2, or with a direct solref."""
    import mujoco

    model, data = modelled(dt, gravity)
    give_way, pair = springing(model, dt, pressure, loss), model.pair('foot_1')
    if way == DIRECT:
        # An impedance d would take its share of the load from the spring.
        pair.solimp[:2] = 1e-4

    def advance(height: float, speed: float) -> tuple[float, float, float]:
        data.qpos[0], data.qvel[0], depth = height, speed, max(0.0, -height)
        force, stiffness = laws.spring(_SCENE.foot, depth, pressure)
        if way == L2:
            give_way(depth)
        else:
            spring = force / depth if depth > 0.0 else stiffness
            pair.solref[:] = -spring / _CARRIED, -loss * force / _CARRIED
        mujoco.mj_step(model, data)
        load = _CARRIED * (float(data.qacc[0]) + gravity)
        return float(data.qpos[0]), float(data.qvel[0]), load

    return advance


METHODS: dict[str, Callable[..., Advance]] = {
    L2: by_mujoco,
    DIRECT: partial(by_mujoco, way=DIRECT),
    RK4: partial(by_ivp, method=RK4),
    LSODA: by_ivp,
    EXACT: partial(by_ivp, rtol=1e-9, atol=1e-12),
}


def _landed(method: Callable[..., Advance], dt: float, peak: float) -> float:
    """Return by how much the peak load of a foot that lands on its domes is off."""
    advance, height, speed, most = method(dt, 75e3, _LOSS, GRAVITY), 0.0, -0.1, 0.0
    for _ in range(round(0.02 / dt)):
        height, speed, load = advance(height, speed)
        most = max(most, load)
    return abs(most / peak - 1.0)


def _stood(method: Callable[..., Advance], dt: float) -> float:
    """Return by how much of its weight the load of a flat foot is off, 1 s after 1 %."""
    advance = method(dt, 0.0, _LOSS, GRAVITY)
    height, speed, loads = -0.99 * _CARRIED * GRAVITY / _SCENE.foot.sole_stiffness, 0.0, []
    for _ in range(round(1.0 / dt)):
        height, speed, load = advance(height, speed)
        loads.append(load)
        if abs(height) > 0.01:
            return math.inf
    late = np.array(loads[-round(0.1 / dt) :])
    return float(np.abs(late / (_CARRIED * GRAVITY) - 1.0).max())


def bounce_law(dt: float) -> float | None:
    """Return the share of the speed that a foot without damper loses in a bounce on L2.

    In half an oscillation a step that is implicit by half loses the factor exp(-π ω h/4), to
    first order.
    """
    first = 0.25 * math.pi * math.sqrt(_DOMES / _CARRIED) * dt
    return -math.expm1(-first) if first < 0.25 else None


def _bounced(method: Callable[..., Advance], dt: float) -> float:
    """Return the share of its speed that a foot without damper gains or loses in a bounce."""
    advance, height, speed = method(dt, 75e3, 0.0, 0.0), 0.0, -0.1
    while height < 0.0 or speed < 0.0:
        height, speed, _ = advance(height, speed)
    return abs(speed / 0.1 - 1.0)


def feet() -> list[Outcome]:
    """Let a foot land, stand on its flat sole, and bounce without damper and gravity.

    With a direct solref MuJoCo is semi-implicit Euler: to stand it needs h² K + 2 h c < 4 m.
    """
    stiffness, damper = _SCENE.foot.sole_stiffness, _LOSS * _SCENE.expected_load
    root = math.sqrt(damper**2 + 4.0 * stiffness * _CARRIED)
    peak, outcomes = 1.0 + _landed(METHODS[EXACT], 5e-5, 1.0), []
    for name, method in METHODS.items():
        ours = name == L2
        limit = (root - damper) / stiffness if name == DIRECT else None
        outcomes += LANDS.of(name, ours, STEPS[:-2], partial(_landed, method, peak=peak))
        outcomes += STANDS.of(name, ours, STEPS, partial(_stood, method), limit=limit)
        law = bounce_law if ours else None
        outcomes += BOUNCES.of(name, ours, STEPS, partial(_bounced, method), law)
    return outcomes


# --- e: a light block on a spring ----------------------------------------------------------------

BLOCKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)  # kg
SERIES = Case(
    'spring below the contact', 'mass of the block, kg', 'depth off, factor', 2.0, 1.0, 100.0
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
    model, data = modelled(2e-4, GRAVITY, mass, floor=floor)
    mujoco.mj_step(model, data, 20_000)
    return -float(data.qpos[1]) * stiffness / scene.expected_load


def sunk_alone(way: str, _: float = math.nan) -> float:
    """Return by which factor the depth is off where the pads' spring is the contact itself."""
    advance, height, speed = by_mujoco(1e-3, 75e3, _LOSS, GRAVITY, way), 0.0, 0.0
    for _ in range(4000):
        height, speed, _ = advance(height, speed)
    share = -height * _DOMES / _SCENE.expected_load
    return max(share, 1.0 / share)


def in_series() -> list[Outcome]:
    """Let feet stand on blocks with the pads' spring below, and on contacts that are this spring.

    With MuJoCo's default impedance d a direct solref takes only 1 - d of the load.
    """
    outcomes = []
    for way in (L2, DIRECT, LOOSE):
        outcomes += SERIES.of(way, way == L2, BLOCKS, partial(sunk_alone, way))
    for robot, scene in (('hexapod', _SCENE), ('quadruped', Scene.load('quadruped_patches'))):
        law = partial(sunk_law, scene)
        limit = brentq(lambda mass: math.log(law(mass) / SERIES.worst), 1e-3, 1e3)  # noqa: B023
        sinks = partial(sunk, scene)
        outcomes += SERIES.of(f'{robot} on a block', False, BLOCKS, sinks, law, limit)
    return outcomes


# --- f: the film under a foot --------------------------------------------------------------------

THICK, COMES = 0.3e-3, 0.02  # m; s, in which the load comes evenly
FILMS = Case('film while its load comes', 'step, s', 'film off, share', 0.1, 1e-17, 1.0)
_SOLE = _SCENE.expected_load / _SCENE.foot.sole_area, _SCENE.foot.sole_radius  # Pa and m
FILM_RATE = 4.0 * _SOLE[0] / (3.0 * WATER_VISCOSITY * _SOLE[1] ** 2)  # 1/(m² s), of 1/h²


def film_law(dt: float) -> float:
    """Return the relative error of a film whose load in each step is that at the end of it."""
    drained = 0.5 * FILM_RATE * COMES * THICK**2
    return 1.0 - math.sqrt((1.0 + drained) / (1.0 + drained * (1.0 + dt / COMES)))


def thinned(dt: float, at: float | None, **given: float) -> float:
    """Return the relative error of the film under a flat sole, by Film or by LSODA.

    ``at``: place within each step of the load that Film gets; None for LSODA.
    """
    film, thickness = Film(_SCENE.foot), THICK
    film.touch_down(THICK)
    for step in range(round(COMES / dt)):
        if at is not None:
            load = _SCENE.expected_load * (step + at) * dt / COMES
            _, thickness = film.drain(0.0, load, 0.0, dt)
        else:
            span = step * dt, (step + 1) * dt
            found = solve_ivp(_thins, span, (thickness,), 'LSODA', **given)
            thickness = float(found.y[0, -1])
    return abs(thickness / float(film_thickness(THICK, *_SOLE, 0.5 * COMES)) - 1.0)


def _thins(time: float, thickness: Any) -> Any:
    return -0.5 * FILM_RATE * time / COMES * thickness**3


def films() -> list[Outcome]:
    """Drain the film under a flat sole while its load comes evenly.

    On L2 the load of a step is its mean, by Newton's law; L1 has that at one end of the step.
    """
    return [
        *FILMS.of('L1, load at the end', True, STEPS, partial(thinned, at=1.0), film_law),
        *FILMS.of('L2, mean load', True, STEPS, partial(thinned, at=0.5)),
        *FILMS.of(LSODA, False, STEPS, partial(thinned, at=None)),
        *FILMS.of(EXACT, False, STEPS, partial(thinned, at=None, rtol=1e-9, atol=1e-15)),
    ]


# --- picture -------------------------------------------------------------------------------------

_OTHERS = ((SKY, 'v'), (PURPLE, 'D'), (ORANGE, 's'), (BLUE, '^'), (VERMILION, 'o'))
# Of methods that are in several panels, ours by level.
_LOOKS = {
    'L1': (GREEN, 'x'),
    'L2': (GREEN, 'P'),
    DIRECT: _OTHERS[4],
    RK4: _OTHERS[2],
    LSODA: _OTHERS[1],
    EXACT: _OTHERS[3],
}
_LAW: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'ls': '--', 'zorder': 4}


def figures(outcomes: list[Outcome], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name: a panel for each case; green is ours, black the law."""
    cases = CREEPS, LANDS, STANDS, BOUNCES, SERIES, FILMS
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.5, 8.6), layout='constrained')
        for letter, panel, case in zip('abcdef', figure.subplots(2, 3).flat, cases, strict=True):
            _draw(panel, case, [outcome for outcome in outcomes if outcome.case == case.name])
            panel.set(xscale='log', yscale='log', title=f'{letter}  {case.name}')
            edge = (case.high / case.low) ** 0.05
            span = case.low / edge, case.high * edge
            panel.set(xlabel=case.input, ylabel=case.measure, ylim=span)
            panel.axhline(case.worst, color=PALE, lw=0.9, ls='--', zorder=1)
            panel.legend(
                loc='upper center', bbox_to_anchor=(0.45, -0.15), ncols=2, columnspacing=1.0
            )
        figure.supxlabel(
            'Green: ros_pad; black: a law. Above the grey line a method fails, by law beyond the'
            ' dotted one.\nHighest marks of c: over 10 mm off. Lowest of c and f: no error.',
            fontsize=9.0,
        )
    return {'stability': figure}


def _draw(panel: Axes, case: Case, outcomes: Sequence[Outcome]) -> None:
    others = iter(_OTHERS)
    for (_, name), part in _methods(outcomes).items():
        colour, marker = _LOOKS.get(name[:2] if part[0].ours else name) or next(others)
        x = [row.at for row in part]
        y = np.clip(
            [np.inf if row.value is None else row.value for row in part], case.low, case.high
        )
        look: dict[str, Any] = {'color': colour, 'lw': 0.9, 'zorder': 2.5 + part[0].ours}
        panel.plot(x, y, f'{marker}-', ms=5.0, label=name, **look)
        panel.plot(x, [row.law or np.nan for row in part], **_LAW)
        if part[0].limit:
            panel.axvline(part[0].limit, color=colour, lw=1.1, ls=':', zorder=1)

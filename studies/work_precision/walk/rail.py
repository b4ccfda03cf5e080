# SPDX-License-Identifier: Apache-2.0
"""Walks of the rail leg, and all methods of simulating them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from ros_pad.contact import laws
from ros_pad.contact.film import Film, landed
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import RailBody, RailGait, Scene
from studies.work_precision.walk.unlanded import unlanded
from studies.work_precision.walk.walkers import CYCLES, RAIL, Walk, Walked, Walker, named, walked

LEG, FILM_STEP = 'RailLeg, 4 ms', 5e-5  # s
EVENTS = 'solve_ivp, events, 1e-11'


def rail_walks() -> list[Walk]:
    """Return walks of the thesis on a rail, and one whose friction hardly exceeds the drag."""
    scenes = {
        name: Scene.load(f'leg_{name.replace(" ", "_")}')
        for name in ('dry flat', 'wet flat', 'wet dome 60', 'wet dome 75')
    }
    body = scenes['dry flat'].body
    assert isinstance(body, RailBody)
    slippery = replace(
        scenes['dry flat'].foot, friction=1.06 * body.rolling_drag / body.load, shear_strength=0.0
    )
    scenes['threshold'] = replace(scenes['dry flat'], foot=slippery)
    return [
        Walk(name, replace(scene, settle=0.0, cycles=CYCLES[RAIL]), scene.dome_pressure or 0.0)
        for name, scene in scenes.items()
    ]


def rail_walkers() -> list[Walker]:
    """Return all walkers of the rail leg."""
    walkers = [*(_rail(step) for step in (1e-4, 1e-3, 4e-3)), unlanded(_rail(4e-3))]
    for family, method, tolerance in (
        (EVENTS, 'DOP853', 1e-11),
        ('solve_ivp, events, 1e-6', 'RK45', 1e-6),
    ):
        walkers.append(Walker(family, family, None, _by_events(method, tolerance), ours=False))
    return walkers


def leg_of(case: Walk, step: float) -> RailLeg:
    """Return the rail leg without films that slip drags in: the integrators do not have them."""
    leg = RailLeg(case.scene, case.scene.floor.build(case.seed), step)
    drain = leg.film.drain
    leg.film.drain = lambda *given: drain(*given[:4])  # type: ignore[method-assign]
    return leg


def _rail(step: float) -> Walker:
    def walk(case: Walk) -> Walked:
        leg = leg_of(case, step)
        pressures, count = [case.pressure], round(case.scene.duration / step)
        start = time.perf_counter()
        for _ in range(count):
            leg.step(pressures)
        return walked(leg, case.scene, count, time.perf_counter() - start)

    return Walker('RailLeg', named('RailLeg', step), step, walk)


def cap_in_stance(case: Walk) -> Callable[[float], float]:
    """Return the capacity of a foot at a fixed pressure, N, as a function of time in stance, s."""
    scene = case.scene
    assert isinstance(scene.body, RailBody)
    foot = scene.foot.on_rough(scene.floor.roughness)
    domes = foot.dome_load(scene.body.load, case.pressure)
    sole = scene.body.load - domes
    if scene.floor.kind == 'dry':
        dry = laws.resistance(foot, domes, sole, case.pressure, 0.0, 0.0)
        return lambda _: dry
    film = Film(foot, scene.floor.viscosity)
    film.touch_down(scene.floor.film_thickness)
    half, caps = 0.5 * scene.gait.stance, []
    times = np.arange(0.0, scene.gait.stance + FILM_STEP, FILM_STEP)
    for since in times.tolist():
        share = landed(since, half)
        films = film.drain(share * domes, share * sole, case.pressure, FILM_STEP)
        caps.append(laws.resistance(foot, domes, sole, case.pressure, *films))
    table = PchipInterpolator(times, caps)

    def cap(since: float) -> float:
        return float(table(since))

    return cap


def _by_events(method: str, tolerance: float) -> Callable[[Walk], Walked]:
    def walk(case: Walk) -> Walked:
        scene = case.scene
        start = time.perf_counter()
        distance, slip, steps = walk_by_events(case, method, tolerance)
        taken = time.perf_counter() - start
        return Walked(distance / scene.cycles, slip / scene.cycles, 0.0, 0.0, None, steps, taken)

    return walk


class _Stance:
    """A foot in stance on the rail: its phases, and the transitions between them.

    The body is slower than the backward motion of the foot (``slower``), as fast (``holds``), or
    faster (``faster``); or it rests, because the friction of the foot is below the drag
    (``rests``).
    """

    def __init__(self, case: Walk) -> None:
        body, gait = case.scene.body, case.scene.gait
        assert isinstance(body, RailBody) and isinstance(gait, RailGait)
        self.body, self.gait, self.cap = body, gait, cap_in_stance(case)
        self.rate = math.pi / gait.stance
        self._peak = 0.5 * self.rate * gait.stroke  # m/s
        drag, cap, needed = body.rolling_drag, self.cap, self._needed
        # Events that end each phase: functions of time and speed of the body, positive before it.
        meets, rests = (lambda t, v: self._back(t) - v), (lambda t, v: drag - cap(t))
        self._ends: dict[str, dict[str, Callable[[float, float], float]]] = {
            'slower': {'meets': meets, 'stops': lambda t, v: v},
            'faster': {'meets': lambda t, v: -meets(t, v)},
            'holds': {'slips': lambda t, v: cap(t) - abs(needed(t))},
            'rests': {'starts': rests},
        }
        self._pushes: dict[str, Callable[[float], float]] = {  # on the body, N, by time
            'slower': lambda t: cap(t) - drag,
            'faster': lambda t: -cap(t) - drag,
            'holds': lambda t: needed(t) - drag,
            'rests': lambda t: 0.0,
        }

    def _back(self, since: float) -> float:
        """Return the speed at which the foot goes back, m/s."""
        return self._peak * math.sin(self.rate * since)

    def _needed(self, since: float) -> float:
        """Return the force that keeps foot and body together, N."""
        inertial = self.body.mass * self._peak * self.rate * math.cos(self.rate * since)
        return inertial + self.body.rolling_drag

    def first(self, speed: float) -> str:
        """Return the phase at touch-down."""
        if speed != 0.0:
            return 'faster'
        if self.cap(0.0) >= self._needed(0.0):
            return 'holds'
        return 'slower' if self.cap(0.0) > self.body.rolling_drag else 'rests'

    def run(
        self, phase: str, since: float, speed: float, method: str, tolerance: float
    ) -> tuple[str | None, float, float, float, int]:
        """Return the event that ended a phase, its time, distance and speed, and number of steps.

        The event is None if the stance ended first.
        """
        events = []
        for end in self._ends[phase].values():

            def event(t: float, state: Any, end: Any = end) -> float:
                return float(end(t, float(state[1])))

            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
            events.append(event)
        found = solve_ivp(
            lambda t, state: (state[1], self._pushes[phase](t) / self.body.mass),
            (since, self.gait.stance),
            (0.0, speed),
            method=method,
            events=events,
            rtol=max(tolerance, 3e-14),
            atol=1e-3 * tolerance,
        )
        ended = [
            name for name, hits in zip(self._ends[phase], found.t_events, strict=True) if len(hits)
        ]
        distance, speed = found.y[:, -1].tolist()
        first = ended[0] if ended else None
        return first, float(found.t[-1]), distance, speed, len(found.t) - 1

    def next(self, phase: str, end: str | None, since: float, speed: float) -> tuple[str, float]:
        """Return the phase after an event, and the speed of the body at its start."""
        if end == 'slips':
            return ('slower' if self._needed(since) > 0.0 else 'faster'), speed
        if end == 'stops':
            return 'rests', 0.0
        if end == 'starts':
            return 'slower', speed
        if end == 'meets':  # foot and body stay together if the foot can hold this force
            held = abs(self._needed(since)) <= self.cap(since)
            other = 'faster' if phase == 'slower' else 'slower'
            return ('holds' if held else other), self._back(since)
        return phase, speed


def walk_by_events(case: Walk, method: str, tolerance: float) -> tuple[float, float, int]:
    """Walk from phase to phase of each stance, and coast through each swing.

    Returns
    -------
    tuple
        Distance of the body and slip path of the foot, m, and steps of the integrator.
    """
    stance = _Stance(case)
    mass, drag, gait = stance.body.mass, stance.body.rolling_drag, stance.gait
    distance = slip = speed = 0.0
    steps = 0
    for _ in range(case.scene.cycles):
        since, phase = 0.0, stance.first(speed)
        while since < gait.stance:
            begun = since
            end, since, gained, speed, count = stance.run(phase, since, speed, method, tolerance)
            steps += count
            turned = math.cos(stance.rate * begun) - math.cos(stance.rate * since)
            distance += gained
            slip += 0.0 if phase == 'holds' else abs(gained - 0.5 * gait.stroke * turned)
            phase, speed = stance.next(phase, end, since, speed)
        coasting = min(gait.swing, mass * speed / drag) if drag else gait.swing
        distance += speed * coasting - 0.5 * drag / mass * coasting**2
        speed = speed - drag / mass * coasting if coasting == gait.swing else 0.0
    return distance, slip, steps

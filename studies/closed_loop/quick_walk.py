# SPDX-License-Identifier: Apache-2.0
"""A walk of a tripod hexapod without dynamics, in which policies are tuned.

It takes a twentieth of the time of L2. The controller is the shipped one. Feet that carry the body
slip as one body, and the share of the stride that a step loses is a function of their mean
friction and of what is towed, drawn through the losses of fixed morphologies in L2 on
`hexapod_patches`. An estimate of wet ground is right a random time after a flat foot carries load,
as in L2.
"""

from __future__ import annotations

import math

import numpy as np

from ros_pad.contact.resistance import expected_friction
from ros_pad.control import MorphologyController, first_morphologies
from ros_pad.control.policies import Policy
from ros_pad.simulation import Scene
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.scene import LeggedBody

PERIOD = 0.02  # s
KNOWN = 0.15  # s: the ground under a loaded flat foot is known by then
FADING = 1.5  # m over which an estimate fades under domes
FILL = 0.05  # s: time constant of a pad's pressure


HEAVY = ((0.12, 0.30, 0.35, 0.38, 0.41, 0.50, 0.80), (0.5, 0.48, 0.38, 0.215, 0.15, 0.10, 0.045))
LIGHT = ((0.12, 0.32), (0.21, 0.0))
"""Mean friction of the feet that carry, and the share of a stride that a step loses, where 4.5 N
and where 1.1 N are towed."""


def _lost(friction: float, tow: float) -> float:
    """Return the share of a stride that a step loses at a mean friction and a towed force, N."""
    light, heavy = float(np.interp(friction, *LIGHT)), float(np.interp(friction, *HEAVY))
    return min(0.5, max(0.0, light + (tow - 1.1) / 3.4 * (heavy - light)))


def walk(scene: Scene, policy: Policy, start: str, seed: int) -> float:
    """Return the distance a cycle, m."""
    gait, floor = scene.gait, scene.floor.build(seed)
    assert isinstance(gait, WalkingGait) and isinstance(scene.body, LeggedBody)
    random = np.random.default_rng([seed, 7])
    load, tow = scene.expected_load, scene.tow
    flat_dry, flat_wet, dome_dry = expected_friction(scene.foot, load)
    controller = MorphologyController(
        scene.foot, scene.legs, policy, load,
        start=first_morphologies(start, scene.legs), fixed_pressure=scene.dome_pressure,
    )  # fmt: skip
    homes = dict(zip(scene.legs, scene.body.homes, strict=True))
    body, half = 0.0, gait.duty / 2.0
    pressure = {leg: controller.setpoint(leg) for leg in scene.legs}
    wet = dict.fromkeys(scene.legs, 0.5)
    known = dict.fromkeys(scene.legs, math.inf)
    place = dict(homes)
    for step in range(round(scene.cycles * gait.cycle / PERIOD)):
        time = step * PERIOD
        grips, under = [], []
        for index, leg in enumerate(scene.legs):
            # Phase 0 to 0.5: the leg carries.
            phase = (time / gait.cycle + 0.5 * (index % 2)) % 1.0
            since = (phase + half - 0.25) % 1.0  # since it has landed
            standing = since < gait.duty
            carries = phase < 0.5
            if standing:
                x = body + homes[leg][0] + gait.stride * (half - since)
                moved = abs(x - place[leg][0])
                place[leg] = (x, homes[leg][1])
                flat = pressure[leg] < 1e3
                is_wet = floor.wet(*place[leg])
                loaded = 2.0 * half - 0.5 <= since
                if not loaded or not flat:
                    wet[leg] = 0.5 + (wet[leg] - 0.5) * math.exp(-moved / FADING)
                    known[leg] = time + KNOWN * random.random()
                elif time >= known[leg]:
                    wet[leg] = 0.99 if is_wet else 0.01
                if carries:
                    dome = scene.foot.friction if is_wet else dome_dry
                    grips.append(dome if not flat else flat_wet if is_wet else flat_dry)
                    under.append(is_wet)
                force = load * (1.0 if loaded else 0.5)
            else:
                force = 0.0
            controller.observe(leg, time, pressure[leg])
            aim = controller.update(leg, force, wet[leg], place[leg])
            pressure[leg] += (aim - pressure[leg]) * -math.expm1(-PERIOD / FILL)
            if pressure[leg] < 100.0:
                pressure[leg] = 0.0
        sled = floor.wet(body - tow.distance, 0.0)
        pull = tow.weight * (tow.friction_wet if sled else tow.friction_dry)
        lost = _lost(sum(grips) / len(grips), pull)
        body += gait.stride * (1.0 - 2.0 * lost) * PERIOD / gait.cycle
    return body / scene.cycles

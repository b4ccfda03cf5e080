# SPDX-License-Identifier: Apache-2.0
"""What of a scene decides how far levels of fidelity part: its grip margin, and other features.

Well above a grip margin of one feet stick and all levels agree; near one they slip on some levels
and not on others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from ros_pad.contact import inflate, pressure_for, trapped_film
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.squeeze import DIMPLE, TRAPPED, dome_dimple
from ros_pad.errors import NoEquilibrium
from ros_pad.simulation.scene import LeggedBody, RailGait, Scene

SOLE_MODULUS = 3.95e5
"""Reduced modulus of a sole whose foot names no material, Pa: of Dragon Skin 10, four times its
shear modulus, 2 C1 of ``config/materials``, times 1.88 by which that is too soft for the domes."""

NEAR = 1.5
"""Grip margin below which feet may slip: bounds may step there."""

_MARGIN = 1.2  # the default of a controller, which may not be imported here


def features(scene: Scene, policy: str | None = None) -> dict[str, float]:
    """Return the numbers of a scene from which errors are predicted, by name.

    Parameters
    ----------
    scene : Scene
        Scene to be walked.
    policy : str or None
        Policy of the feet; None takes the scene's own.
    """
    policy = scene.policy if policy is None else policy
    grip, (gait, load, slope) = least_grip(scene, policy), demands(scene)
    demand = gait + load + slope
    margin = math.log(max(grip / demand, 1e-9))  # feet without friction have no grip at all
    wet = {'dry': 0.0, 'wet': 1.0}.get(scene.floor.kind, scene.floor.wet_fraction)
    found = {
        'margin': margin,
        'near': float(margin < math.log(NEAR)),
        'ample': max(0.0, margin - math.log(2.0)),
        'scarce': max(0.0, -margin),
        'dragged': load / demand,
        'wet': wet,
        'domes': float(policy == 'dome' or (policy != 'flat' and wet > 0.0)),
    }
    if isinstance(scene.gait, RailGait):
        return found
    body = scene.body
    assert isinstance(body, LeggedBody)
    return found | {
        'climbed': slope / demand,
        'adapts': float(policy not in ('flat', 'dome') and 0.0 < wet < 1.0),
        'pace': math.log(scene.gait.peak_acceleration / GRAVITY),
        'duty': scene.gait.duty,
        'uneven': scene.floor.unevenness * body.leg_stiffness / scene.expected_load,
        'steered': scene.heading_gain,
    }


def reserve(scene: Scene, policy: str | None = None) -> float:
    """Return the grip margin: capacity over demand, on the ground with the least capacity.

    Parameters
    ----------
    scene : Scene
        Scene to be walked.
    policy : str or None
        ``flat``, ``dome``, or a policy that makes feet domes only on wet ground; None takes the
        scene's own.

    Returns
    -------
    float
        Grip margin, from 0. The capacity is that of a foot with its expected load in mid-stance,
        when its film has drained for half of the stance. The demand has three parts: the gait's
        peak acceleration of body and towed load, the drag of that load or of the wheels, and the
        slope. Feet and load may stand on different ground.
    """
    return least_grip(scene, policy or scene.policy) / sum(demands(scene))


def least_grip(scene: Scene, policy: str) -> float:
    """Return the tangential capacity of all feet, N, on the ground where it is least."""
    grip = min(
        mid_stance_grip(scene, policy == 'dome' or (policy != 'flat' and wet), wet)
        for wet in grounds(scene)
    )
    if not isinstance(scene.body, LeggedBody):
        return grip * scene.body.load
    return grip * scene.body.mass * GRAVITY * math.cos(scene.floor.slope)


def grounds(scene: Scene) -> tuple[bool, ...]:
    """Return which of dry and wet ground a floor has: whether it is wet."""
    return {'dry': (False,), 'wet': (True,)}.get(scene.floor.kind, (False, True))


def demands(scene: Scene) -> tuple[float, float, float]:
    """Return what gait, drag and slope need of the feet at most, N."""
    body, gait, slope, tow = scene.body, scene.gait, scene.floor.slope, scene.tow
    if isinstance(gait, RailGait) or not isinstance(body, LeggedBody):
        assert isinstance(gait, RailGait) and not isinstance(body, LeggedBody)
        peak = 0.5 * gait.stroke * (math.pi / gait.stance) ** 2
        uphill = body.mass * GRAVITY * abs(math.sin(slope))
        return body.mass * peak, body.rolling_drag, uphill
    mass = body.mass + tow.weight / GRAVITY
    drag = max(tow.friction_wet if wet else tow.friction_dry for wet in grounds(scene))
    drag *= tow.weight * math.cos(slope)
    return mass * gait.peak_acceleration, drag, mass * GRAVITY * abs(math.sin(slope))


def mid_stance_grip(scene: Scene, dome: bool, wet: bool) -> float:
    """Return the tangential resistance of a foot in mid-stance over its load."""
    stand = Stand(scene, dome)
    films = stand.films(0.5 * stance(scene)) if wet else (0.0, 0.0)
    return stand.resistance(*films) / scene.expected_load


def stance(scene: Scene) -> float:
    """Return how long a foot stands, s."""
    gait = scene.gait
    return gait.stance if isinstance(gait, RailGait) else gait.duty * gait.cycle


class Stand:
    """A foot of a scene under its expected load: how domes and flat sole share it."""

    def __init__(self, scene: Scene, dome: bool) -> None:
        self.foot, self.floor = scene.foot.on_rough(scene.floor.roughness), scene.floor
        self.pressure = dome_pressure(scene) if dome else 0.0
        self.on_domes = self.foot.dome_load(scene.expected_load, self.pressure)
        self.on_sole = scene.expected_load - self.on_domes

    def films(self, time: float) -> tuple[float, float]:
        """Return the films under domes and sole after a time, s, by Stefan and Reynolds, m."""
        film = Film(self.foot, self.floor.viscosity)
        film.touch_down(self.floor.film_thickness)
        return film.drain(self.on_domes, self.on_sole, self.pressure, time)

    def resistance(self, dome_film: float, sole_film: float) -> float:
        """Return the tangential resistance, N, on films under domes and sole, m."""
        return self.foot.resistance_of(
            self.on_domes, self.on_sole, self.pressure, dome_film, sole_film
        )

    @property
    def discs(self) -> tuple[int, float]:
        """Number and radius, m, of the discs that touch: the whole sole, or the domes."""
        if self.on_sole > 0.0:
            return 1, self.foot.sole_radius
        pads = self.foot.pads
        return pads, math.sqrt(self.on_domes / self.pressure / pads / math.pi)

    def dimples(self, time: float) -> Iterator[tuple[str, float, float, float]]:
        """Yield for domes and sole, if they carry load: name, and films after a time, s, in m.

        These are the rigid film, and with a soft surface the dimple in its middle and its mean.
        """
        foot, (dome_film, sole_film) = self.foot, self.films(time)
        if self.on_domes > 0.0:
            contact = math.sqrt(self.on_domes / self.pressure / foot.pads / math.pi)
            sphere = float(inflate(foot.pad, self.pressure).sphere_radius)
            middle = dome_dimple(contact, sphere, self.pressure, time, self.floor.viscosity)
            yield 'domes', dome_film, middle, 0.5 * middle
        if self.on_sole > 0.0:
            material = foot.pad.material
            modulus = 4.0 * material.shear_modulus if material else SOLE_MODULUS
            mean = trapped_film(foot.sole_radius, modulus, self.on_sole / foot.sole_area)
            mean = min(mean, self.floor.film_thickness)
            yield 'sole', sole_film, DIMPLE / TRAPPED * mean, mean


def dome_pressure(scene: Scene) -> float:
    """Return the pressure of a dome, Pa: the scene's, or what carries the expected load.

    The latter is a feature of the scene, not what a controller commands: that begins with a larger
    load, then takes the measured one, and leaves feet flat for which the ceiling does not suffice.
    Here they are domes at the ceiling, whose sole carries the rest.
    """
    if scene.dome_pressure:
        return scene.dome_pressure
    foot, load = scene.foot, scene.expected_load
    try:
        wanted = pressure_for(foot.pad, load / foot.pads, foot.limit, margin=_MARGIN)
    except NoEquilibrium:
        wanted = foot.ceiling
    return min(foot.ceiling, float(wanted))

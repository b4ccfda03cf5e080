# SPDX-License-Identifier: Apache-2.0
"""What of a scene decides how far levels of fidelity part: its grip margin, and other features.

Well above a grip margin of one feet stick and all levels agree; near one they slip on some levels
and not on others.
"""

from __future__ import annotations

import math

from ros_pad.contact import laws, pressure_for
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import NoEquilibrium
from ros_pad.simulation.scene import LeggedBody, RailBody, RailGait, Scene

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
    policy = policy or scene.policy
    (gait, load, slope), body = demands(scene), scene.body
    demand = gait + load + slope
    # Feet without friction have no grip at all.
    margin = math.log(max(least_grip(scene, policy) / demand, 1e-9))
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
    if isinstance(scene.gait, RailGait) or isinstance(body, RailBody):
        return found
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
    body, domes = scene.body, policy == 'dome'
    grip = min(
        mid_stance_grip(scene, domes or (policy != 'flat' and wet), wet) for wet in grounds(scene)
    )
    if isinstance(body, LeggedBody):
        return grip * body.mass * GRAVITY * math.cos(scene.floor.slope)
    return grip * body.load


def grounds(scene: Scene) -> tuple[bool, ...]:
    """Return which of dry and wet ground a floor has: whether it is wet."""
    return {'dry': (False,), 'wet': (True,)}.get(scene.floor.kind, (False, True))


def demands(scene: Scene) -> tuple[float, float, float]:
    """Return what gait, drag and slope need of the feet at most, N."""
    body, slope, tow = scene.body, scene.floor.slope, scene.tow
    mass = body.mass + tow.weight / GRAVITY
    drag = max(tow.friction_wet if wet else tow.friction_dry for wet in grounds(scene))
    drag *= tow.weight * math.cos(slope)
    if isinstance(body, RailBody):
        drag += body.rolling_drag
    return mass * scene.gait.peak_acceleration, drag, mass * GRAVITY * abs(math.sin(slope))


def mid_stance_grip(scene: Scene, dome: bool, wet: bool) -> float:
    """Return the tangential resistance of a foot in mid-stance over its load."""
    stand = Stand(scene, dome)
    films = stand.films(0.5 * scene.gait.stance) if wet else (0.0, 0.0)
    return stand.resistance(*films) / scene.expected_load


class Stand:
    """A foot of a scene under its expected load: how domes and flat sole share it."""

    def __init__(self, scene: Scene, dome: bool) -> None:
        self.foot, self.floor = scene.foot.on_rough(scene.floor.roughness), scene.floor
        self.pressure = dome_pressure(scene) if dome else 0.0
        self.on_domes = self.foot.dome_load(scene.expected_load, self.pressure)
        self.on_sole = scene.expected_load - self.on_domes

    def films(self, time: float) -> tuple[float, float]:
        """Return the films under domes and sole after a time in stance, s, in m."""
        film = Film(self.foot, self.floor.viscosity)
        film.touch_down(self.floor.film_thickness)
        return film.stand(self.on_domes, self.on_sole, self.pressure, time)

    def resistance(self, dome_film: float, sole_film: float) -> float:
        """Return the tangential resistance, N, on films under domes and sole, m."""
        return laws.resistance(
            self.foot, self.on_domes, self.on_sole, self.pressure, dome_film, sole_film
        )

    @property
    def discs(self) -> tuple[int, float]:
        """Number and radius, m, of the discs that touch: the whole sole, or the domes."""
        if self.on_sole > 0.0:
            return 1, self.foot.sole_radius
        pads = self.foot.pads
        return pads, math.sqrt(self.on_domes / self.pressure / pads / math.pi)


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

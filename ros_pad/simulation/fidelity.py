# SPDX-License-Identifier: Apache-2.0
"""Which rung of the simulation ladder a scene is run on, and what that leaves out."""

from __future__ import annotations

from dataclasses import dataclass

from ros_pad.contact import WATER
from ros_pad.errors import InvalidInput
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.robot import Robot
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

FIDELITIES = ('auto', 'L0', 'L1', 'L2')
_RUNGS = {'rail_leg': ('L0',), 'hexapod': ('L1', 'L2')}  # the cheapest first


@dataclass(frozen=True)
class Omission:
    """A physical term that a trial leaves out.

    Attributes
    ----------
    term : str
        What it is.
    bound : float or None
        How large it can be, relative to the friction of a loaded foot; None where nobody knows.
    reason : str
        Where the bound comes from.
    """

    term: str
    bound: float | None
    reason: str


def rung(scene: Scene, fidelity: str = 'auto') -> str:
    """Return the rung for a scene.

    Raises
    ------
    InvalidInput
        When the rung does not exist, or does not know the scene's robot.
    """
    if fidelity not in FIDELITIES:
        raise InvalidInput(f'fidelity = {fidelity!r}: one of {", ".join(FIDELITIES)} is needed')
    known = _RUNGS[scene.robot]
    if fidelity == 'auto':
        return known[0]
    if fidelity not in known:
        raise InvalidInput(
            f'fidelity = {fidelity!r}: scene {scene.name!r} has a {scene.robot},'
            f' which {" and ".join(known)} model{"s" if len(known) == 1 else ""}'
        )
    return fidelity


def build(scene: Scene, floor: Floor, period: float, fidelity: str = 'auto') -> Robot:
    """Return the robot of a scene on a floor, with a step of ``period`` seconds.

    Raises
    ------
    InvalidInput
        As :func:`rung`.
    ConfigError
        For L2 without MuJoCo, or with legs that cannot do what the scene wants of them.
    """
    name = rung(scene, fidelity)
    if name == 'L0':
        return RailLeg(scene, floor, period)
    if name == 'L1':
        return PlanarHexapod(scene, floor, period)
    return FullHexapod(scene, floor, period)


def omitted(scene: Scene) -> list[Omission]:
    """Return what a trial of this scene leaves out, with bounds on its effect."""
    foot, load = scene.foot, scene.expected_load
    # A meniscus resists sliding by hysteresis at most: γ w (cos θ_rec - cos θ_adv) <= 2 γ w, with
    # w = 2 r0 a pad; only domes have one.
    capillary = foot.pads * 2.0 * WATER.surface_tension * 2.0 * foot.pad.radius
    terms = [
        Omission(
            'capillary force of the pads',
            capillary / (foot.friction * load),
            'full contact-angle hysteresis (180 to 0 degrees) on every pad',
        ),
        Omission(
            'liquid dragged under a slipping foot', None, 'film taken to travel with the foot'
        ),
    ]
    if scene.robot == 'hexapod':
        terms += [
            Omission(
                'scuffing at touch-down and servo compliance',
                None,
                'only a model with joints (L2) has them: foot slip is underestimated',
            ),
            Omission(
                'inertia of swinging legs',
                None,
                'the body is one rigid mass',
            ),
        ]
    return terms

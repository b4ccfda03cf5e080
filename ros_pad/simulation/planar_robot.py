# SPDX-License-Identifier: Apache-2.0
"""L1: a legged robot that slides, turns and pushes in the plane.

The body has the three degrees of freedom of SE(2). The gait moves the feet under the body. Normal
loads follow from the balance of weight, pitch and roll. Bouncing, inertia of swinging legs, servo
compliance and scuffing at touch-down are left out. The level suits paths and Monte-Carlo runs, see
docs/model/planar_robot.md.

The step itself is :mod:`ros_pad.simulation.planar_step`, in plain Python or compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.configuration import instance, number
from ros_pad.contact import laws
from ros_pad.errors import NoConvergence
from ros_pad.records import Array
from ros_pad.simulation import compiled, planar_step
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.planar_model import model_of
from ros_pad.simulation.robot import FootState, Vector, check_pressures, check_reach
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

# Rows of the table that become attributes of FootState; the first seven are the contacts.
_SHOWN = (
    planar_step.FORCE_X, planar_step.FORCE_Y, planar_step.LOAD,
    planar_step.MOMENT,
    planar_step.MARKER_X, planar_step.MARKER_Y, planar_step.HEIGHT,
    planar_step.CAP, planar_step.WET,
    planar_step.SLIP_SPEED, planar_step.SLIP_PATH, planar_step.OVERLOAD,
)  # fmt: skip


class PlanarRobot:
    """A robot of three to eight legs on a floor with wet patches, towing a load.

    Parameters
    ----------
    scene : Scene
        A scene with a legged robot.
    floor : Floor
        The ground.
    period : float
        Length of a step, s, above 0.
    compile_steps : bool or None
        Whether numba compiles the steps. None compiles them if that saves time: when numba is
        installed and the trial of the scene is long, or when steps were compiled before. Plain and
        compiled steps give the same walk to the last bit.

    Attributes
    ----------
    model, state, table
        Constants, entries of the body and table of the feet, see
        :mod:`ros_pad.simulation.planar_step`. Lists, or arrays if steps are compiled.

    Raises
    ------
    ConfigError
        When the legs cannot walk the scene's gait, or when steps are to be compiled and numba is
        not installed.
    InvalidInput
        When the period is not finite and above 0, or the scene has a rail leg.

    Examples
    --------
    >>> from ros_pad.simulation import Floor, PlanarRobot, Scene
    >>> scene = Scene.load('hexapod_patches')
    >>> robot = PlanarRobot(scene, Floor.uniform(True, 0.3e-3), period=2e-3, compile_steps=False)
    >>> for _ in range(3000):
    ...     robot.step([75e3] * 6)
    >>> f'{robot.body[0]:.2f} m'
    '0.70 m'
    """

    joint_names: tuple[str, ...] = ()
    joint_positions: tuple[float, ...] = ()

    def __init__(
        self, scene: Scene, floor: Floor, period: float, compile_steps: bool | None = None
    ) -> None:
        instance('scene', scene, Scene)
        instance('floor', floor, Floor)
        number('period', period, 's', above=True)
        check_reach(scene)
        if compile_steps is None:
            compile_steps = compiled.worth_loading(planar_step, scene.duration / period)
        self.legs = scene.legs
        self.period = period
        self.time = 0.0
        self.dissipation = 0.0
        self.verdict: str | None = None
        self._feet = [FootState() for _ in self.legs]
        self.model = model_of(scene, floor, period)
        self.state: Any = [0.0] * planar_step.BODY
        self.table: Any = [[0.0] * len(self.legs) for _ in range(planar_step.FEET)]
        self._films: Any = [[0.0] * (laws.FILM + laws.CELLS) for _ in self.legs]
        self._plant(scene.legged[1])
        self._step: compiled.Step = planar_step.step
        if compile_steps:
            self._compile()
        self._report()

    def _plant(self, gait: WalkingGait) -> None:
        """Place the feet as if the gait had been running before time zero."""
        table = self.table
        for index, (phase, offset) in enumerate(gait.planted()):
            table[planar_step.PHASE][index] = phase
            table[planar_step.OFFSET_X][index] = table[planar_step.LIFTED_X][index] = offset
            if phase < gait.duty:
                planar_step.touch_down(self.model, self.state, table, self._films[index], index)

    def _compile(self) -> None:
        model = self.model
        self.state, self.table = np.array(self.state), np.array(self.table)
        self._films, foot, floor = np.array(self._films), model.foot, model.floor
        self.model = model._replace(
            foot=foot._replace(limits=np.array(foot.limits), spheres=np.array(foot.spheres)),
            floor=floor._replace(wet=np.array(floor.wet), heights=np.array(floor.heights)),
        )
        given = self.model, self.state, self.table, self._films, (0.0,) * len(self.legs)
        self._step = compiled.step(planar_step, *given)

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        x, y, heading = self.state[planar_step.X : planar_step.HEADING + 1]
        return float(x), float(y), float(heading)

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period``.

        Parameters
        ----------
        pressures : sequence of float
            Gauge pressure of the pads of each leg, Pa, from 0.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure for each leg.
        NoConvergence
            When the friction step does not converge.
        """
        check_pressures(pressures, len(self.legs))
        if not self._step(self.model, self.state, self.table, self._films, tuple(pressures)):
            raise NoConvergence(
                f'friction step of {self.period:g} s does not converge: shorten the period, or'
                ' lower shear_stiffness of the foot'
            )
        self._report()

    def _report(self) -> None:
        body = self.state
        self.time = float(body[planar_step.STEPS] * self.period)
        self.dissipation = float(body[planar_step.LOST])
        if self.verdict is None and body[planar_step.TIPPED] > 0.0:
            leg = int(body[planar_step.TIPPED])
            pulls = leg <= len(self.legs)
            why = f'leg {leg} would have to pull' if pulls else 'no loads on its feet balance it'
            self.verdict = f'tip-over at {body[planar_step.TIPPED_AT]:.3f} s: {why}'

    @property
    def contacts(self) -> Array:
        """Force, N, yaw moment, N m, and position, m, of each foot, (feet, 7)."""
        return np.array([self.table[row] for row in _SHOWN[:7]]).T

    @property
    def feet(self) -> list[FootState]:
        """State of each foot, updated on access; the objects stay the same."""
        table = self.table if isinstance(self.table, list) else self.table.tolist()
        for state, (fx, fy, load, moment, x, y, z, cap, wet, speed, path, overload) in zip(
            self._feet, zip(*(table[row] for row in _SHOWN), strict=True), strict=True
        ):
            state.position = (x, y, z)
            state.force = (fx, fy, load)
            state.moment = moment
            state.standing = load > 0.0
            state.wet = wet > 0.0
            state.grip = cap
            state.slip_speed, state.slip_path = speed, path
            state.overload_time = overload
        return self._feet

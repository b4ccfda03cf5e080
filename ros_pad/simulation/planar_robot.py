# SPDX-License-Identifier: Apache-2.0
"""L1: a legged robot that slides, turns and pushes in the plane.

The body has the three degrees of freedom of SE(2). The gait moves the feet under the body. Normal
loads follow from the balance of weight, pitch and roll. Bouncing, inertia of swinging legs, servo
compliance and scuffing at touch-down are left out. The level suits paths and Monte-Carlo runs, see
docs/model/planar_robot.md.

The step itself is :mod:`ros_pad.simulation.planar_step`, in plain Python or compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.configuration import instance, integer, number
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import NoConvergence
from ros_pad.records import Array
from ros_pad.simulation import compiled, planar_step
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.planar_step import (
    PlanarFloor,
    PlanarFoot,
    PlanarGait,
    PlanarModel,
    PlanarTow,
    PlanarTrunk,
)
from ros_pad.simulation.robot import FootState, Vector, check_pressures, check_reach
from ros_pad.simulation.scene import LeggedBody, Scene
from ros_pad.simulation.terrain import CELL, WIDTH, Floor


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
    soles_turn : bool
        Whether a sole turns with its leg about the hip, as on legs of three joints without an
        ankle. Otherwise the sole turns with the body alone.

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
    >>> robot.walk([75e3] * 6, steps=3000)
    3000
    >>> f'{robot.body[0]:.2f} m'
    '0.70 m'
    """

    def __init__(
        self,
        scene: Scene,
        floor: Floor,
        period: float,
        compile_steps: bool | None = None,
        soles_turn: bool = False,
    ) -> None:
        instance('scene', scene, Scene)
        instance('scene.body', scene.body, LeggedBody)
        instance('floor', floor, Floor)
        assert isinstance(scene.body, LeggedBody) and isinstance(scene.gait, WalkingGait)
        number('period', period, 's', above=True)
        check_reach(scene)
        if compile_steps is None:
            compile_steps = compiled.worth_loading(scene.duration / period)
        self.legs = scene.legs
        self.period = period
        self.time = 0.0
        self.dissipation = 0.0
        self.verdict: str | None = None
        self.joint_names: tuple[str, ...] = ()
        self.joint_positions: tuple[float, ...] = ()
        self._feet = [FootState() for _ in self.legs]
        self._fresh = False
        self.model = model_of(scene, floor, period, soles_turn)
        self.state: Any = [0.0] * planar_step.BODY
        self.table: Any = [[0.0] * len(self.legs) for _ in range(planar_step.FEET)]
        self._plant()
        self._walk: compiled.Walk = planar_step.walk
        if compile_steps:
            self._compile()
        self._report()

    def _plant(self) -> None:
        """Place the feet as if the gait had been running before time zero."""
        model, table = self.model, self.table
        for index in range(len(self.legs)):
            phase = (model.gait.duty / 2.0 - model.gait.middle[index]) % 1.0
            offset = model.gait.reach
            if phase < model.gait.duty:
                offset += planar_step.body_advance(model, -phase * model.gait.cycle)
            else:
                offset *= -math.cos(math.pi * (phase - model.gait.duty) / (1.0 - model.gait.duty))
            table[planar_step.PHASE][index] = phase
            table[planar_step.OFFSET_X][index] = table[planar_step.LIFTED_X][index] = offset
            if phase < model.gait.duty:
                planar_step.touch_down(model, self.state, table, index)

    def _compile(self) -> None:
        model = self.model
        self.state, self.table = np.array(self.state), np.array(self.table)
        floor = model.floor
        self.model = model._replace(
            foot=model.foot._replace(limits=np.array(model.foot.limits)),
            floor=floor._replace(wet=np.array(floor.wet), heights=np.array(floor.heights)),
        )
        self._walk = compiled.walk(
            self.model, self.state, self.table, (0.0,) * len(self.legs), 1, True
        )

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
        self._advance(pressures, 1, False)

    def walk(self, pressures: Sequence[float], steps: int) -> int:
        """Make many steps with the same pressures.

        The result is that of as many calls of :meth:`step`, but compiled code makes all of them in
        one call. The walk ends early when the robot tips over.

        Parameters
        ----------
        pressures : sequence of float
            Gauge pressure of the pads of each leg, Pa, from 0.
        steps : int
            Number of steps, from 0.

        Returns
        -------
        int
            Number of steps made.

        Raises
        ------
        InvalidInput
            When there is not one finite pressure for each leg, or ``steps`` is not a whole
            number from 0.
        NoConvergence
            When a friction step does not converge.
        """
        integer('steps', steps)
        before = self.state[planar_step.STEPS]
        self._advance(pressures, steps, True)
        return round(self.state[planar_step.STEPS] - before)

    def _advance(self, pressures: Sequence[float], steps: int, upright: bool) -> None:
        check_pressures(pressures, len(self.legs))
        converged = self._walk(
            self.model, self.state, self.table, tuple(pressures), steps, upright
        )
        if not converged:
            raise NoConvergence(
                f'friction step of {self.period:g} s does not converge: shorten the period, or'
                ' lower shear_stiffness of the foot'
            )
        self._report()

    def _report(self) -> None:
        body = self.state
        self.time = float(body[planar_step.STEPS] * self.period)
        self.dissipation = float(body[planar_step.LOST])
        self._fresh = False
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
        if self._fresh:
            return self._feet
        self._fresh = True
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


# Rows of the table that become attributes of FootState; the first seven are the contacts.
_SHOWN = (
    planar_step.FORCE_X, planar_step.FORCE_Y, planar_step.LOAD,
    planar_step.MOMENT,
    planar_step.MARKER_X, planar_step.MARKER_Y, planar_step.HEIGHT,
    planar_step.CAP, planar_step.WET,
    planar_step.SLIP_SPEED, planar_step.SLIP_PATH, planar_step.OVERLOAD,
)  # fmt: skip


def model_of(scene: Scene, floor: Floor, period: float, soles_turn: bool = False) -> PlanarModel:
    """Return the constants of a walk of a scene's robot on a floor."""
    return PlanarModel(
        period=period,
        settle=scene.settle,
        gait=_gait(scene, soles_turn),
        trunk=_trunk(scene),
        tow=_tow(scene),
        foot=_foot(scene),
        floor=_floor(floor),
    )


def _gait(scene: Scene, soles_turn: bool) -> PlanarGait:
    gait = scene.gait
    assert isinstance(gait, WalkingGait)
    return PlanarGait(
        cycle=gait.cycle,
        stride=gait.stride,
        duty=gait.duty,
        lift=gait.lift,
        reach=gait.reach(),
        pushes=gait.pushes,
        overlap=gait.overlap,
        middle=gait.middles,
        heading_gain=scene.heading_gain,
        soles_turn=soles_turn,
    )


def _trunk(scene: Scene) -> PlanarTrunk:
    body, gait, slope = scene.body, scene.gait, scene.floor.slope
    assert isinstance(body, LeggedBody) and isinstance(gait, WalkingGait)
    reach = max(x * x + y * y for x, y in body.homes)
    hips = body.robot.hips.tolist()
    return PlanarTrunk(
        home_x=tuple(x for x, _ in body.homes),
        home_y=tuple(y for _, y in body.homes),
        hip_x=tuple(hip[0] for hip in hips),
        hip_y=tuple(hip[1] for hip in hips),
        centre_x=float(body.robot.centre[0]),
        centre_y=float(body.robot.centre[1]),
        mass=body.mass,
        inertia=body.inertia,
        height=body.height,
        weight=body.mass * GRAVITY * math.cos(slope),
        downhill=GRAVITY * math.sin(slope),
        leg_stiffness=body.leg_stiffness,
        rocks=0.0 if gait.fewest >= 3 and len(gait.middles) > 4 else 1e-9 * reach,
    )


def _tow(scene: Scene) -> PlanarTow:
    tow, across = scene.tow, math.cos(scene.floor.slope)
    return PlanarTow(
        mass=tow.weight / GRAVITY,
        dry=tow.weight * tow.friction_dry * across,
        wet=tow.weight * tow.friction_wet * across,
        distance=tow.distance,
        height=tow.height,
        stiffness=tow.stiffness,
    )


def _foot(scene: Scene) -> PlanarFoot:
    viscosity, foot = scene.floor.viscosity, scene.foot.on_rough(scene.floor.roughness)
    return PlanarFoot(
        friction=foot.friction,
        shear_strength=foot.shear_strength,
        conforming_pressure=foot.conforming_pressure,
        boundary_friction=foot.boundary_friction,
        capillary=foot.pads * foot.capillary_force,
        critical_film=foot.critical_film,
        film_exponent=foot.film_exponent,
        shear_stiffness=foot.shear_stiffness,
        turning_radius=foot.turning_radius,
        sole_area=foot.sole_area,
        dome_drain=4.0 * math.pi * foot.pads / (3.0 * viscosity),
        sole_drain=4.0 / (3.0 * viscosity * foot.sole_radius**2),
        limit_cell=foot._limit_cell,
        limits=foot._limit_table,
    )


def _floor(floor: Floor) -> PlanarFloor:
    heights = floor.heights
    return PlanarFloor(
        puddle=floor.film_thickness**-2 if floor.film_thickness > 0.0 else math.inf,
        wet=floor.wet_map.tolist(),
        wet_cell=floor.cell,
        wet_x=floor.origin[0],
        wet_y=floor.origin[1],
        heights=[[0.0]] if heights is None else heights.tolist(),
        height_cell=CELL,
        height_x=-1.0,
        height_y=-WIDTH / 2.0,
    )

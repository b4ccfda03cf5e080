# SPDX-License-Identifier: Apache-2.0
"""L1: a hexapod that slides, turns and pushes in the plane.

The body has the three degrees of freedom of SE(2); the gait moves the feet under it; normal loads
follow from balance of height, pitch and roll. What is left out: bouncing, swinging legs' inertia,
servo compliance, scuffing at touch-down. Good for paths and Monte-Carlo runs, see docs/model.md.

The step itself is :mod:`ros_pad.simulation.planar_step`, in plain Python or compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.simulation import compiled
from ros_pad.simulation import planar_step
from ros_pad.simulation.gait import TRIPODS
from ros_pad.simulation.gait import TripodGait
from ros_pad.simulation.planar_step import Setting
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.robot import check_pressures
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import CELL
from ros_pad.simulation.terrain import WIDTH
from ros_pad.simulation.terrain import Floor

# Howe and Cutkosky, Int. J. Robotics Research 15 (1996) 531, approximate the limit surface of a
# sliding contact by an ellipsoid through its largest force and moment: of a disc that is pressed
# evenly, μN and 2/3 R μN.
DISC_TURNING_RADIUS = 2.0 / 3.0


class PlanarHexapod:
    """Six feet in a tripod gait on a floor with wet patches, towing a load.

    Parameters
    ----------
    scene : Scene
        One with a hexapod.
    floor : Floor
        The ground.
    period : float
        Step, s, > 0.
    compile_steps : bool or None
        Whether steps are compiled by numba. None compiles where that is sure to pay: when numba is
        installed and the trial of the scene is long, or something was compiled before. The walk is
        the same to the last bit.
    soles_turn : bool
        Whether a sole turns with its leg about the hip, as on legs of three joints without an
        ankle. Otherwise it turns with the body alone.

    Raises
    ------
    ConfigError
        To compile without numba.
    InvalidInput
        When the period is not above zero.
    """

    def __init__(
        self,
        scene: Scene,
        floor: Floor,
        period: float,
        compile_steps: bool | None = None,
        soles_turn: bool = False,
    ) -> None:
        assert isinstance(scene.body, HexapodBody) and isinstance(scene.gait, TripodGait)
        number('period', period, 's', above=True)
        if compile_steps is None:
            compile_steps = compiled.worth_loading(scene.duration / period)
        self.legs: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
        self.period = period
        self.time = 0.0
        self.dissipation = 0.0
        self.verdict: str | None = None
        self.joint_names: tuple[str, ...] = ()
        self.joint_positions: tuple[float, ...] = ()
        self._feet = [FootState() for _ in self.legs]
        self._fresh = False
        self._setting = setting(scene, floor, period, soles_turn)
        self._body: Any = [0.0] * planar_step.BODY
        self._table: Any = [[0.0] * 6 for _ in range(planar_step.FEET)]
        self._plant()
        self._walk: compiled.Walk = planar_step.walk
        if compile_steps:
            self._compile()
        self._report()

    def _plant(self) -> None:
        """Place the feet as if the gait had been running before time zero."""
        now, table = self._setting, self._table
        for index in range(6):
            phase = (now.duty / 2.0 - now.middle[index]) % 1.0
            offset = now.reach
            if phase < now.duty:
                offset += planar_step.body_advance(now, -phase * now.cycle)
            else:
                offset *= -math.cos(math.pi * (phase - now.duty) / (1.0 - now.duty))
            table[planar_step.PHASE][index] = phase
            table[planar_step.OFFSET_X][index] = table[planar_step.LIFTED_X][index] = offset
            if phase < now.duty:
                planar_step.touch_down(now, self._body, table, index)

    def _compile(self) -> None:
        now = self._setting
        self._body, self._table = np.array(self._body), np.array(self._table)
        self._setting = now._replace(
            limits=np.array(now.limits), wet=np.array(now.wet), heights=np.array(now.heights)
        )
        self._walk = compiled.walk(self._setting, self._body, self._table, (0.0,) * 6, 1, True)

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        x, y, heading = self._body[planar_step.X : planar_step.HEADING + 1]
        return float(x), float(y), float(heading)

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg."""
        self._advance(pressures, 1, False)

    def walk(self, pressures: Sequence[float], steps: int) -> int:
        """Make many steps with the same gauge pressures, Pa, one for each leg.

        The same as calling :meth:`step` so often, but it does not leave compiled code, and ends
        when the robot tips over.

        Returns
        -------
        int
            Steps that were made.
        """
        if isinstance(steps, bool) or not isinstance(steps, int) or steps < 0:
            raise InvalidInput(f'steps = {steps!r}: a whole number from 0 is needed')
        before = self._body[planar_step.STEPS]
        self._advance(pressures, steps, True)
        return round(self._body[planar_step.STEPS] - before)

    def _advance(self, pressures: Sequence[float], steps: int, upright: bool) -> None:
        check_pressures(pressures, 6)
        settled = self._walk(
            self._setting, self._body, self._table, tuple(pressures), steps, upright
        )
        if not settled:
            raise ArithmeticError(
                f'friction step of {self.period:g} s does not settle: take less stiff pads or a'
                ' shorter step'
            )
        self._report()

    def _report(self) -> None:
        body = self._body
        self.time = float(body[planar_step.STEPS] * self.period)
        self.dissipation = float(body[planar_step.LOST])
        self._fresh = False
        if self.verdict is None and body[planar_step.TIPPED] > 0.0:
            self.verdict = (
                f'tip-over at {body[planar_step.TIPPED_AT]:.3f} s:'
                f' leg {body[planar_step.TIPPED]:.0f} would have to pull'
            )

    def _show(self) -> list[FootState]:
        if self._fresh:
            return self._feet
        self._fresh = True
        table = self._table if isinstance(self._table, list) else self._table.tolist()
        for state, (x, y, height, fx, fy, load, moment, cap, wet, speed, path, overload) in zip(
            self._feet, zip(*(table[row] for row in _SHOWN), strict=True), strict=True
        ):
            state.position = (x, y, height)
            state.force = (fx, fy, load)
            state.moment = moment
            state.standing = load > 0.0
            state.wet = wet > 0.0
            state.grip = cap
            state.slip_speed, state.slip_path = speed, path
            state.overload_time = overload
        return self._feet

    # Brought up to date when asked for; the protocol has a variable here.
    feet: Any = property(_show, doc='State of each foot; the objects stay the same.')


_SHOWN = (
    planar_step.MARKER_X, planar_step.MARKER_Y, planar_step.HEIGHT,
    planar_step.FORCE_X, planar_step.FORCE_Y, planar_step.LOAD,
    planar_step.MOMENT,
    planar_step.CAP, planar_step.WET,
    planar_step.SLIP_SPEED, planar_step.SLIP_PATH, planar_step.OVERLOAD,
)  # fmt: skip


def setting(scene: Scene, floor: Floor, period: float, soles_turn: bool = False) -> Setting:
    """Return what a planar step must know of a scene with a hexapod and of a floor."""
    body, gait, tow, plan = scene.body, scene.gait, scene.tow, scene.floor
    assert isinstance(body, HexapodBody) and isinstance(gait, TripodGait)
    foot = scene.foot.on_rough(plan.roughness)
    across, along = math.cos(plan.slope), math.sin(plan.slope)
    heights, leg = floor.heights, body.coxa + body.femur
    return Setting(
        period=period,
        settle=scene.settle,
        cycle=gait.cycle,
        stride=gait.stride,
        duty=gait.duty,
        lift=gait.lift,
        reach=gait.reach(),
        heading_gain=scene.heading_gain,
        middle=tuple(0.25 if leg in TRIPODS[0] else 0.75 for leg in range(1, 7)),
        home_x=tuple(x for x, _ in body.homes),
        home_y=tuple(y for _, y in body.homes),
        soles_turn=soles_turn,
        # Hips are where a leg ends that points straight out and whose shin stands upright.
        hip_x=tuple(x * (1.0 - leg / math.hypot(x, y)) for x, y in body.homes),
        hip_y=tuple(y * (1.0 - leg / math.hypot(x, y)) for x, y in body.homes),
        mass=body.mass,
        inertia=body.inertia,
        height=body.height,
        weight=body.mass * GRAVITY * across,
        downhill=GRAVITY * along,
        leg_stiffness=body.leg_stiffness,
        towed=tow.weight / GRAVITY,
        tow_dry=tow.weight * tow.friction_dry * across,
        tow_wet=tow.weight * tow.friction_wet * across,
        tow_distance=tow.distance,
        tow_height=tow.height,
        tow_stiffness=tow.stiffness,
        friction=foot.friction,
        shear_strength=foot.shear_strength,
        conforming_pressure=foot.conforming_pressure,
        boundary_friction=foot.boundary_friction,
        capillary=foot.pads * foot.capillary_force,
        critical_film=foot.critical_film,
        film_exponent=foot.film_exponent,
        shear_stiffness=foot.shear_stiffness,
        turning_radius=DISC_TURNING_RADIUS * foot.sole_radius,
        sole_area=foot.sole_area,
        dome_drain=4.0 * math.pi * foot.pads / (3.0 * plan.viscosity),
        sole_drain=4.0 / (3.0 * plan.viscosity * foot.sole_radius**2),
        limit_cell=foot._limit_cell,
        limits=foot._limit_table,
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

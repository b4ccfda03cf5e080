# SPDX-License-Identifier: Apache-2.0
"""Soles of a robot in MuJoCo: contact, film, friction and slip of each foot.

Before every step of MuJoCo the friction of each foot is set from the same film and the same law of
resistance as on the other fidelity levels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.contact import laws
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.records import Array
from ros_pad.simulation.mujoco_model import POINT
from ros_pad.simulation.robot import FootState, check_pressures
from ros_pad.simulation.scene import Scene, Tow
from ros_pad.simulation.terrain import Floor

LOSS = 0.15
"""Loss factor of domes that swing under the mass that a foot carries, under its weight; the damper
grows with the force. As of casting silicones, assumed.
"""

LIGHT = 0.05
"""Load, N, below which the friction coefficient no longer changes with the load."""

SLIP_LOAD = 1.0
"""Load, N, up to which a foot does not count as slipping."""

SLIP_SPEED = 1e-3
"""Speed, m/s, below which a contact counts as sticking."""

CLEAR = 2e-3
"""Height above the ground, m, above which a foot has left it; the film below the foot then has its
initial thickness.
"""

_SHALLOW = 5e-3  # m above the ground: below it the block under a foot no longer moves


class Sole(FootState):
    """Sole of a foot, and what it stands on.

    Attributes
    ----------
    film : Film
        Liquid below it.
    friction, normal, share, tangential : memoryview
        MuJoCo's coefficients of its contact: friction, spring and damper along the normal, its
        impedance, and damper along the ground.
    inverse : float
        One over the mass that MuJoCo takes its contact to have, 1/kg.
    block : memoryview or None
        Place of the ground below it, m, that moves up and down; None on even ground.
    ratio : float
        Present coefficient of friction.
    pressure : float
        Gauge pressure in the pads, Pa.
    cleared : bool
        Whether it left the ground in its present or last swing.
    """

    def __init__(self, film: Film, leg: int, model: Any, block: Any) -> None:
        super().__init__()
        pair, body = model.pair(f'foot_{leg}').id, model.geom(f'foot_{leg}').bodyid[0]
        # Scalars go through a memoryview faster than through an array.
        self.friction: Any = memoryview(model.pair_friction[pair])
        self.normal: Any = memoryview(model.pair_solref[pair])
        self.share: Any = memoryview(model.pair_solimp[pair])
        self.tangential: Any = memoryview(model.pair_solreffriction[pair])
        self.tangential[0] = -1e-9
        self.inverse = float(model.body_invweight0[body, 0])
        self.film, self.block = film, block
        self.ratio = self.pressure = 0.0
        self.cleared = True


class Soles:
    """Soles of all feet.

    Parameters
    ----------
    scene : Scene
        Scene with foot, floor and legs.
    floor : Floor
        The ground.
    period, dt : float
        Length of a step of the robot and of MuJoCo, s.
    model, data : mujoco.MjModel, mujoco.MjData
        The simulation.

    Attributes
    ----------
    foot : Foot
        The foot on this floor.
    lever : float
        Lever of friction against turning about the vertical, m.
    dissipation : float
        Work lost in feet that slip or turn, J.
    contacts : array (feet, 7)
        Force, N, yaw moment, N m, and position of the marker, m, of each foot.
    """

    def __init__(
        self, scene: Scene, floor: Floor, period: float, dt: float, model: Any, data: Any
    ) -> None:
        count = len(scene.legs)
        self.foot = foot = scene.foot.on_rough(scene.floor.roughness)
        self.lever = foot.turning_radius
        self.dissipation = 0.0
        self._floor = floor
        self._period, self._dt = period, dt
        self._pressures: list[float] = []
        self._soles = [
            Sole(
                Film(foot, scene.floor.viscosity),
                leg,
                model,
                None if floor.heights is None else memoryview(data.mocap_pos[index]),
            )
            for index, leg in enumerate(scene.legs)
        ]
        # Views of MuJoCo's arrays, because it would take time to make them in every step.
        feet = slice(model.geom('foot_1').id, model.geom('foot_1').id + count)
        self._places = data.geom_xpos[feet]
        self._axes = data.geom_xmat[feet, :6]  # x and y rows of their rotation
        self._last: tuple[list[list[float]], list[list[float]]] = ([], [])
        self._loads = data.sensordata[::6]
        self._felt = data.sensordata.reshape(-1, 6)
        give = 1.0 / foot.shear_stiffness
        self._give = np.array((give, give, 0.0))
        carried = scene.expected_load / GRAVITY
        self._loss = (
            LOSS * math.sqrt((foot.dome_stiffness or foot.sole_stiffness) / carried) / GRAVITY
        )
        self.contacts: Array = np.zeros((count, 7))

    @property
    def feet(self) -> list[Sole]:
        """State of each foot, updated on access; the objects stay the same."""
        for sole, row in zip(self._soles, self.contacts.tolist(), strict=True):
            push_x, push_y, load, sole.moment, *place = row
            sole.force = (push_x + 0.0, push_y, load)  # not -0.0 in the air
            sole.position = tuple(place)
            sole.standing = load > 0.0
            if load > LIGHT:
                sole.grip = sole.ratio * load
        return self._soles

    def fill(self, pressures: Sequence[float]) -> None:
        """Set the gauge pressures of the pads, Pa."""
        if pressures != self._pressures:  # they change more rarely than the robot steps
            check_pressures(pressures, len(self._soles))
            self._pressures = list(pressures)
            for sole, pressure in zip(self._soles, pressures, strict=True):
                sole.pressure = pressure

    def place(self, places: Sequence[Sequence[float]]) -> float:
        """Place the soles, flat and without load; return the height of the highest ground, m."""
        grounds = []
        for sole, (x, y, _) in zip(self._soles, places, strict=True):
            grounds.append(self._floor.height(x, y))
            if sole.block is not None:
                sole.block[2] = grounds[-1]
            sole.film.touch_down(self._floor.depth(x, y))
            sole.wet = self._floor.wet(x, y)
        return max(grounds)

    def swing(self, before: Sequence[bool], now: Sequence[bool]) -> list[int]:
        """Take note of which feet swing; return which end a swing in which they never cleared."""
        low = []
        for index, sole in enumerate(self._soles):
            if now[index] and not before[index]:
                sole.cleared = False
            elif before[index] and not now[index] and not sole.cleared:
                low.append(index)
        return low

    def rub(self) -> None:
        """Set friction and spring of each foot for the next step, from its load in the last."""
        loads, heights = self._loads.tolist(), self._places[:, 2].tolist()
        for sole, load, height in zip(self._soles, loads, heights, strict=True):
            if load > LIGHT:
                self.press(sole, load, self._dt)
            ground = sole.block[2] if sole.block is not None else 0.0
            self._give_way(sole, max(0.0, ground + POINT - height))

    def _give_way(self, sole: Sole, depth: float) -> None:
        """Set spring and damper of a foot at a depth, m, as an implicit step of them needs.

        MuJoCo's contact has the force D(-b v - k r - a) at a penetration r, speed v and
        acceleration a. A damper c, and a spring K at the middle of the step h, need
        D = K h²/2 + c h and b = 1/h: stable at all steps, once the foot has touched.
        """
        force, stiffness = laws.spring(self.foot, depth, sole.pressure)
        dt, damper = self._dt, self._loss * force
        mass = 0.5 * stiffness * dt * dt + damper * dt
        share = mass * sole.inverse / (1.0 + mass * sole.inverse)
        spring = force / depth if depth > 0.0 else stiffness
        sole.normal[0], sole.normal[1] = -spring / mass * share, -share / dt
        sole.share[0] = sole.share[1] = share
        sole.tangential[1] = -share / dt

    def press(self, sole: Sole, load: float, drained: float) -> None:
        """Set the friction of a foot with a load, N, whose film has drained for a time, s."""
        film = sole.film if sole.wet else None
        grip = self.foot.grip(load, sole.pressure, film, drained, sole.slip_speed)
        sole.ratio = ratio = grip / load
        row = sole.friction
        # The yaw moment of an evenly pressed round sole has a lever arm of 2/3 of its radius.
        row[0] = row[1] = ratio
        row[2] = self.lever * ratio

    def update(self) -> None:
        """Set contacts, slip and the work lost in it, after the last step of MuJoCo."""
        # The axes of a contact with level ground are z, y, -x. Pads shear by force/stiffness.
        contacts, felt = self.contacts, self._felt
        contacts[:, :3] = felt[:, 2::-1] * (-1.0, 1.0, 1.0)
        contacts[:, 3] = felt[:, 3]
        contacts[:, 4:] = self._places - contacts[:, :3] * self._give
        contacts[:, 6] -= POINT
        pushes_x, pushes_y, loads, moments = contacts[:, :4].T.tolist()
        places, axes = self._places.tolist(), self._axes.tolist()
        last_places, last_axes = self._last
        self._last = places, axes
        dt = self._period
        for index, sole in enumerate(self._soles):
            (x, y, z), load = places[index], loads[index]
            sole.slip_speed = 0.0
            sole.wet = self._floor.wet(x, y)
            if load <= LIGHT:
                sole.grip = sole.ratio * load
                self._approach(sole, x, y, z - POINT)
            elif load > SLIP_LOAD:
                step_x, step_y = x - last_places[index][0], y - last_places[index][1]
                distance = math.hypot(step_x, step_y)
                if distance > SLIP_SPEED * dt:
                    sole.slip_speed = distance / dt
                    sole.slip_path += distance
                turn = _turn(last_axes[index], axes[index])
                # As on L1, sliding and turning share a foot's grip.
                if math.hypot(distance, self.lever * turn) > SLIP_SPEED * dt:
                    lost = pushes_x[index] * step_x + pushes_y[index] * step_y
                    self.dissipation -= lost + moments[index] * turn
            if sole.pressure > 0.0 and self.foot.dome_load(load, sole.pressure) < load:
                sole.overload_time += dt

    def _approach(self, sole: Sole, x: float, y: float, z: float) -> None:
        """Prepare film, block and friction below a foot without load."""
        ground, clear = 0.0, CLEAR
        if sole.block is not None:
            clear = _SHALLOW
            ground = sole.block[2]
            if z > ground + _SHALLOW:
                sole.block[2] = self._floor.height(x, y)
        if z > ground + clear:
            sole.cleared = True
        if z > ground + CLEAR:
            sole.film.touch_down(self._floor.depth(x, y))
        self.press(sole, LIGHT, 0.0)


class Sled:
    """A towed load on the floor.

    Attributes
    ----------
    distance : float
        Its distance behind the body at the start, m.
    """

    def __init__(self, tow: Tow, floor: Floor, model: Any, data: Any) -> None:
        self.distance = tow.distance
        self._frictions = (tow.friction_dry, tow.friction_wet)
        self._floor = floor
        self._place: Any = memoryview(data.geom('sled').xpos)
        self._friction: Any = memoryview(model.pair('sled').friction)

    def rub(self) -> None:
        """Set its friction for the next step of MuJoCo."""
        x, y, _ = self._place
        row = self._friction
        row[0] = row[1] = self._frictions[self._floor.wet(x, y)]


def _turn(before: Sequence[float], now: Sequence[float]) -> float:
    """Return a body's small turn about the vertical, rad, from the x and y rows of its rotation.

    The rows are those of the rotation matrix.
    """
    a, b, c, d, e, f = before
    u, v, w, x, y, z = now
    return 0.5 * (x * a + y * b + z * c - u * d - v * e - w * f)

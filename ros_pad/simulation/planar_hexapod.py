# SPDX-License-Identifier: Apache-2.0
"""L1: a hexapod that slides, turns and pushes in the plane.

The body has the three degrees of freedom of SE(2); the gait moves the feet under it; normal loads
follow from balance of height, pitch and roll. What is left out: bouncing, swinging legs' inertia,
servo compliance, scuffing at touch-down. Good for paths and Monte-Carlo runs, see docs/model.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ros_pad.contact.film import Film
from ros_pad.simulation.friction import Contact
from ros_pad.simulation.friction import elastic
from ros_pad.simulation.gait import TripodGait
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

GRAVITY = 9.81  # m/s²


class PlanarHexapod:
    """Six feet in a tripod gait on a floor with wet patches, towing a load.

    Parameters
    ----------
    scene : Scene
        One with a hexapod.
    floor : Floor
        The ground.
    period : float
        Step, s.
    """

    def __init__(self, scene: Scene, floor: Floor, period: float) -> None:
        assert isinstance(scene.body, HexapodBody) and isinstance(scene.gait, TripodGait)
        gait, foot = scene.gait, scene.foot
        self.legs: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
        self.period = period
        self.time = 0.0
        self.feet = [FootState() for _ in self.legs]
        self.dissipation = 0.0
        self.verdict: str | None = None
        self._body = scene.body
        self._gait = gait
        self._heading_gain = scene.heading_gain
        self._settle = scene.settle
        self._foot = foot
        self._floor = floor
        self._tow = scene.tow
        self._steps = 0
        self._x = self._y = self._heading = 0.0
        self._twist: Vector = (0.0, 0.0, 0.0)
        self._films = [Film(foot, scene.floor.viscosity) for _ in self.legs]
        self._contacts = [Contact(foot.shear_stiffness) for _ in self.legs]
        self._sled = Contact(scene.tow.stiffness)
        self._pull = (0.0, 0.0)
        self._reach = gait.reach()
        self._motions = [(0.0, 0.0)] * 6
        # Where each foot is in the body now, relative to home, and where it left the ground.
        self._offsets = [self._planned_offset(leg) for leg in self.legs]
        self._lifted = list(self._offsets)
        self._phases = [gait.phase(leg, 0.0) for leg in self.legs]
        for index in range(6):
            if self._phases[index] < gait.duty:
                self._touch_down(index)

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        return self._x, self._y, self._heading

    def _planned_offset(self, leg: int) -> tuple[float, float]:
        """Place a foot as if the gait had been running before time zero."""
        gait = self._gait
        phase = gait.phase(leg, 0.0)
        if phase < gait.duty:
            since = phase * gait.cycle
            return self._reach - (gait.body_advance(0.0) - gait.body_advance(-since)), 0.0
        progress, _ = gait.swing(phase)
        return (2.0 * progress - 1.0) * self._reach, 0.0

    def _touch_down(self, index: int) -> None:
        x, y = self._foot_position(index)
        self._films[index].touch_down(self._floor.depth(x, y))

    def _foot_position(self, index: int) -> tuple[float, float]:
        home_x, home_y = self._body.homes[index]
        x, y = home_x + self._offsets[index][0], home_y + self._offsets[index][1]
        cosine, sine = math.cos(self._heading), math.sin(self._heading)
        return self._x + cosine * x - sine * y, self._y + sine * x + cosine * y

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg."""
        dt, gait, foot = self.period, self._gait, self._foot
        self._steps += 1
        self.time = self._steps * dt
        # The gait has its own clock, which starts when the robot has settled.
        after = max(0.0, self.time - self._settle)
        before = max(0.0, self.time - dt - self._settle)
        advance = gait.body_advance(after) - gait.body_advance(before)
        turn = -self._heading_gain * self._heading * dt
        heights = self._move_feet(after, advance, turn)
        loads = self._loads()
        floor, contacts = self._floor, self._contacts
        # Lever arms and motions are turned into world axes with the heading half-way.
        middle = self._heading + 0.5 * self._twist[2] * dt
        cosine, sine = math.cos(middle), math.sin(middle)
        on_domes = [0.0] * 6
        for index in range(6):
            contact, load, state = contacts[index], loads[index], self.feet[index]
            if load <= 0.0:
                contact.cap = 0.0
                state.grip = 0.0
                continue
            home_x, home_y = self._body.homes[index]
            x, y = home_x + self._offsets[index][0], home_y + self._offsets[index][1]
            lever_x, lever_y = cosine * x - sine * y, sine * x + cosine * y
            step_x, step_y = self._motions[index]
            contact.lever_x, contact.lever_y = lever_x, lever_y
            contact.motion_x = (cosine * step_x - sine * step_y) / dt
            contact.motion_y = (sine * step_x + cosine * step_y) / dt
            pressure, film = pressures[index], self._films[index]
            dome_load = foot.dome_load(load, pressure)
            state.wet = floor.wet(self._x + lever_x, self._y + lever_y)
            if state.wet:
                film.drain(dome_load, load - dome_load, pressure, dt)
                thickness = film.under_domes, film.under_sole
            else:
                thickness = 0.0, 0.0
            contact.cap = foot.resistance_of(dome_load, load - dome_load, pressure, *thickness)
            state.grip = contact.cap
            on_domes[index] = dome_load
        self._advance_body(dt, cosine, sine)
        self._report(loads, on_domes, pressures, heights)

    def _move_feet(self, time: float, advance: float, turn: float) -> list[float]:
        """Move the feet in the body as the gait wants; return their heights."""
        gait = self._gait
        heights = [0.0] * 6
        self._motions = [(0.0, 0.0)] * 6
        for index, leg in enumerate(self.legs):
            phase = gait.phase(leg, time)
            offset_x, offset_y = self._offsets[index]
            if phase < gait.duty:
                if self._phases[index] >= gait.duty:
                    self._touch_down(index)
                home_x, home_y = self._body.homes[index]
                # Walking ahead and turning: the foot goes back and round the other way.
                step_x = -advance + turn * (home_y + offset_y)
                step_y = -turn * (home_x + offset_x)
                self._motions[index] = (step_x, step_y)
                self._offsets[index] = (offset_x + step_x, offset_y + step_y)
            else:
                if self._phases[index] < gait.duty:
                    self._lifted[index] = (offset_x, offset_y)
                progress, heights[index] = gait.swing(phase)
                from_x, from_y = self._lifted[index]
                self._offsets[index] = (
                    from_x + progress * (self._reach - from_x),
                    from_y * (1.0 - progress),
                )
            self._phases[index] = phase
        return heights

    def _loads(self) -> list[float]:
        """Share the weight: least squares weighted with each foot's share, in balance.

        N_i = w_i (λ0 + λ1 x_i + λ2 y_i) with ΣN = W, ΣN x = W x_p, ΣN y = W y_p, where the
        pressure point (x_p, y_p) lags behind the centre of mass when the body speeds up. The
        horizontal forces are those of the step before.
        """
        gait, body = self._gait, self._body
        weight = body.mass * GRAVITY
        cosine, sine = math.cos(self._heading), math.sin(self._heading)
        push_x = sum(contact.force_x for contact in self._contacts)
        push_y = sum(contact.force_y for contact in self._contacts)
        pull_x, pull_y = self._pull
        lean_x = -body.height * push_x + (self._tow.height - body.height) * pull_x
        lean_y = -body.height * push_y + (self._tow.height - body.height) * pull_y
        moment_x = cosine * lean_x + sine * lean_y
        moment_y = -sine * lean_x + cosine * lean_y
        s = sx = sy = sxx = sxy = syy = 0.0
        standing = []
        for index in range(6):
            share = gait.load_share(self._phases[index])
            if share > 0.0:
                home_x, home_y = body.homes[index]
                x, y = home_x + self._offsets[index][0], home_y + self._offsets[index][1]
                standing.append((index, share, x, y))
                wx, wy = share * x, share * y
                s += share
                sx += wx
                sy += wy
                sxx += wx * x
                sxy += wx * y
                syy += wy * y
        # Gauss elimination of the symmetric 3 x 3 system.
        axx, axy, bx = sxx - sx * sx / s, sxy - sx * sy / s, moment_x - sx * weight / s
        ayy, by = syy - sy * sy / s, moment_y - sy * weight / s
        determinant = axx * ayy - axy * axy
        slope_x = (bx * ayy - by * axy) / determinant
        slope_y = (by * axx - bx * axy) / determinant
        level = (weight - sx * slope_x - sy * slope_y) / s
        loads = [0.0] * 6
        for index, share, x, y in standing:
            load = share * (level + slope_x * x + slope_y * y)
            if load < 0.0 and self.verdict is None:
                self.verdict = f'tip-over at {self.time:.3f} s: leg {index + 1} would have to pull'
            loads[index] = load if load > 0.0 else 0.0
        return loads

    def _advance_body(self, dt: float, cosine: float, sine: float) -> None:
        tow, sled, body = self._tow, self._sled, self._body
        behind_x, behind_y = self._x - tow.distance * cosine, self._y - tow.distance * sine
        sled.cap = tow.weight * (
            tow.friction_wet if self._floor.wet(behind_x, behind_y) else tow.friction_dry
        )
        towed = tow.weight / GRAVITY
        last = self._twist
        twist = elastic(last, body.mass + towed, body.inertia, [*self._contacts, sled], dt, last)
        # What the line does to the body: the load's friction, and its inertia.
        self._pull = (
            sled.force_x - towed * (twist[0] - last[0]) / dt,
            sled.force_y - towed * (twist[1] - last[1]) / dt,
        )
        self._twist = twist
        self._x += twist[0] * dt
        self._y += twist[1] * dt
        self._heading += twist[2] * dt

    def _report(
        self,
        loads: list[float],
        on_domes: list[float],
        pressures: Sequence[float],
        heights: list[float],
    ) -> None:
        dt = self.period
        for index, state in enumerate(self.feet):
            contact = self._contacts[index]
            load = loads[index]
            x, y = self._foot_position(index)
            state.position = (x, y, heights[index])
            state.force = (contact.force_x, contact.force_y, load)
            state.standing = load > 0.0
            state.slip_speed = 0.0
            if not state.standing:
                continue
            state.slip_speed = contact.slid / dt
            state.slip_path += contact.slid
            self.dissipation += contact.cap * contact.slid
            if pressures[index] > 0.0 and on_domes[index] < load:
                state.overload_time += dt

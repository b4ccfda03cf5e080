# SPDX-License-Identifier: Apache-2.0
"""L0: the thesis' walking mechanism (5.2), one foot that pushes a body on wheels along a rail.

One degree of freedom. The foot's force is at most its cap c, the wheels resist with a drag F, and
each step solves M (v - v0)/dt + c sgn(v - u) + F sgn(v) = 0 for the speed v of the body exactly,
u being the speed at which the foot goes back under it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ros_pad.contact.film import Film
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import RailBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor


class RailLeg:
    """A body on a rail with one foot.

    Parameters
    ----------
    scene : Scene
        One with a rail leg.
    floor : Floor
        The ground.
    period : float
        Step, s.
    """

    def __init__(self, scene: Scene, floor: Floor, period: float) -> None:
        assert isinstance(scene.body, RailBody) and isinstance(scene.gait, RailGait)
        self.legs: tuple[int, ...] = (1,)
        self.period = period
        self.time = 0.0
        self.feet = [FootState()]
        self.dissipation = 0.0
        self.verdict: str | None = None
        self.joint_names: tuple[str, ...] = ()
        self.joint_positions: tuple[float, ...] = ()
        self._body = scene.body
        self._gait = scene.gait
        self._foot = scene.foot
        self._floor = floor
        self._film = Film(scene.foot, scene.floor.viscosity)
        self._start = scene.settle
        self._steps = 0
        self._x = self._speed = 0.0
        self._offset = scene.gait.stroke / 2.0
        self._stands = True
        self._film.touch_down(floor.depth(self._offset, 0.0))

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body."""
        return self._x, 0.0, 0.0

    def _plan(self, time: float) -> tuple[bool, float, float]:
        """Whether the foot stands, where it is ahead of the body, and how high, m."""
        gait = self._gait
        since = max(0.0, time - self._start) % gait.cycle
        if since < gait.stance:
            return True, 0.5 * gait.stroke * math.cos(math.pi * since / gait.stance), 0.0
        share = (since - gait.stance) / gait.swing
        height = gait.lift * math.sin(math.pi * share) ** 2
        return False, -0.5 * gait.stroke * math.cos(math.pi * share), height

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with the pad's gauge pressure, Pa, in a sequence of one."""
        dt, state, foot = self.period, self.feet[0], self._foot
        self._steps += 1
        self.time = self._steps * dt
        stands, offset, height = self._plan(self.time)
        back = (self._offset - offset) / dt
        if stands and not self._stands:
            self._film.touch_down(self._floor.depth(self._x + offset, 0.0))
        self._stands, self._offset = stands, offset
        cap = 0.0
        overloaded = False
        if stands:
            load, pressure = self._body.load, pressures[0]
            domes = foot.dome_load(load, pressure)
            overloaded = pressure > 0.0 and domes < load
            state.wet = self._floor.wet(self._x + offset, 0.0)
            films = (0.0, 0.0)
            if state.wet:
                self._film.drain(domes, load - domes, pressure, dt)
                films = self._film.under_domes, self._film.under_sole
            cap = foot.resistance_of(domes, load - domes, pressure, *films)
        force = self._push(cap, back, dt)
        self._x += self._speed * dt
        slip = self._speed - back if stands else 0.0
        # What stands on the floor is the contact; the marker is above soft pads, which shear.
        state.position = (self._x + offset - force / foot.shear_stiffness, 0.0, height)
        state.force = (force, 0.0, self._body.load if stands else 0.0)
        state.standing = stands
        state.grip = cap
        state.slip_speed = abs(slip)
        state.slip_path += abs(slip) * dt
        self.dissipation += cap * abs(slip) * dt
        if overloaded:
            state.overload_time += dt

    def _push(self, cap: float, back: float, dt: float) -> float:
        """Solve the step for the speed of the body; return the floor's force on the foot.

        The speed minimises ½ (v - v0)² + (dt/M) (c |v - u| + F |v|); the minimiser of a parabola
        and two kinks is the median of the kinks and of the three smooth branches.
        """
        mass, drag = self._body.mass, self._body.rolling_drag
        free, foot, wheels = self._speed, dt / mass * cap, dt / mass * drag
        low, high = (foot, wheels) if back < 0.0 else (wheels, foot)
        branches = (free + foot + wheels, free - low + high, free - foot - wheels)
        speed = self._speed = sorted((back, 0.0, *branches))[2]
        if speed == 0.0:
            # The wheels hold too, so only a slipping foot has a force that is known.
            return math.copysign(cap, back) if back else 0.0
        return mass * (speed - free) / dt + math.copysign(drag, speed)

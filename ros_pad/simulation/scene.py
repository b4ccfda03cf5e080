# SPDX-License-Identifier: Apache-2.0
"""A scene: robot, feet, gait, floor, towed load, sensors, air lines, policy and faults."""

from __future__ import annotations

import dataclasses
import math
import os
import pathlib
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from typing import Any, Self

from ros_pad import configuration
from ros_pad.configuration import Setting, Table
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Gait, Robot
from ros_pad.robots.posture import FROUDE
from ros_pad.simulation.faults import AIR_KINDS, Fault, listed
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.terrain import FLOORS, Floor, patch_lengths

LEAST_TRUNK = 0.01
"""Least share of a robot's mass that is not legs."""

RAIL_LEG = 'rail_leg'
"""The robot of a scene with the leg on its rail."""


def _number(
    unit: str, low: float, high: float, default: Any = MISSING, key: str = '', needed: bool = False
) -> Any:
    """Return a field that a file gives as a number; its key is the field's name or ``key``.

    A file must give what is ``needed`` or has no default.
    """
    ends = {'range': (unit, low, high), 'key': key, 'needed': needed or default is MISSING}
    return field(default=default, metadata=ends)


class _Part:
    """A part of a scene, whose fields are the keys of its table in the file."""

    @classmethod
    def read(cls, table: Table, **known: Any) -> Self:
        """Read the numbers of the part, except what is known."""
        for each in fields(cls):  # type: ignore[arg-type]
            if 'range' in each.metadata and each.name not in known:
                default: Any = {} if each.metadata['needed'] else {'default': each.default}
                key = each.metadata['key'] or each.name
                known[each.name] = table.number(key, *each.metadata['range'], **default)
        return cls(**known)


@dataclass(frozen=True)
class LeggedBody:
    """Masses and legs of a robot. Its feet are soles on ankles, so they do not roll.

    Attributes
    ----------
    robot : Robot
        Legs, kinematics and servos.
    mass : float
        Mass of the robot, kg; that of each link is in proportion.
    inertia : float
        Moment of inertia of the robot about the vertical axis, kg m².
    height : float
        Height of the centre of mass above the floor, m.
    homes : tuple of (float, float)
        Home positions of the feet in the base, fore and left, m.
    leg_stiffness : float
        Vertical stiffness of a leg and its foot, N/m: load that a foot gains for each metre by
        which its ground is higher.
    """

    robot: Robot = field(compare=False, repr=False)
    mass: float
    inertia: float
    height: float
    homes: tuple[tuple[float, float], ...]
    leg_stiffness: float

    @cached_property
    def ground(self) -> float:
        """Height of the ground at home in the base, m, below 0: that of the lowest foot."""
        return float(self.robot.foot_positions(self.robot.home)[:, 2].min().round(12))

    @classmethod
    def read(cls, table: Table, robot: Robot) -> LeggedBody:
        """Read the table ``body`` of a scene: what is not as in the robot's file."""
        legs = sum(joint.mass for leg in robot.chains.legs for joint in leg)
        if not robot.mass - legs > LEAST_TRUNK * robot.mass:
            raise ConfigError(
                f'{table.origin}: the legs of robot {robot.name!r} have {legs:.4g} of its'
                f' {robot.mass:.4g} kg: less than {1.0 - LEAST_TRUNK:.0%} is needed; have base and'
                ' links an <inertial> with <mass>?'
            )
        mass = table.number('mass', 'kg', 0.05, 2000.0, default=robot.mass)
        inertia, stiffness = robot.inertia * mass / robot.mass, robot.leg_stiffness
        feet = robot.foot_positions(robot.home)[:, :2].round(12)
        return cls(
            robot=robot,
            mass=mass,
            inertia=table.number('inertia', 'kg m2', 1e-5, 1000.0, default=inertia),
            height=table.number('height', 'm', 0.0, 5.0, default=robot.height),
            homes=tuple((float(x), float(y)) for x, y in feet),
            leg_stiffness=table.number('leg_stiffness', 'N/m', 1.0, 1e7, default=stiffness),
        )


@dataclass(frozen=True)
class RailBody(_Part):
    """The thesis' walking mechanism on a rail (5.2): a body on wheels pushed by one foot.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    rolling_drag : float
        Force that the wheels need to roll, N.
    load : float
        Force with which springs press the foot to the floor, N.
    goal : float
        Distance to the end of the rail, m.
    """

    mass: float = _number('kg', 0.01, 100.0)
    rolling_drag: float = _number('N', 0.0, 1000.0)
    load: float = _number('N', 0.01, 1000.0)
    goal: float = _number('m', 0.01, 1000.0)


@dataclass(frozen=True)
class RailGait(_Part):
    """The foot's stroke on the rail.

    Attributes
    ----------
    stroke : float
        Path length of the foot under the body in stance, m.
    stance, swing : float
        Durations of stance and swing, s.
    lift : float
        Height of the foot in the middle of its swing, m.
    """

    stroke: float = _number('m', 1e-3, 1.0)
    stance: float = _number('s', 0.05, 60.0)
    swing: float = _number('s', 0.05, 60.0)
    lift: float = _number('m', 1e-3, 0.2)

    @property
    def cycle(self) -> float:
        """Duration of a cycle, s."""
        return self.stance + self.swing

    @property
    def stride(self) -> float:
        """Advance of the body in a cycle without slip, m."""
        return self.stroke

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration of the body, m/s²."""
        return 0.5 * self.stroke * (math.pi / self.stance) ** 2

    def body_advance(self, time: float) -> float:
        """Return the advance of the body after whole cycles without slip, m."""
        return self.stroke * (time / self.cycle)


@dataclass(frozen=True)
class Tow(_Part):
    """A load that the robot tows over the floor, which requires tangential force of the feet.

    Attributes
    ----------
    weight : float
        Weight of the load, N; 0 for no load.
    friction_dry, friction_wet : float
        Friction coefficients of the load on dry and on wet ground.
    distance : float
        Distance of the load behind the centre of the body, m.
    height : float
        Height above the floor of the line between body and load, m.
    stiffness : float
        Stiffness of that line, N/m.
    """

    weight: float = _number('N', 0.0, 1e4, 0.0, needed=True)
    friction_dry: float = _number('(coefficient)', 0.0, 3.0, 0.0, needed=True)
    friction_wet: float = _number('(coefficient)', 0.0, 3.0, 0.0, needed=True)
    distance: float = _number('m', 0.0, 10.0, 0.0)
    height: float = _number('m', 0.0, 1.0, 0.0)
    stiffness: float = _number('N/m', 1.0, 1e7, 2000.0)


@dataclass(frozen=True)
class SensorNoise(_Part):
    """Rate and white noise of the sensors, and the bias of gyro and accelerometer.

    The defaults are about twice what data sheets of cheap parts promise (docs/model/sensors.md).

    Attributes
    ----------
    rate : float
        Samples per second, Hz.
    force : float
        Standard deviation of each force component, N.
    position : float
        Standard deviation of each marker coordinate, m.
    moment : float
        Standard deviation of the yaw moment, N m; 0 for sensors that do not measure it.
    gyro, accelerometer : float
        Standard deviation of each component of the IMU, rad/s and m/s².
    gyro_bias, accelerometer_bias : float
        Length of their biases, which have a random direction, rad/s and m/s².
    encoder, joint_velocity, effort : float
        Standard deviation of position, rad, velocity, rad/s, and torque, N m, of a joint.
    """

    rate: float = _number('Hz', 50.0, 1000.0)
    force: float = _number('N', 0.0, 10.0, key='force_noise')
    position: float = _number('m', 0.0, 0.01, key='position_noise')
    moment: float = _number('N m', 0.0, 1.0, 0.0, 'moment_noise')
    gyro: float = _number('rad/s', 1e-6, 1.0, 0.005, 'gyro_noise')
    accelerometer: float = _number('m/s2', 1e-6, 10.0, 0.05, 'accelerometer_noise')
    gyro_bias: float = _number('rad/s', 0.0, 1.0, 0.01)
    accelerometer_bias: float = _number('m/s2', 0.0, 5.0, 0.05)
    encoder: float = _number('rad', 1e-6, 0.1, 5e-4, 'encoder_noise')
    joint_velocity: float = _number('rad/s', 1e-6, 10.0, 0.03, 'joint_velocity_noise')
    effort: float = _number('N m', 0.0, 100.0, 0.02, 'effort_noise')


@dataclass(frozen=True)
class FloorPlan(_Part):
    """Description of a floor; :meth:`build` makes the floor for a seed.

    Attributes
    ----------
    kind : str
        ``dry``, ``wet``, ``patches`` or ``drawn``.
    film_thickness : float
        Depth of the liquid on wet ground, m.
    viscosity : float
        Viscosity of the liquid, Pa s.
    wet_fraction, patch_length : float
        Share of wet floor, and mean length of a wet patch, m; patches only.
    drawing : tuple of str
        Rows of ``#`` (wet) and ``.`` (dry), see :meth:`Floor.drawn`; drawn only.
    cell : float
        Edge of the square that a character of the drawing stands for, m; drawn only.
    slope : float
        Angle at which the floor rises along +x, rad.
    roughness : float
        Root mean square height of the floor's texture under a foot, m, see
        :meth:`ros_pad.contact.Foot.on_rough`.
    unevenness : float
        Root mean square of the height of the ground, m, see :meth:`Floor.uneven`.
    """

    kind: str
    film_thickness: float = _number('m', 1e-9, 0.01, 3e-4)
    viscosity: float = _number('Pa s', 1e-5, 10.0, WATER_VISCOSITY)
    wet_fraction: float = 0.0
    patch_length: float = 0.0
    drawing: tuple[str, ...] = ()
    cell: float = 0.0
    slope: float = _number('rad', -0.5, 0.5, 0.0)
    roughness: float = _number('m', 0.0, 1e-3, 0.0)
    unevenness: float = _number('m', 0.0, 0.02, 0.0)

    @classmethod
    def read(cls, table: Table, **known: Any) -> Self:
        """Read the table ``floor`` of a scene."""
        known['kind'] = kind = table.choice('kind', FLOORS)
        if kind == 'patches':
            known['wet_fraction'] = share = table.number('wet_fraction', '(share)', 0.01, 0.99)
            known['patch_length'] = table.number('patch_length', 'm', *patch_lengths(share))
        if kind == 'drawn':
            known['drawing'] = tuple(table.text('drawing').split())
            known['cell'] = table.number('cell', 'm', 1e-3, 10.0)
            try:
                Floor.drawn(known['drawing'], known['cell'], 0.0)
            except InvalidInput as error:
                raise ConfigError(f'{table.origin}: {error}') from error
        return super().read(table, **known)

    def build(self, seed: int) -> Floor:
        """Return the floor for a seed."""
        if self.kind == 'patches':
            floor = Floor.patches(self.wet_fraction, self.patch_length, self.film_thickness, seed)
        elif self.kind == 'drawn':
            floor = Floor.drawn(self.drawing, self.cell, self.film_thickness)
        else:
            floor = Floor.uniform(self.kind == 'wet', self.film_thickness)
        return floor.uneven(self.unevenness, seed)


@dataclass(frozen=True)
class Scene:
    """Everything that a trial needs, except the seed; the files are ``config/scenes/*.yaml``.

    Attributes
    ----------
    source : str
        Name of the shipped scene, or path of the file, that describes it.
    name : str
        Name without folder.
    description : str
        Text ``description`` of the file.
    robot : str
        Name or path of the robot as the file has it; ``rail_leg`` for the leg on its rail.
    body : LeggedBody or RailBody
        Masses, sizes and forces of the body.
    gait : WalkingGait or RailGait
        Gait of the legs.
    heading_gain : float
        Rate at which the gait steers back to heading zero, 1/s; 0 for a rail leg.
    foot : Foot
        Foot of every leg.
    floor : FloorPlan
        What a floor for a seed is made from.
    tow : Tow
        Load that the robot pulls.
    sensors : SensorNoise
        Noise and rate of the sensors.
    regulator : dict
        Air line of every foot, as options of the simulated regulator.
    policy : str
        Policy of a trial that does not name another one.
    dome_pressure : float or None
        Fixed gauge pressure of a dome, Pa; None chooses it from the load.
    settle : float
        Time for which the robot stands while the pads fill, before it walks, s.
    cycles : int
        Gait cycles of a trial.
    accuracy : float
        Largest relative error of its metric that the scene allows a fidelity level.
    metric : str
        What must be that accurate: ``distance`` of the body, or ``slip`` path of its feet.
    wanted : str
        ``walk`` with all signals, or only the ``metric``, which may need no simulation.
    faults : tuple of Fault
        Faults of regulators, hoses and sensors; see :mod:`ros_pad.simulation.faults`.
    """

    source: str
    name: str
    description: str
    robot: str
    body: LeggedBody | RailBody
    gait: WalkingGait | RailGait
    heading_gain: float
    foot: Foot
    floor: FloorPlan
    tow: Tow
    sensors: SensorNoise
    regulator: dict[str, Any]
    policy: str
    dome_pressure: float | None
    settle: float
    cycles: int
    accuracy: float
    metric: str = 'distance'
    wanted: str = 'walk'
    faults: tuple[Fault, ...] = ()

    @property
    def legged(self) -> tuple[LeggedBody, WalkingGait]:
        """Body and gait of a robot with legs.

        Raises
        ------
        InvalidInput
            For the leg on its rail.
        """
        if isinstance(self.body, LeggedBody) and isinstance(self.gait, WalkingGait):
            return self.body, self.gait
        raise InvalidInput(f'scene {self.name!r} is not allowed: a robot with legs is needed')

    @property
    def on_rail(self) -> tuple[RailBody, RailGait]:
        """Body and gait of the leg on its rail.

        Raises
        ------
        InvalidInput
            For other robots.
        """
        if isinstance(self.body, RailBody) and isinstance(self.gait, RailGait):
            return self.body, self.gait
        raise InvalidInput(f'scene {self.name!r} is not allowed: a rail leg is needed')

    @property
    def duration(self) -> float:
        """Simulated time of a trial, s."""
        return self.settle + self.cycles * self.gait.cycle

    @property
    def legs(self) -> tuple[int, ...]:
        """Numbers of the robot's legs, in the order of its file."""
        if isinstance(self.gait, WalkingGait):
            return tuple(range(1, len(self.gait.middles) + 1))
        return (1,)

    @property
    def expected_load(self) -> float:
        """Normal force of a foot when the fewest feet stand, N; that of the spring on a rail."""
        if isinstance(self.gait, WalkingGait):
            return self.body.mass * GRAVITY / self.gait.fewest
        return self.on_rail[0].load

    @property
    def regulator_options(self) -> dict[str, Any]:
        """Options of the regulator node's backend ``simulated``: air line of all feet, and faults.

        Faults are texts, as in a ROS parameter. Faults of the sensors of feet are left out.
        """
        faults = [str(each) for each in self.faults if each.kind in AIR_KINDS]
        return self.regulator | ({'faults': faults} if faults else {})

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Scene:
        """Read ``config/scenes/<name>.yaml``, or the file at a path.

        Parameters
        ----------
        name_or_path : str or path
            Name of a shipped scene, or path of a file that ends in .yaml or .yml.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ConfigError
            When the scene is unknown, or its file has a missing or unknown key or a value that is
            not allowed.

        Examples
        --------
        >>> from ros_pad.simulation import Scene
        >>> scene = Scene.load('hexapod_patches')
        >>> scene.legs, scene.foot.source, round(scene.expected_load, 2)  # N
        ((1, 2, 3, 4, 5, 6), 'large37', 6.83)
        """
        path = configuration.locate('scenes', name_or_path)
        return cls.read(Table.load(path), os.fspath(name_or_path), path.stem)

    @classmethod
    def read(cls, table: Table, source: str, name: str) -> Scene:
        """Read a scene from a table.

        Parameters
        ----------
        table : Table
            The mapping in the file.
        source : str
            Name or path of the file, see :attr:`source`.
        name : str
            Name of the scene, see :attr:`name`.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ConfigError
            As from :meth:`load`.
        """
        if 'bench' in table:
            raise ConfigError(
                f'{table.origin}: is a bench scene, in which no robot walks: compute it with '
                f'pad run {source}, or with studies.thesis.bench.run'
            )
        robot = table.text('robot')
        foot = foot_of(table)
        body: LeggedBody | RailBody
        gait: WalkingGait | RailGait
        tow, heading_gain = Tow(), 0.0
        if robot == RAIL_LEG:
            body, gait = _part(table, 'body', RailBody.read), _part(table, 'gait', RailGait.read)
        else:
            legs = _robot_of(table)
            with table.table('body', default={}) as part:
                body = LeggedBody.read(part, legs)
            with table.table('gait', default={}) as part:
                gait = _walking_gait(part, legs)
                heading_gain = part.number('heading_gain', '1/s', 0.0, 10.0, default=0.0)
            if 'tow' in table:
                tow = _part(table, 'tow', Tow.read)
        pressure = Setting('dome_pressure', float, '', 'Pa', 1000.0, foot.ceiling)
        scene = cls(
            source=source,
            name=name,
            description=table.text('description', default=''),
            robot=robot,
            body=body,
            gait=gait,
            heading_gain=heading_gain,
            foot=foot,
            floor=_part(table, 'floor', FloorPlan.read),
            tow=tow,
            sensors=_part(table, 'sensors', SensorNoise.read),
            regulator=_part(table, 'regulator', _air_line),
            policy=table.choice('policy', ('flat', 'dome', 'adaptive', 'oracle')),
            dome_pressure=table.value(pressure) if 'dome_pressure' in table else None,
            settle=table.number('settle', 's', 0.0, 60.0, default=1.0),
            cycles=table.integer('cycles', 1, 100000),
            accuracy=table.number('accuracy', '(relative)', 1e-4, 1.0),
            metric=table.choice('metric', ('distance', 'slip'), default='distance'),
            wanted=table.choice('wanted', ('walk', 'metric'), default='walk'),
            faults=listed(table),
        )
        table.finish()
        for fault in scene.faults:
            missing = sorted(set(fault.legs) - set(scene.legs))
            if missing:
                raise ConfigError(
                    f'{table.origin}: faults: legs = {list(fault.legs)} is not allowed: '
                    f'{robot} has no leg {missing[0]}'
                )
        return scene


def _part(table: Table, key: str, read: Callable[[Table], Any]) -> Any:
    """Read a nested table; raise `ConfigError` for keys that ``read`` does not use."""
    with table.table(key) as part:
        return read(part)


def _named(table: Table, key: str, load: Callable[[str], Any]) -> Any:
    """Load what a scene names; a path is relative to the folder of the scene's file."""
    name = table.text(key)
    if name.endswith(('.yaml', '.yml', '.urdf')):
        name = os.fspath(pathlib.Path(table.origin).parent / name)
    try:
        return load(name)
    except (ConfigError, InvalidInput) as error:
        raise ConfigError(f'{table.origin}: {key}: {error}') from error


def foot_of(table: Table) -> Foot:
    """Return the foot that a scene names; a path is relative to the folder of the scene's file."""
    foot: Foot = _named(table, 'foot', Foot.load)
    return foot


def _robot_of(table: Table) -> Robot:
    feet = table.sequence('feet') if 'feet' in table else ()
    robot: Robot = _named(table, 'robot', lambda name: Robot.load(name, feet, foot_radius=0.0))
    return robot


def _walking_gait(table: Table, robot: Robot) -> WalkingGait:
    """Read a gait; what the table does not have is as in the robot's file."""
    steps = Gait.read(table, robot.hips, robot.gait)
    gait = WalkingGait(
        cycle=steps.cycle,
        stride=table.number('stride', 'm', 1e-3, 2.0, default=_usual_stride(robot, steps)),
        duty=steps.duty,
        lift=steps.lift,
        middles=tuple((0.25 + phase) % 1.0 for phase in steps.phases),
        pushes=steps.pushes,
    )
    if gait.pushes:
        return gait
    # A walk begins in the middle of the time in which one leg has landed and none lifted off.
    start = 0.5 * (gait.duty - gait.overlap)
    middles = tuple((start + phase) % 1.0 for phase in steps.phases)
    return dataclasses.replace(gait, middles=middles)


def _usual_stride(robot: Robot, gait: Gait) -> float:
    """Return the stride, m, of a slow trot; feet of other gaits swing as fast as in it."""
    swing = 2.5 * (1.0 - gait.duty) * gait.cycle
    return round(math.sqrt(FROUDE * GRAVITY * robot.height) * swing, 4)


def _air_line(table: Table) -> dict[str, Any]:
    line = {
        'hose_diameter': table.number('hose_diameter', 'm', 5e-4, 0.02),
        'hose_length': table.number('hose_length', 'm', 0.01, 20.0),
    }
    if 'hose_conductance' in table:
        line['hose_conductance'] = table.number('hose_conductance', 'm³/(s Pa)', 1e-12, 1e-5)
    return line


def is_bench(name_or_path: str | os.PathLike[str]) -> bool:
    """Return whether a scene is a bench scene, in which no robot walks; studies compute those.

    Raises
    ------
    ConfigError
        When the scene is unknown, or its file is not a YAML mapping.
    """
    return 'bench' in Table.load(configuration.locate('scenes', name_or_path))

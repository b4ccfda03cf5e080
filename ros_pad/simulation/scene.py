# SPDX-License-Identifier: Apache-2.0
"""A scene: robot, feet, gait, floor, towed load, sensors, air lines, policy and faults."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from typing import TypeVar

from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation.faults import SENSOR_KINDS
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.faults import listed
from ros_pad.simulation.gait import TripodGait
from ros_pad.simulation.terrain import FLOORS
from ros_pad.simulation.terrain import Floor
from ros_pad.simulation.terrain import patch_lengths

T = TypeVar('T')


@dataclass(frozen=True)
class HexapodBody:
    """Masses and geometry of a hexapod.

    Attributes
    ----------
    mass : float
        Mass of the robot, kg.
    inertia : float
        Moment of inertia of the robot about the vertical axis, kg m².
    height : float
        Height of the centre of mass above the floor, m.
    homes : tuple of (float, float)
        Home positions of feet 1 to 6 in the body, fore and left, m.
    coxa, femur, tibia : float
        Lengths of a leg's links, m; those of a Lynxmotion CH3-R by default.
    leg_stiffness : float
        Vertical stiffness of a leg and its foot, N/m: load that a foot gains for each metre by
        which its ground is higher.
    """

    mass: float
    inertia: float
    height: float
    homes: tuple[tuple[float, float], ...]
    coxa: float = 0.029
    femur: float = 0.057
    tibia: float = 0.141
    leg_stiffness: float = 3000.0

    @classmethod
    def read(cls, table: Table) -> HexapodBody:
        """Read the table ``body`` of a scene."""
        corner_x = table.number('corner_fore', 'm', 0.01, 1.0)
        corner_y = table.number('corner_side', 'm', 0.01, 1.0)
        middle_y = table.number('middle_side', 'm', 0.01, 1.0)
        return cls(
            mass=table.number('mass', 'kg', 0.05, 200.0),
            inertia=table.number('inertia', 'kg m2', 1e-5, 100.0),
            height=table.number('height', 'm', 0.0, 2.0),
            # Order: left front, left middle, left rear, right rear, right middle, right front. A
            # tripod is both corners of one side and the middle leg of the other.
            homes=(
                (corner_x, corner_y),
                (0.0, middle_y),
                (-corner_x, corner_y),
                (-corner_x, -corner_y),
                (0.0, -middle_y),
                (corner_x, -corner_y),
            ),
            coxa=table.number('coxa', 'm', 1e-3, 1.0, default=cls.coxa),
            femur=table.number('femur', 'm', 1e-3, 1.0, default=cls.femur),
            tibia=table.number('tibia', 'm', 1e-3, 1.0, default=cls.tibia),
            leg_stiffness=table.number(
                'leg_stiffness', 'N/m', 1.0, 1e7, default=cls.leg_stiffness
            ),
        )


@dataclass(frozen=True)
class RailBody:
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

    mass: float
    rolling_drag: float
    load: float
    goal: float

    @classmethod
    def read(cls, table: Table) -> RailBody:
        """Read the table ``body`` of a scene."""
        return cls(
            mass=table.number('mass', 'kg', 0.01, 100.0),
            rolling_drag=table.number('rolling_drag', 'N', 0.0, 1000.0),
            load=table.number('load', 'N', 0.01, 1000.0),
            goal=table.number('goal', 'm', 0.01, 1000.0),
        )


@dataclass(frozen=True)
class RailGait:
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

    stroke: float
    stance: float
    swing: float
    lift: float

    @property
    def cycle(self) -> float:
        """Duration of a cycle, s."""
        return self.stance + self.swing

    @classmethod
    def read(cls, table: Table) -> RailGait:
        """Read the table ``gait`` of a scene."""
        return cls(
            stroke=table.number('stroke', 'm', 1e-3, 1.0),
            stance=table.number('stance', 's', 0.05, 60.0),
            swing=table.number('swing', 's', 0.05, 60.0),
            lift=table.number('lift', 'm', 1e-3, 0.2),
        )


@dataclass(frozen=True)
class Tow:
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

    weight: float = 0.0
    friction_dry: float = 0.0
    friction_wet: float = 0.0
    distance: float = 0.0
    height: float = 0.0
    stiffness: float = 2000.0

    @classmethod
    def read(cls, table: Table) -> Tow:
        """Read the table ``tow`` of a scene."""
        return cls(
            weight=table.number('weight', 'N', 0.0, 1e4),
            friction_dry=table.number('friction_dry', '(coefficient)', 0.0, 3.0),
            friction_wet=table.number('friction_wet', '(coefficient)', 0.0, 3.0),
            distance=table.number('distance', 'm', 0.0, 10.0, default=cls.distance),
            height=table.number('height', 'm', 0.0, 1.0, default=cls.height),
            stiffness=table.number('stiffness', 'N/m', 1.0, 1e7, default=cls.stiffness),
        )


@dataclass(frozen=True)
class SensorNoise:
    """Rate and white noise of the foot sensors.

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
    """

    rate: float
    force: float
    position: float
    moment: float = 0.0

    @classmethod
    def read(cls, table: Table) -> SensorNoise:
        """Read the table ``sensors`` of a scene."""
        return cls(
            rate=table.number('rate', 'Hz', 50.0, 1000.0),
            force=table.number('force_noise', 'N', 0.0, 10.0),
            position=table.number('position_noise', 'm', 0.0, 0.01),
            moment=table.number('moment_noise', 'N m', 0.0, 1.0, default=cls.moment),
        )


@dataclass(frozen=True)
class FloorPlan:
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
    film_thickness: float
    viscosity: float
    wet_fraction: float = 0.0
    patch_length: float = 0.0
    drawing: tuple[str, ...] = ()
    cell: float = 0.0
    slope: float = 0.0
    roughness: float = 0.0
    unevenness: float = 0.0

    @classmethod
    def read(cls, table: Table) -> FloorPlan:
        """Read the table ``floor`` of a scene."""
        kind = table.choice('kind', FLOORS)
        wet_fraction, patch_length = cls.wet_fraction, cls.patch_length
        drawing, cell = cls.drawing, cls.cell
        if kind == 'patches':
            wet_fraction = table.number('wet_fraction', '(share)', 0.01, 0.99)
            patch_length = table.number('patch_length', 'm', *patch_lengths(wet_fraction))
        if kind == 'drawn':
            drawing = tuple(table.text('drawing').split())
            cell = table.number('cell', 'm', 1e-3, 10.0)
            try:
                Floor.drawn(drawing, cell, 0.0)
            except InvalidInput as error:
                raise ConfigError(f'{table.origin}: {error}') from error
        return cls(
            kind=kind,
            film_thickness=table.number('film_thickness', 'm', 1e-9, 0.01, default=3e-4),
            viscosity=table.number('viscosity', 'Pa s', 1e-5, 10.0, default=WATER_VISCOSITY),
            wet_fraction=wet_fraction,
            patch_length=patch_length,
            drawing=drawing,
            cell=cell,
            slope=table.number('slope', 'rad', -0.5, 0.5, default=cls.slope),
            roughness=table.number('roughness', 'm', 0.0, 1e-3, default=cls.roughness),
            unevenness=table.number('unevenness', 'm', 0.0, 0.02, default=cls.unevenness),
        )

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
    name, description : str
        Name without folder, and the text ``description`` of the file.
    robot : str
        ``hexapod`` or ``rail_leg``.
    body : HexapodBody or RailBody
    gait : TripodGait or RailGait
    heading_gain : float
        Rate at which the gait steers back to heading zero, 1/s; 0 for a rail leg.
    foot : Foot
    floor : FloorPlan
    tow : Tow
    sensors : SensorNoise
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
        Largest relative error of the distance that the scene allows a fidelity level.
    faults : tuple of Fault
        Faults of regulators, hoses and sensors; see :mod:`ros_pad.simulation.faults`.
    """

    source: str
    name: str
    description: str
    robot: str
    body: HexapodBody | RailBody
    gait: TripodGait | RailGait
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
    faults: tuple[Fault, ...] = ()

    @property
    def duration(self) -> float:
        """Simulated time of a trial, s."""
        return self.settle + self.cycles * self.gait.cycle

    @property
    def legs(self) -> tuple[int, ...]:
        """Numbers of the robot's legs."""
        return (1, 2, 3, 4, 5, 6) if self.robot == 'hexapod' else (1,)

    @property
    def expected_load(self) -> float:
        """Normal force that a foot carries in stance on average, N."""
        if isinstance(self.body, HexapodBody):
            return self.body.mass * GRAVITY / 3.0
        return self.body.load

    @property
    def regulator_options(self) -> dict[str, Any]:
        """Options of the regulator node's backend ``simulated``: air line of all feet, and faults.

        Faults are texts, as in a ROS parameter. Faults of the sensors of feet are left out.
        """
        faults = [str(each) for each in self.faults if each.kind not in SENSOR_KINDS]
        return self.regulator | ({'faults': faults} if faults else {})

    @property
    def stride(self) -> float:
        """Distance of the body in a gait cycle without slip, m."""
        return self.gait.stride if isinstance(self.gait, TripodGait) else self.gait.stroke

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Scene:
        """Read ``config/scenes/<name>.yaml``, or the file at a path.

        Raises
        ------
        ConfigError
            When the scene is unknown, or its file has a missing or unknown key or a value that is
            not allowed.
        """
        path = configuration.locate('scenes', name_or_path)
        return cls.read(Table.load(path), os.fspath(name_or_path), path.stem)

    @classmethod
    def read(cls, table: Table, source: str, name: str) -> Scene:
        """Read a scene from a table; raise `ConfigError` as :meth:`load` does."""
        if 'bench' in table:
            raise ConfigError(
                f'{table.origin}: is a bench scene, in which no robot walks: compute it with '
                f'pad run {source}, or with studies.thesis.bench.run'
            )
        robot = table.choice('robot', ('hexapod', 'rail_leg'))
        description = table.text('description', default='')
        foot = foot_of(table)
        body: HexapodBody | RailBody
        gait: TripodGait | RailGait
        if robot == 'hexapod':
            body = _part(table, 'body', HexapodBody.read)
            gait, heading_gain = _part(table, 'gait', _tripod_gait)
        else:
            body = _part(table, 'body', RailBody.read)
            gait, heading_gain = _part(table, 'gait', RailGait.read), 0.0
        scene = cls(
            source=source,
            name=name,
            description=description,
            robot=robot,
            body=body,
            gait=gait,
            heading_gain=heading_gain,
            foot=foot,
            floor=_part(table, 'floor', FloorPlan.read),
            tow=_part(table, 'tow', Tow.read) if 'tow' in table else Tow(),
            sensors=_part(table, 'sensors', SensorNoise.read),
            regulator=_part(table, 'regulator', _air_line),
            policy=table.choice('policy', ('flat', 'dome', 'adaptive', 'oracle')),
            dome_pressure=(
                table.number('dome_pressure', 'Pa', 1000.0, foot.ceiling)
                if 'dome_pressure' in table
                else None
            ),
            settle=table.number('settle', 's', 0.0, 60.0, default=1.0),
            cycles=table.integer('cycles', 1, 100000),
            accuracy=table.number('accuracy', '(relative)', 1e-4, 1.0),
            faults=listed(table),
        )
        table.finish()
        for fault in scene.faults:
            missing = sorted(set(fault.legs) - set(scene.legs))
            if missing:
                raise ConfigError(
                    f'{table.origin}: faults: legs = {list(fault.legs)} is not allowed: '
                    f'a {robot} has no leg {missing[0]}'
                )
        return scene


def _part(table: Table, key: str, read: Callable[[Table], T]) -> T:
    """Read a nested table; raise `ConfigError` for keys that ``read`` does not use."""
    with table.table(key) as part:
        return read(part)


def foot_of(table: Table) -> Foot:
    """Return the foot that a scene names; a path is relative to the folder of the scene's file."""
    foot_name = table.text('foot')
    if foot_name.endswith(('.yaml', '.yml')):
        foot_name = os.fspath(pathlib.Path(table.origin).parent / foot_name)
    try:
        return Foot.load(foot_name)
    except ConfigError as error:
        raise ConfigError(f'{table.origin}: foot: {error}') from error


def _tripod_gait(table: Table) -> tuple[TripodGait, float]:
    """Read the gait of a hexapod, and the rate at which it steers back to heading zero, 1/s."""
    gait = TripodGait(
        cycle=table.number('cycle', 's', 0.1, 60.0),
        stride=table.number('stride', 'm', 1e-3, 1.0),
        duty=table.number('duty', '(share)', 0.51, 0.9),
        lift=table.number('lift', 'm', 1e-3, 0.2),
    )
    return gait, table.number('heading_gain', '1/s', 0.0, 10.0, default=0.0)


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

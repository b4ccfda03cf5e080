# SPDX-License-Identifier: Apache-2.0
"""A scene: robot, feet, floor, what makes grip matter, gait, and how well it must be known."""

from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True)
class HexapodBody:
    """Mass and stance of a hexapod.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        About the vertical axis, kg m².
    height : float
        Of the centre of mass above the floor, m.
    homes : tuple of (float, float)
        Where feet 1 to 6 stand in the body, fore and left, m.
    coxa, femur, tibia : float
        Lengths of a leg's links, m; for a robot with joints. Lynxmotion CH3-R unless told.
    leg_stiffness : float
        Of a leg and its foot, vertical, N/m: how much more a foot carries on higher ground.
    """

    mass: float
    inertia: float
    height: float
    homes: tuple[tuple[float, float], ...]
    coxa: float = 0.029
    femur: float = 0.057
    tibia: float = 0.141
    leg_stiffness: float = 3000.0


@dataclass(frozen=True)
class RailBody:
    """The thesis' walking mechanism on a rail (5.2): a body on wheels pushed by one foot.

    Attributes
    ----------
    mass : float
        kg.
    rolling_drag : float
        Force that the wheels need to roll, N.
    load : float
        With which springs press the foot to the floor, N.
    goal : float
        Way to the end of the rail, m.
    """

    mass: float
    rolling_drag: float
    load: float
    goal: float


@dataclass(frozen=True)
class RailGait:
    """The foot's stroke on the rail.

    Attributes
    ----------
    stroke : float
        Way of the foot under the body in stance, m.
    stance, swing : float
        Durations, s.
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


@dataclass(frozen=True)
class Tow:
    """A load dragged over the same floor: what makes grip matter on level ground.

    Attributes
    ----------
    weight : float
        N; zero for none.
    friction_dry, friction_wet : float
        Of the load on dry and on wet ground.
    distance : float
        Behind the centre of the body, m.
    height : float
        Of the line above the floor where it pulls at the body, m.
    stiffness : float
        Of the line, N/m.
    """

    weight: float = 0.0
    friction_dry: float = 0.0
    friction_wet: float = 0.0
    distance: float = 0.0
    height: float = 0.0
    stiffness: float = 2000.0


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
        Standard deviation of the moment about the vertical, N m; 0 where none is measured, as by
        sensors of three axes.
    """

    rate: float
    force: float
    position: float
    moment: float = 0.0


@dataclass(frozen=True)
class FloorPlan:
    """What the floor is made of; :meth:`build` makes it for a seed.

    Attributes
    ----------
    kind : str
        ``dry``, ``wet``, ``patches`` or ``drawn``.
    film_thickness : float
        Depth of the liquid where it is wet, m.
    viscosity : float
        Of the liquid, Pa s.
    wet_fraction, patch_length : float
        Share of wet floor, and mean length of a wet patch, m; patches only.
    drawing : tuple of str
        Rows of ``#`` (wet) and ``.`` (dry), see :meth:`Floor.drawn`; drawn only.
    cell : float
        Edge of what a character of the drawing covers, m; drawn only.
    slope : float
        Rise of the floor along +x, rad.
    roughness : float
        Root mean square height of the floor's texture under a foot, m, see
        :meth:`ros_pad.contact.Foot.on_rough`.
    unevenness : float
        Root mean square of the heights on which feet stand, m, see :meth:`Floor.uneven`.
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
    """Everything that a trial needs but policy and seed. See ``config/scenes/*.yaml``.

    Attributes
    ----------
    source : str
        Name of the shipped scene, or path of the file, that describes it.
    name, description : str
        Name without folder, and what it says of itself.
    robot : str
        ``hexapod`` or ``rail_leg``.
    body : HexapodBody or RailBody
    gait : TripodGait or RailGait
    heading_gain : float
        How fast the gait steers back to heading zero, 1/s.
    foot : Foot
    floor : FloorPlan
    tow : Tow
    sensors : SensorNoise
    regulator : dict
        Line of every foot: options of the simulated regulator.
    policy : str
        Policy that the scene is made for.
    dome_pressure : float or None
        Fixed gauge pressure of a dome, Pa; None chooses it from the load.
    settle : float
        Time that the robot stands before it walks, s, for the pads to fill.
    cycles : int
        Gait cycles of a trial.
    accuracy : float
        Relative error of the distance that the scene tolerates.
    faults : tuple of Fault
        What regulators, hoses and sensors suffer, and when; see :mod:`ros_pad.simulation.faults`.
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
        """What the regulator node's backend ``simulated`` is told: line of all feet, and faults.

        Faults are texts, as a parameter of ROS has them, without those of sensors.
        """
        faults = [str(each) for each in self.faults if each.kind not in SENSOR_KINDS]
        return self.regulator | ({'faults': faults} if faults else {})

    @property
    def stride(self) -> float:
        """Advance of the body in a cycle without slip, m."""
        return self.gait.stride if isinstance(self.gait, TripodGait) else self.gait.stroke

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Scene:
        """Read ``config/scenes/<name>.yaml`` or a file of one's own.

        Raises
        ------
        ConfigError
            Unknown scene (lists them, with the nearest name), or a file with an unknown key or a
            value outside its range (names file, key, value and range).
        """
        path = configuration.locate('scenes', name_or_path)
        return cls.read(Table.load(path), os.fspath(name_or_path), path.stem)

    @classmethod
    def read(cls, table: Table, source: str, name: str) -> Scene:
        """Read a scene from a table; the whole table must be used up."""
        if 'bench' in table:
            raise ConfigError(
                f'{table.origin}: is a bench, on which no robot walks: '
                f'pad run {source}, or ros_pad.trials.bench.run'
            )
        robot = table.choice('robot', ('hexapod', 'rail_leg'))
        description = table.text('description', default='')
        foot = foot_of(table)
        body: HexapodBody | RailBody
        gait: TripodGait | RailGait
        heading_gain = 0.0
        if robot == 'hexapod':
            with table.table('body') as part:
                body = _hexapod_body(part)
            with table.table('gait') as part:
                gait = TripodGait(
                    cycle=part.number('cycle', 's', 0.1, 60.0),
                    stride=part.number('stride', 'm', 1e-3, 1.0),
                    duty=part.number('duty', '(share)', 0.51, 0.9),
                    lift=part.number('lift', 'm', 1e-3, 0.2),
                )
                heading_gain = part.number('heading_gain', '1/s', 0.0, 10.0, default=0.0)
        else:
            with table.table('body') as part:
                body = RailBody(
                    mass=part.number('mass', 'kg', 0.01, 100.0),
                    rolling_drag=part.number('rolling_drag', 'N', 0.0, 1000.0),
                    load=part.number('load', 'N', 0.01, 1000.0),
                    goal=part.number('goal', 'm', 0.01, 1000.0),
                )
            with table.table('gait') as part:
                gait = RailGait(
                    stroke=part.number('stroke', 'm', 1e-3, 1.0),
                    stance=part.number('stance', 's', 0.05, 60.0),
                    swing=part.number('swing', 's', 0.05, 60.0),
                    lift=part.number('lift', 'm', 1e-3, 0.2),
                )
        with table.table('floor') as part:
            floor = _floor_plan(part)
        tow = Tow()
        if 'tow' in table:
            with table.table('tow') as part:
                tow = Tow(
                    weight=part.number('weight', 'N', 0.0, 1e4),
                    friction_dry=part.number('friction_dry', '(coefficient)', 0.0, 3.0),
                    friction_wet=part.number('friction_wet', '(coefficient)', 0.0, 3.0),
                    distance=part.number('distance', 'm', 0.0, 10.0, default=0.0),
                    height=part.number('height', 'm', 0.0, 1.0, default=0.0),
                    stiffness=part.number('stiffness', 'N/m', 1.0, 1e7, default=2000.0),
                )
        with table.table('sensors') as part:
            sensors = SensorNoise(
                rate=part.number('rate', 'Hz', 50.0, 1000.0),
                force=part.number('force_noise', 'N', 0.0, 10.0),
                position=part.number('position_noise', 'm', 0.0, 0.01),
                moment=part.number('moment_noise', 'N m', 0.0, 1.0, default=0.0),
            )
        with table.table('regulator') as part:
            regulator = {
                'hose_diameter': part.number('hose_diameter', 'm', 5e-4, 0.02),
                'hose_length': part.number('hose_length', 'm', 0.01, 20.0),
            }
            if 'hose_conductance' in part:
                regulator['hose_conductance'] = part.number(
                    'hose_conductance', 'm³/(s Pa)', 1e-12, 1e-5
                )
        policy = table.choice('policy', ('flat', 'dome', 'adaptive', 'oracle'))
        pressure = None
        if 'dome_pressure' in table:
            pressure = table.number('dome_pressure', 'Pa', 1000.0, foot.ceiling)
        scene = cls(
            source=source,
            name=name,
            description=description,
            robot=robot,
            body=body,
            gait=gait,
            heading_gain=heading_gain,
            foot=foot,
            floor=floor,
            tow=tow,
            sensors=sensors,
            regulator=regulator,
            policy=policy,
            dome_pressure=pressure,
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


def foot_of(table: Table) -> Foot:
    """Return the foot that a scene names; a file of one's own lies beside the scene."""
    foot_name = table.text('foot')
    if foot_name.endswith(('.yaml', '.yml')):
        foot_name = os.fspath(pathlib.Path(table.origin).parent / foot_name)
    try:
        return Foot.load(foot_name)
    except ConfigError as error:
        raise ConfigError(f'{table.origin}: foot: {error}') from error


def _hexapod_body(part: Table) -> HexapodBody:
    corner_x = part.number('corner_fore', 'm', 0.01, 1.0)
    corner_y = part.number('corner_side', 'm', 0.01, 1.0)
    middle_y = part.number('middle_side', 'm', 0.01, 1.0)
    return HexapodBody(
        mass=part.number('mass', 'kg', 0.05, 200.0),
        inertia=part.number('inertia', 'kg m2', 1e-5, 100.0),
        height=part.number('height', 'm', 0.0, 2.0),
        # Left front, middle, rear, then right rear, middle, front: 2 and 5 are the middle legs,
        # and each tripod has one side's corners and the other side's middle.
        homes=(
            (corner_x, corner_y),
            (0.0, middle_y),
            (-corner_x, corner_y),
            (-corner_x, -corner_y),
            (0.0, -middle_y),
            (corner_x, -corner_y),
        ),
        coxa=part.number('coxa', 'm', 1e-3, 1.0, default=0.029),
        femur=part.number('femur', 'm', 1e-3, 1.0, default=0.057),
        tibia=part.number('tibia', 'm', 1e-3, 1.0, default=0.141),
        leg_stiffness=part.number('leg_stiffness', 'N/m', 1.0, 1e7, default=3000.0),
    )


def _floor_plan(part: Table) -> FloorPlan:
    kind = part.choice('kind', FLOORS)
    wet_fraction = patch_length = cell = 0.0
    drawing: tuple[str, ...] = ()
    if kind == 'patches':
        wet_fraction = part.number('wet_fraction', '(share)', 0.01, 0.99)
        patch_length = part.number('patch_length', 'm', *patch_lengths(wet_fraction))
    if kind == 'drawn':
        drawing = tuple(part.text('drawing').split())
        cell = part.number('cell', 'm', 1e-3, 10.0)
        try:
            Floor.drawn(drawing, cell, 0.0)
        except InvalidInput as error:
            raise ConfigError(f'{part.origin}: {error}') from error
    return FloorPlan(
        kind=kind,
        film_thickness=part.number('film_thickness', 'm', 1e-9, 0.01, default=3e-4),
        viscosity=part.number('viscosity', 'Pa s', 1e-5, 10.0, default=WATER_VISCOSITY),
        wet_fraction=wet_fraction,
        patch_length=patch_length,
        drawing=drawing,
        cell=cell,
        slope=part.number('slope', 'rad', -0.5, 0.5, default=0.0),
        roughness=part.number('roughness', 'm', 0.0, 1e-3, default=0.0),
        unevenness=part.number('unevenness', 'm', 0.0, 0.02, default=0.0),
    )

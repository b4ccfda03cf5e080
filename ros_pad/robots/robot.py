# SPDX-License-Identifier: Apache-2.0
"""A robot with three to eight legs, from a shipped name, a YAML file or a URDF file."""

from __future__ import annotations

import math
import os
import pathlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad import configuration
from ros_pad.configuration import Table, number, quantity, text
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import urdf
from ros_pad.robots.chains import Chains, Joint, Kinematics
from ros_pad.robots.gait import Gait
from ros_pad.robots.posture import crouch, usual_gait
from ros_pad.robots.rotation import Array, from_rpy, transform

# Fewest and most legs of a robot.
LEGS = (3, 8)

# Longest leg, and largest distance of a place on a link from its joint, m.
LONGEST = 5.0

# Largest mass of a robot, kg.
HEAVIEST = 2000.0

_METRES, _KILOGRAMS = 'm (not mm)', 'kg (not g)'  # of a file in other units, values are refused
_ORIGIN = (0.0, 0.0, 0.0)
_MOTOR = (
    ('torque', 'N m', 1e-3, 1e5),
    ('speed', 'rad/s', 0.1, 1e3),
    ('rotor_inertia', 'kg m2', 1e-6, 1e3),
)


@dataclass(frozen=True)
class Servo:
    """A position servo, the same in all joints: a spring to its set-point.

    Attributes
    ----------
    stiffness : float
        Torque for each angle to the set-point, N m/rad.
    damping : float
        Torque against the speed of the joint, N m s/rad.
    travel : float
        Largest angle to either side of home, rad.
    """

    stiffness: float
    damping: float
    travel: float

    @classmethod
    def read(cls, table: Table) -> Servo:
        """Read the table ``servo`` of a robot's file."""
        return cls(
            stiffness=table.number('stiffness', 'N m/rad', 1e-2, 1e6),
            damping=table.number('damping', 'N m s/rad', 0.0, 1e5),
            travel=table.number('travel', 'rad', 0.01, 10.0, default=math.pi),
        )


@dataclass(frozen=True)
class Robot:
    """Legs, kinematics and masses of a robot.

    Axes of the base: x fore, y left, z up. Joint positions ``q`` are in the order of
    ``joint_names``, rad (m for a joint that slides), of shape (joints,) or (legs, joints a leg).

    Attributes
    ----------
    name : str
    source : str
        Name of a shipped robot, or absolute path of its file.
    legs : tuple of str or int
        Name or number of each leg.
    joint_names : tuple of str
        Names of all joints, leg by leg, from the base to the foot.
    mass : float
        Mass of the robot, kg.
    foot_radius : float
        Radius with which a foot rolls over the ground, m; 0 for a point or a sole on an ankle.
    imu : array (4, 4)
        Transform from the IMU to the base, m.
    chains : Chains
        Kinematics of the legs.
    home : array (legs, joints a leg)
        Joint positions in which the robot stands, rad.
    gait : Gait
        Its usual gait.
    servo : Servo or None
        Its position servos; None if its joints take torques.
    centre : array (2,)
        Centre of mass at home, fore and left in the base, m.
    height : float
        Height of the centre of mass above the feet at home, m.
    inertia : float
        Moment of inertia of the whole robot about the vertical axis at home, kg m².
    leg_stiffness : float
        Vertical stiffness of a leg and its foot, N/m: load that a foot gains for each metre by
        which its ground is higher.
    """

    name: str
    source: str
    legs: tuple[str | int, ...]
    joint_names: tuple[str, ...]
    mass: float
    chains: Chains
    home: Array
    centre: Array
    height: float
    inertia: float
    leg_stiffness: float
    gait: Gait
    foot_radius: float = 0.0
    imu: Array = field(default_factory=lambda: np.eye(4))
    servo: Servo | None = None

    @classmethod
    def load(
        cls,
        source: str | os.PathLike[str],
        feet: Sequence[str] = (),
        imu: str = '',
        foot_radius: float | None = None,
    ) -> Robot:
        """Read ``config/robots/<name>.yaml``, another YAML file, or a URDF file.

        Parameters
        ----------
        source : str or path
            Name of a shipped robot, or path of a file that ends in .yaml, .yml or .urdf.
        feet : sequence of str
            For URDF: the links at the ends of the legs; their order is that of the legs.
        imu : str
            For URDF: the link of the IMU, which must be fixed to the base; the base if empty.
        foot_radius : float, optional
            Radius with which the feet roll, m, 0 to 1; of a YAML file, it replaces the file's.

        Returns
        -------
        Robot
            The robot.

        Raises
        ------
        ConfigError
            When there is no such robot, or its file is not valid.
        InvalidInput
            When an argument is not allowed.

        Examples
        --------
        >>> from ros_pad.robots import Robot
        >>> robot = Robot.load('go2')
        >>> robot.legs, len(robot.joint_names), round(robot.mass, 2)  # kg
        (('FL', 'FR', 'RL', 'RR'), 12, 15.02)
        >>> feet = robot.foot_positions(robot.home)
        >>> bool(abs(robot.joint_positions(feet) - robot.home).max() < 1e-6)
        True
        """
        path = os.fspath(source)
        if foot_radius is not None:
            number('foot_radius', foot_radius, 'm', 0.0, 1.0)
        if path.endswith('.urdf'):
            return _from_urdf(path, feet, imu)._loaded(path, foot_radius)
        if feet or imu:
            raise InvalidInput('feet and imu are for files that end in .urdf; YAML has its own')
        found = configuration.locate('robots', path)
        return _from_table(Table.load(found), found)._loaded(path, foot_radius)

    def _loaded(self, path: str, foot_radius: float | None) -> Robot:
        source = os.path.abspath(path) if os.path.exists(path) else path
        radius = self.foot_radius if foot_radius is None else foot_radius
        robot = replace(self, source=source, foot_radius=radius)
        try:
            _check_sizes(robot)
        except InvalidInput as error:
            raise ConfigError(f'{path}: {error}') from error
        return robot

    @property
    def hips(self) -> Array:
        """Places of the first joints on the base, (legs, 3), m."""
        return np.array([leg[0].at[:3, 3] for leg in self.chains.legs])

    def kinematics(self, q: npt.ArrayLike) -> Kinematics:
        """Return positions, rotations and Jacobians of all feet in the axes of the base.

        Parameters
        ----------
        q : array (joints,) or (legs, joints a leg)
            Joint positions, rad (m where a joint slides).

        Returns
        -------
        Kinematics
            Positions, m, rotations and Jacobians.

        Raises
        ------
        InvalidInput
            When ``q`` has another shape or values that are not finite.
        """
        return self.chains.solve(self._shaped(q))

    def foot_positions(self, q: npt.ArrayLike) -> Array:
        """Return the places of the feet in the axes of the base.

        Parameters
        ----------
        q : array (joints,) or (legs, joints a leg)
            Joint positions, rad (m where a joint slides).

        Returns
        -------
        array (legs, 3)
            Places, m.

        Raises
        ------
        InvalidInput
            When ``q`` has another shape or values that are not finite.
        """
        return self.kinematics(q).positions

    def joint_positions(self, feet: npt.ArrayLike, near: npt.ArrayLike | None = None) -> Array:
        """Return joint positions that bring the feet to places.

        Parameters
        ----------
        feet : array (legs, 3)
            Places of the feet in the axes of the base, m.
        near : array (legs, joints a leg), optional
            Joint positions from which the search begins, rad; :attr:`home` by default.

        Returns
        -------
        array (legs, joints a leg)
            Joint positions, rad (m where a joint slides).

        Raises
        ------
        InvalidInput
            When a foot does not reach its place, or an argument has another shape or values that
            are not finite.

        Notes
        -----
        Newton's method with damped least squares.
        """
        goal = quantity('feet', feet, 'm', -100.0, 100.0)
        if goal.shape != (shape := (len(self.legs), 3)):
            raise InvalidInput(f'feet of shape {goal.shape} is not allowed: {shape} is needed')
        q = self._shaped(self.home if near is None else near).copy()
        for _ in range(50):
            found = self.chains.solve(q)
            miss = goal - found.positions
            if np.abs(miss).max() < 1e-9:
                return q
            lines = found.jacobians
            square = lines @ lines.transpose(0, 2, 1) + 1e-7 * np.eye(3)
            step = lines.transpose(0, 2, 1) @ np.linalg.solve(square, miss[..., None])
            q += np.clip(step[..., 0], -0.5, 0.5)
        leg = self.legs[int(np.abs(miss).max(1).argmax())]
        place = goal[self.legs.index(leg)].round(4).tolist()
        raise InvalidInput(
            f'leg {leg} does not reach x, y, z = {place} m in the base: a place nearer to its home'
            ' is needed'
        )

    def _shaped(self, q: npt.ArrayLike) -> Array:
        checked = quantity('q', q, 'rad', -1e4, 1e4)
        if checked.size != self.home.size:
            raise InvalidInput(
                f'q of shape {checked.shape} is not allowed: {self.home.size} joint positions are'
                ' needed'
            )
        return checked.reshape(self.home.shape)


def _check_sizes(robot: Robot) -> None:
    """Raise `InvalidInput` for a mass or lengths that no legged robot has."""
    number('mass', robot.mass, _KILOGRAMS, 0.0, HEAVIEST)
    places = robot.kinematics(robot.home)
    starts = places.frames[..., :3, 3]
    ends = np.concatenate([starts[1:], places.positions[None]])
    lengths = np.linalg.norm(ends - starts, axis=2).sum(0).round(6).tolist()
    away = np.linalg.norm(robot.hips, axis=1).round(6).tolist()
    for leg, joints, length, hip in zip(robot.legs, robot.chains.legs, lengths, away, strict=True):
        number(f'leg {leg}: distance of the hip from the base', hip, _METRES, 0.0, LONGEST)
        slides = any(joint.slides for joint in joints)
        number(f'leg {leg}: length', length, _METRES, 0.0 if slides else 5e-3, LONGEST)
        if not slides:
            number('foot_radius', robot.foot_radius, _METRES, 0.0, length)


class _Trunk(NamedTuple):
    """The part of a robot that is not legs: mass, kg, its centre, m, and yaw inertia, kg m²."""

    mass: float
    centre: Array
    inertia: float


def _assembled(
    name: str,
    legs: Sequence[str | int],
    joints: Sequence[Sequence[Joint]],
    feet: Array,
    trunk: _Trunk,
    home: Array,
    **given: Any,
) -> Robot:
    """Return a robot with the centre of mass and the inertia that follow from its links."""
    chains = Chains(joints, feet)
    places = chains.solve(home)
    ends = np.concatenate([places.frames[1:, :, :3, 3], places.positions[None]])
    masses, centres, yaw = [trunk.mass], [trunk.centre], trunk.inertia
    for row, frames, after in zip(zip(*joints, strict=True), places.frames, ends, strict=True):
        for joint, frame, end in zip(row, frames, after, strict=True):
            masses.append(joint.mass)
            centres.append((frame @ np.append(joint.centre, 1.0))[:3])
            rod = end[:2] - frame[:2, 3]  # as seen from above
            yaw += joint.mass * float(rod @ rod) / 12.0
    weights, points = np.array(masses), np.array(centres)
    mass = float(weights.sum())
    centre = weights @ points / max(mass, 1e-9)
    away = points[:, :2] - centre[:2]
    height = float(centre[2] - places.positions[:, 2].min())
    hips = np.array([leg[0].at[:3, 3] for leg in joints])
    whole: dict[str, Any] = {
        'mass': mass,
        'centre': centre[:2].round(12),
        'height': height,
        'gait': usual_gait(hips, height),
        'inertia': yaw + float(weights @ (away * away).sum(1)),
        'leg_stiffness': mass * 9.81 / 7e-3,  # it sinks by 7 mm if one leg carries all of it
    }
    names = tuple(joint.name for leg in joints for joint in leg)
    return Robot(name, name, tuple(legs), names, chains=chains, home=home, **(whole | given))


def _from_urdf(path: str, feet: Sequence[str], imu: str, **others: Any) -> Robot:
    """Read a robot from a URDF file."""
    names = [text('feet', foot) for foot in feet]
    if not LEGS[0] <= len(set(names)) == len(names) <= LEGS[1]:
        raise InvalidInput(f'feet = {names} is not allowed: 3 to 8 different links are needed')
    file, joints, tips = urdf.read(path, names)
    wanted = others.pop('home', {})
    home = _posture(joints, wanted, path) if wanted else crouch(joints, tips)
    pose = file.pose(imu) if imu else np.eye(4)
    centre, yaw = file.trunk()
    ((common, count),) = Counter(joint.name for leg in joints for joint in leg).most_common(1)
    if count > 1:
        raise ConfigError(
            f'{path}: joint {common!r} is in two legs: each leg needs joints of its own, with'
            ' different names'
        )
    rest = file.mass - sum(joint.mass for leg in joints for joint in leg)
    trunk = _Trunk(rest, centre, yaw or _plate(rest, joints))
    return _assembled(file.name, names, joints, tips, trunk, home, imu=pose, **others)


def _posture(joints: Sequence[Sequence[Joint]], wanted: Mapping[Any, Any], origin: str) -> Array:
    """Return joint positions by the ends of the joints' names, (legs, joints), others zero."""
    home = np.zeros((len(joints), len(joints[0])))
    unused = dict.fromkeys(wanted)
    for row, leg in zip(home, joints, strict=True):
        for place, joint in enumerate(leg):
            # The longest name that fits: that of one joint goes before that of its kind.
            for key in sorted((k for k in wanted if joint.name.endswith(str(k))), key=len)[-1:]:
                unused.pop(key, None)
                limits = max(-10.0, joint.limits[0]), min(10.0, joint.limits[1])
                unit = 'm' if joint.slides else 'rad'
                row[place] = number(f'home: {key} ({joint.name})', wanted[key], unit, *limits)
    if unused:
        names = ', '.join(joint.name for leg in joints for joint in leg)
        wrong = next(iter(unused))
        raise ConfigError(f'{origin}: home: no joint ends in {wrong!r}; there are: {names}')
    return home


def _from_table(table: Table, path: pathlib.Path) -> Robot:
    """Read a robot from the table of its YAML file."""
    table.text('description', default='')
    others: dict[str, Any] = {'foot_radius': table.number('foot_radius', 'm', 0.0, 1.0, 0.0)}
    for key, unit, low, high in (
        ('height', _METRES, 0.0, LONGEST),
        ('inertia', 'kg m2', 1e-6, 1e4),
        ('leg_stiffness', 'N/m', 1.0, 1e8),
    ):
        if key in table:
            others[key] = table.number(key, unit, low, high)
    motor: dict[str, Any] = {}
    if 'servo' in table:
        with table.table('servo') as part:
            for key, unit, low, high in _MOTOR:
                if key in part or ('stiffness' in part and key != 'speed'):
                    motor[key] = part.number(key, unit, low, high)
            if 'stiffness' in part:
                others['servo'] = Servo.read(part)
    robot = _of_file(table, path, others) if 'urdf' in table else _of_links(table, path, others)
    if motor:
        joints = [[replace(joint, **motor) for joint in leg] for leg in robot.chains.legs]
        robot = replace(robot, chains=Chains(joints, robot.chains.feet))
    sliding = [joint.name for leg in robot.chains.legs for joint in leg if joint.slides]
    if motor and sliding:
        raise ConfigError(
            f'{table.origin}: servo is not allowed: its units are those of joints that turn, and'
            f' {sliding[0]} slides: take servo out; L2 does not simulate such a robot'
        )
    if 'gait' in table:
        with table.table('gait') as part:
            robot = replace(robot, gait=Gait.read(part, robot.hips))
    table.finish()
    return robot


def _of_file(table: Table, path: pathlib.Path, others: dict[str, Any]) -> Robot:
    """Return the robot of the URDF file that a YAML file names."""
    feet = table.sequence('feet')
    with table.table('home', default={}) as part:
        others['home'] = {key: part.number(key, 'rad or m') for key in part.keys}
    file = path.parent / table.text('urdf')
    try:
        robot = _from_urdf(os.fspath(file), feet, table.text('imu', default=''), **others)
    except InvalidInput as error:
        raise ConfigError(f'{table.origin}: {error}') from error
    return replace(robot, name=path.stem)


def _of_links(table: Table, path: pathlib.Path, others: dict[str, Any]) -> Robot:
    """Return the robot whose links a YAML file has."""
    with table.table('imu', default={}) as part:
        others['imu'] = _pose(part)
    mass = table.number('mass', _KILOGRAMS, 1e-3, HEAVIEST)
    prefix = table.text('prefix', default='')
    links, posture = _links(table)
    foot = _place(table, 'foot')
    legs, joints, feet = [], [], []
    with table.table('legs') as part:
        if not LEGS[0] <= len(part.keys) <= LEGS[1]:
            raise ConfigError(f'{part.origin}: 3 to 8 legs are needed, found {len(part.keys)}')
        for leg in part.keys:
            hip, mirror = _hip(part, leg)
            joints.append(_leg(f'{prefix}{leg}_', links, hip, mirror))
            feet.append(transform(foot * mirror, np.eye(3)))
            legs.append(leg)
    carried = sum(joint.mass for leg in joints for joint in leg)
    if carried > mass:
        raise ConfigError(
            f'{table.origin}: mass = {mass:g} kg is not allowed: at least {carried:g} kg is'
            ' needed, the mass of the links of the legs'
        )
    home = np.array([posture] * len(legs))
    trunk = _trunk(table, mass - carried, joints)
    return _assembled(path.stem, legs, joints, np.array(feet), trunk, home, mass=mass, **others)


def _plate(mass: float, joints: Sequence[Sequence[Joint]]) -> float:
    """Return the yaw inertia, kg m², of a plate of a mass, kg, between the hips."""
    span = np.ptp(np.array([leg[0].at[:2, 3] for leg in joints]), axis=0)
    return mass * float(span @ span) / 12.0


def _trunk(table: Table, mass: float, joints: Sequence[Sequence[Joint]]) -> _Trunk:
    """Read the table ``trunk``; its inertia is that of a plate between the hips by default."""
    with table.table('trunk', default={}) as part:
        return _Trunk(
            mass,
            _place(part, 'centre', _ORIGIN),
            part.number('inertia', 'kg m2', 0.0, 1e4, default=_plate(mass, joints)),
        )


def _place(table: Table, key: str, default: tuple[float, ...] | None = None) -> Array:
    """Read a place, (3,), m, no farther off than any on a legged robot."""
    given = {} if default is None else {'default': default}
    return table.vector(key, _METRES, 3, -LONGEST, LONGEST, **given)


def _pose(table: Table) -> Array:
    """Read ``at`` and ``rpy``: a transform, (4, 4), m."""
    turn = from_rpy(table.vector('rpy', 'rad', default=(0.0, 0.0, 0.0)))
    return transform(_place(table, 'at', _ORIGIN), turn)


def _links(table: Table) -> tuple[list[Joint], list[float]]:
    """Read the table ``joints``, from the base to the foot, of a leg on the left; and its home."""
    links, home = [], []
    with table.table('joints') as part:
        for name in part.keys:
            with part.table(name) as row:
                axis = row.vector('axis', '', low=-1.0, high=1.0)
                if not (length := float(np.linalg.norm(axis))) > 0.1:
                    raise ConfigError(f'{row.origin}: axis = {axis.tolist()} has no direction')
                joint = Joint(
                    str(name),
                    _pose(row),
                    axis / length,
                    row.choice('kind', ('revolute', 'prismatic'), 'revolute') == 'prismatic',
                    row.number('mass', _KILOGRAMS, 0.0, HEAVIEST, default=0.0),
                    _place(row, 'centre', _ORIGIN),
                )
                unit, most = (_METRES, LONGEST) if joint.slides else ('rad', 10.0)
                links.append(joint)
                home.append(row.number('home', unit, -most, most, default=0.0))
    if not links:
        raise ConfigError(f'{table.origin}: joints: at least one is needed')
    return links, home


def _hip(table: Table, leg: str | int) -> tuple[Array, Array]:
    """Read where a leg sits, and by what the places along it are multiplied to mirror them."""
    with table.table(leg) as row:  # type: ignore[arg-type]  # YAML has numbers as keys, too
        bearing = row.number('bearing', 'rad', -7.0, 7.0, default=0.0)
        hip = transform(_place(row, 'at'), from_rpy((0.0, 0.0, bearing)))
        side = row.choice('side', ('left', 'right'), default='left')
        return hip, np.array((1.0, -1.0 if side == 'right' else 1.0, 1.0))


def _leg(prefix: str, links: Sequence[Joint], hip: Array, mirror: Array) -> list[Joint]:
    """Return the joints of a leg at a hip; only places are mirrored, never axes."""
    made = []
    at = hip
    for joint in links:
        place = transform(joint.at[:3, 3] * mirror, joint.at[:3, :3])
        centre = joint.centre * mirror
        made.append(replace(joint, name=prefix + joint.name, at=at @ place, centre=centre))
        at = np.eye(4)
    return made

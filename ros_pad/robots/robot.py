# SPDX-License-Identifier: Apache-2.0
"""A robot with three to eight legs, from a shipped name, a YAML file or a URDF file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.configuration import number
from ros_pad.configuration import quantity
from ros_pad.configuration import text
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.robots import urdf
from ros_pad.robots.chains import Chains
from ros_pad.robots.chains import Joint
from ros_pad.robots.chains import Kinematics
from ros_pad.robots.gait import GAITS
from ros_pad.robots.gait import Gait
from ros_pad.robots.rotation import Array
from ros_pad.robots.rotation import from_rpy
from ros_pad.robots.rotation import transform

LEGS = (3, 8)
"""Fewest and most legs of a robot."""

_DOWN = np.array((0.0, 0.0, -9.81))
_MIRROR = np.array((1.0, -1.0, 1.0))


@dataclass(frozen=True)
class Robot:
    """Legs, kinematics and masses of a robot.

    Axes of the base: x fore, y left, z up. Joint positions ``q`` are in the order of
    ``joint_names``, rad (m for a joint that slides), of shape (joints,) or (legs, joints a leg).

    Attributes
    ----------
    name : str
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
    hips : array (legs, 3)
        Places of the first joints on the base, m.
    home : array (legs, joints a leg)
        Joint positions in which the robot stands, rad.
    gait : Gait or None
        Its usual gait; None from URDF.
    """

    name: str
    legs: tuple[str | int, ...]
    joint_names: tuple[str, ...]
    mass: float
    foot_radius: float
    imu: Array
    chains: Chains
    hips: Array
    home: Array
    gait: Gait | None = None

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

        Raises
        ------
        ConfigError
            When there is no such robot, or its file is not valid.
        InvalidInput
            When an argument is not allowed.
        """
        path = os.fspath(source)
        if foot_radius is not None:
            number('foot_radius', foot_radius, 'm', 0.0, 1.0)
        if not path.endswith('.urdf'):
            if feet or imu:
                raise InvalidInput('feet and imu are for URDF files; a YAML file has its own')
            found = configuration.locate('robots', path)
            return _from_table(Table.load(found), found.stem, foot_radius)
        names = [text('feet', foot) for foot in feet]
        if not LEGS[0] <= len(set(names)) == len(names) <= LEGS[1]:
            raise InvalidInput(f'feet = {names} is not allowed: 3 to 8 different links are needed')
        file, joints, tips = urdf.read(path, names)
        pose = file.pose(imu) if imu else np.eye(4)
        return _assembled(
            file.name, tuple(names), joints, tips, file.mass, foot_radius or 0.0, pose
        )

    def kinematics(self, q: npt.ArrayLike) -> Kinematics:
        """Return positions, rotations and Jacobians of all feet in the axes of the base.

        Raises
        ------
        InvalidInput
            When ``q`` has another shape or values that are not finite.
        """
        return self.chains.solve(self._shaped(q))

    def foot_positions(self, q: npt.ArrayLike) -> Array:
        """Return the places of the feet, (legs, 3), m, in the axes of the base."""
        return self.kinematics(q).positions

    def foot_rotations(self, q: npt.ArrayLike) -> Array:
        """Return the rotations from the links of the feet to the base, (legs, 3, 3)."""
        return self.kinematics(q).rotations

    def foot_jacobians(self, q: npt.ArrayLike) -> Array:
        """Return the feet's velocities for each joint velocity, (legs, 3, joints), m/rad."""
        return self.kinematics(q).jacobians

    def angular_jacobians(self, q: npt.ArrayLike) -> Array:
        """Return the feet's angular velocities for each joint velocity, (legs, 3, joints)."""
        return self.kinematics(q).angular

    def gravity_torques(self, q: npt.ArrayLike, gravity: npt.ArrayLike = _DOWN) -> Array:
        """Return the joint torques that hold the links of the legs up, (legs, joints), N m.

        ``gravity`` is the acceleration of gravity in the axes of the base, (3,), m/s².
        """
        pull = quantity('gravity', gravity, 'm/s2', -100.0, 100.0)
        return self.chains.gravity_torques(self.kinematics(q), pull)

    def joint_positions(self, feet: npt.ArrayLike, near: npt.ArrayLike | None = None) -> Array:
        """Return joint positions, (legs, joints), that bring the feet to places, (legs, 3), m.

        Newton's method from ``near``, or from ``home``, with damped least squares.

        Raises
        ------
        InvalidInput
            When a foot does not reach its place.
        """
        goal = quantity('feet', feet, 'm', -100.0, 100.0)
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
        raise InvalidInput(f'leg {leg} does not reach {goal[self.legs.index(leg)].tolist()} m')

    def _shaped(self, q: npt.ArrayLike) -> Array:
        checked = quantity('q', q, 'rad', -1e4, 1e4)
        if checked.size != self.home.size:
            raise InvalidInput(
                f'q of shape {checked.shape} is not allowed: {self.home.size} joint positions are'
                ' needed'
            )
        return checked.reshape(self.home.shape)


def _assembled(
    name: str,
    legs: tuple[str | int, ...],
    joints: Sequence[Sequence[Joint]],
    feet: Array,
    mass: float,
    foot_radius: float,
    imu: Array,
) -> Robot:
    """Return a robot without gait that stands with all joints at zero."""
    return Robot(
        name=name,
        legs=legs,
        joint_names=tuple(joint.name for leg in joints for joint in leg),
        mass=mass,
        foot_radius=foot_radius,
        imu=imu,
        chains=Chains(joints, feet),
        hips=np.array([leg[0].at[:3, 3] for leg in joints]),
        home=np.zeros((len(joints), len(joints[0]))),
    )


def _from_table(table: Table, name: str, foot_radius: float | None) -> Robot:
    """Read a robot from the table of its YAML file."""
    table.text('description', default='')
    with table.table('imu', default={}) as part:
        imu = transform(
            part.vector('at', 'm', default=(0.0, 0.0, 0.0)),
            from_rpy(part.vector('rpy', 'rad', default=(0.0, 0.0, 0.0))),
        )
    mass = table.number('mass', 'kg', 1e-3, 1e5)
    radius = table.number('foot_radius', 'm', 0.0, 1.0)
    prefix = table.text('prefix', default='')
    links = _links(table)
    foot = table.vector('foot', 'm')
    legs, joints, feet = [], [], []
    with table.table('legs') as part:
        if not LEGS[0] <= len(part.keys) <= LEGS[1]:
            raise ConfigError(f'{part.origin}: 3 to 8 legs are needed, found {len(part.keys)}')
        for leg in part.keys:
            hip, mirrored = _hip(part, leg)
            joints.append(_leg(f'{prefix}{leg}_', links, hip, mirrored))
            feet.append(transform(_mirrored(foot, mirrored), np.eye(3)))
            legs.append(leg)
    carried = sum(joint.mass for leg in joints for joint in leg)
    if carried > mass:
        raise ConfigError(
            f'{table.origin}: mass = {mass:g} is not allowed: the links of the legs have'
            f' {carried:g} kg'
        )
    made = _assembled(
        name,
        tuple(legs),
        joints,
        np.array(feet),
        mass,
        radius if foot_radius is None else foot_radius,
        imu,
    )
    home = np.array([[link.home for link in links]] * len(legs))
    gait = _gait(table, made) if 'gait' in table else None
    table.finish()
    return Robot(**(vars(made) | {'home': home, 'gait': gait}))


@dataclass(frozen=True)
class _Link:
    """A joint and its link as a YAML file has them, for a leg on the left."""

    joint: Joint
    home: float


def _links(table: Table) -> list[_Link]:
    """Read the table ``joints``: joint by joint from the base to the foot."""
    links = []
    with table.table('joints') as part:
        for name in part.keys:
            with part.table(name) as row:
                axis = row.vector('axis', '', low=-1.0, high=1.0)
                if not (length := float(np.linalg.norm(axis))) > 0.1:
                    raise ConfigError(f'{row.origin}: axis = {axis.tolist()} has no direction')
                joint = Joint(
                    str(name),
                    transform(
                        row.vector('at', 'm', default=(0.0, 0.0, 0.0)),
                        from_rpy(row.vector('rpy', 'rad', default=(0.0, 0.0, 0.0))),
                    ),
                    axis / length,
                    row.choice('kind', ('revolute', 'prismatic'), 'revolute') == 'prismatic',
                    row.number('mass', 'kg', 0.0, 1e4, default=0.0),
                    row.vector('centre', 'm', default=(0.0, 0.0, 0.0)),
                )
                links.append(_Link(joint, row.number('home', 'rad', -10.0, 10.0, default=0.0)))
    if not links:
        raise ConfigError(f'{table.origin}: joints: at least one is needed')
    return links


def _hip(table: Table, leg: str | int) -> tuple[Array, bool]:
    """Read where a leg sits, and whether the places along it are mirrored."""
    key: str = leg  # type: ignore[assignment]  # YAML has numbers as keys, too
    if not isinstance(leg, (str, int)) or isinstance(leg, bool):
        raise ConfigError(f'{table.origin}: {leg!r} is not allowed: a name or number is needed')
    with table.table(key) as row:
        bearing = row.number('bearing', 'rad', -7.0, 7.0, default=0.0)
        hip = transform(row.vector('at', 'm'), from_rpy((0.0, 0.0, bearing)))
        return hip, row.choice('side', ('left', 'right'), default='left') == 'right'


def _mirrored(place: Array, mirrored: bool) -> Array:
    return place * _MIRROR if mirrored else place


def _leg(prefix: str, links: Sequence[_Link], hip: Array, mirrored: bool) -> list[Joint]:
    """Return the joints of a leg at a hip; only places are mirrored, never axes."""
    made = []
    at = hip
    for link in links:
        joint = link.joint
        made.append(
            Joint(
                prefix + joint.name,
                at @ transform(_mirrored(joint.at[:3, 3], mirrored), joint.at[:3, :3]),
                joint.axis,
                joint.slides,
                joint.mass,
                _mirrored(joint.centre, mirrored),
            )
        )
        at = np.eye(4)
    return made


def _gait(table: Table, robot: Robot) -> Gait:
    """Read the table ``gait``."""
    with table.table('gait') as part:
        kind = part.choice('kind', (*GAITS, 'own'))
        period = part.number('period', 's', 0.05, 60.0)
        duty = part.number('duty', '(share)', 0.05, 0.95)
        lift = part.number('lift', 'm', 0.0, 1.0)
        try:
            if kind == 'own':
                phases = part.vector('phases', '(share)', len(robot.legs), 0.0, 1.0)
                return Gait(period, duty, tuple(phases.tolist()), lift)
            return Gait.named(kind, robot.hips, period, duty, lift)
        except InvalidInput as error:
            raise ConfigError(f'{part.origin}: {error}') from error

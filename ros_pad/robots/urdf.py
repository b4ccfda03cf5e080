# SPDX-License-Identifier: Apache-2.0
"""Legs, masses and IMU of a robot from a URDF file (http://wiki.ros.org/urdf/XML)."""

from __future__ import annotations

import math
import os
import pathlib
import xml.etree.ElementTree as xml
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import choice, number
from ros_pad.errors import ConfigError, InvalidInput, reason
from ros_pad.robots.chains import Joint
from ros_pad.robots.rotation import Array, from_rpy, transform

KINDS = ('fixed', 'revolute', 'continuous', 'prismatic')


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    child: str
    at: Array
    axis: Array
    limits: tuple[float, float]
    motor: list[float]  # largest torque and speed
    mimics: str


class _Link(NamedTuple):
    mass: float
    centre: Array
    inertia: Array  # about the centre, in axes of the link, kg m²


class Urdf:
    """The tree of links and joints in a URDF file.

    Parameters
    ----------
    path : path
        The file: URDF, not xacro.

    Attributes
    ----------
    name : str
        Name of the robot.
    root : str
        The link without a parent: its axes are those of the base.
    mass : float
        Mass of all links, kg.

    Raises
    ------
    ConfigError
        When the file cannot be read or is not a tree of links.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._origin = os.fspath(path)
        try:
            tree = xml.fromstring(pathlib.Path(path).read_bytes())
        except (OSError, xml.ParseError, ValueError, LookupError) as error:
            raise ConfigError(
                f'{self._origin}: not a readable URDF file: {reason(error)}'
            ) from error
        if tree.tag != 'robot':
            raise self._error(f'expected <robot>, found <{tree.tag}>')
        self.name = tree.get('name', pathlib.Path(path).stem)
        self._joints: dict[str, _Joint] = {}  # by child
        try:
            self._links = {_text(link, 'name'): _link(link) for link in tree.iter('link')}
            # Transmissions and ros2_control have elements <joint> too, but deeper in the tree.
            for joint in map(_joint, tree.findall('joint')):
                choice(f'joint {joint.name!r}: parent', joint.parent, [*self._links])
                choice(f'joint {joint.name!r}: child', joint.child, [*self._links])
                if joint.child in self._joints:
                    raise self._error(f'link {joint.child!r} has two parents')
                self._joints[joint.child] = joint
        except InvalidInput as error:
            raise self._error(str(error)) from None
        roots = [name for name in self._links if name not in self._joints]
        if len(roots) != 1:
            raise self._error(f'one link without a parent is needed, found {roots}')
        self.root = roots[0]
        self.mass = sum(link.mass for link in self._links.values())

    def leg(self, foot: str) -> tuple[list[Joint], Array]:
        """Return the joints from the base to a link, and the transform of that link in the last.

        Raises
        ------
        ConfigError
            When there is no such link, no moving joint before it, or a joint that mimics another
            or is of another type.
        """
        joints: list[Joint] = []
        at = np.eye(4)
        for joint in reversed(self._path(foot)):
            at = at @ joint.at
            if joint.kind == 'fixed':
                continue
            if joint.kind not in KINDS:
                raise self._error(
                    f'joint {joint.name!r}: type = {joint.kind!r} is not allowed:'
                    f' one of {", ".join(KINDS)} is needed'
                )
            if joint.mimics:
                raise self._error(
                    f'joint {joint.name!r} of the leg to {foot!r}: <mimic joint={joint.mimics!r}>'
                    ' is not supported: joints of legs must move by themselves; where'
                    f' joint_states has {joint.name!r} too, take <mimic> out of a copy of the file'
                )
            mass, centre = self._carried(joint.child)
            slides = joint.kind == 'prismatic'
            joints.append(
                Joint(joint.name, at, joint.axis, slides, mass, centre, joint.limits, *joint.motor)
            )
            at = np.eye(4)
        if not joints:
            raise self._error(f'no moving joint between {self.root!r} and foot {foot!r}')
        return joints, at

    def pose(self, link: str) -> Array:
        """Return the transform from a link that is fixed to the base, (4, 4), m.

        Raises
        ------
        ConfigError
            When there is no such link, or it can move against the base.
        """
        at = np.eye(4)
        for joint in reversed(self._path(link)):
            if joint.kind != 'fixed':
                raise self._error(f'link {link!r} moves: joint {joint.name!r} is not fixed')
            at = at @ joint.at
        return at

    def trunk(self) -> tuple[Array, float]:
        """Return the centre of mass, m, and the yaw inertia, kg m², of what is fixed to the base.

        The base is often an empty link: body and IMU are fixed to it.
        """
        centre = self._carried(self.root)[1]
        inertia = 0.0
        for link, at in self._fixed(self.root, np.eye(4)):
            mass, middle, tensor = self._links[link]
            away = (at @ np.append(middle, 1.0))[:2] - centre[:2]
            turned = at[:3, :3] @ tensor @ at[:3, :3].T
            inertia += float(turned[2, 2] + mass * (away @ away))
        return centre, inertia

    def _path(self, link: str) -> list[_Joint]:
        """Return the joints from a link up to the root."""
        if link not in self._links:
            raise self._error(f'no link {link!r}; there are: {", ".join(self._links)}')
        path = []
        while link in self._joints:
            path.append(self._joints[link])
            link = path[-1].parent
            if len(path) > len(self._joints):
                raise self._error(f'joint {path[0].name!r} is in a loop')
        return path

    def _carried(self, link: str) -> tuple[float, Array]:
        """Return mass and centre of a link and all that is fixed to it, in the link's frame."""
        mass, moment = 0.0, np.zeros(3)
        for name, at in self._fixed(link, np.eye(4)):
            mass += self._links[name].mass
            moment += self._links[name].mass * (at @ np.append(self._links[name].centre, 1.0))[:3]
        return mass, moment / mass if mass > 0.0 else moment

    def _fixed(self, link: str, at: Array) -> Iterator[tuple[str, Array]]:
        """Yield a link and all that is fixed to it, with their transforms to a frame."""
        yield link, at
        for joint in self._joints.values():
            if joint.parent == link and joint.kind == 'fixed':
                yield from self._fixed(joint.child, at @ joint.at)

    def _error(self, problem: str) -> ConfigError:
        return ConfigError(f'{self._origin}: {problem}')


def _joint(element: xml.Element) -> _Joint:
    name, kind = _text(element, 'name'), _text(element, 'type')
    parent, child = element.find('parent'), element.find('child')
    if parent is None or child is None:
        raise InvalidInput(f'joint {name!r} needs <parent> and <child>')
    axis, limit, mimic = (element.find(tag) for tag in ('axis', 'limit', 'mimic'))
    line = np.array((1.0, 0.0, 0.0)) if axis is None else _numbers(axis, 'xyz', name)
    length = math.sqrt(line @ line)
    if kind != 'fixed' and length < 1e-6:
        raise InvalidInput(f'joint {name!r}: axis {line.tolist()} has no direction')
    limits = -math.inf, math.inf
    if kind in ('revolute', 'prismatic') and limit is not None:
        low, high = (_number(limit, key, name) for key in ('lower', 'upper'))
        number(f'joint {name!r}: lower', low, 'rad or m', -math.inf, high)
        if low < high:  # exporters write 0 and 0 where they know none
            limits = low, high
    motor = []
    for key, unit in (('effort', 'N m'), ('velocity', 'rad/s')):
        value = 0.0 if limit is None else _number(limit, key, name)
        # Exporters write 0 where they know none.
        motor.append(number(f'joint {name!r}: {key}', value, unit, 0.0) or math.inf)
    return _Joint(
        name,
        kind,
        _text(parent, 'link'),
        _text(child, 'link'),
        _placed(element, name),
        line / (length or 1.0),
        limits,
        motor,
        '' if mimic is None else _text(mimic, 'joint'),
    )


def _link(link: xml.Element) -> _Link:
    """Return mass, kg, centre of mass, m, and inertia, kg m², of a link."""
    inertial, name = link.find('inertial'), link.get('name', '')
    if inertial is None:
        return _Link(0.0, np.zeros(3), np.zeros((3, 3)))
    at, mass, tensor = _placed(inertial, name), 0.0, np.zeros((3, 3))
    if (element := inertial.find('mass')) is not None:
        mass = number(f'link {name!r}: mass', _number(element, 'value', name), 'kg')
    if (element := inertial.find('inertia')) is not None:
        keys = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
        xx, xy, xz, yy, yz, zz = (_number(element, key, name) for key in keys)
        tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    return _Link(mass, at[:3, 3], at[:3, :3] @ tensor @ at[:3, :3].T)


def _placed(element: xml.Element, name: str) -> Array:
    origin = element.find('origin')
    if origin is None:
        return np.eye(4)
    return transform(_numbers(origin, 'xyz', name), from_rpy(_numbers(origin, 'rpy', name)))


def _number(element: xml.Element, key: str, name: str) -> float:
    return float(_numbers(element, key, name, 1)[0])


def _numbers(element: xml.Element, key: str, name: str, count: int = 3) -> Array:
    """Return the numbers of an attribute, zero where there is none, of a joint or link."""
    text = element.get(key, count * '0 ')
    try:
        numbers = np.array(text.split(), dtype=float)
    except ValueError:
        numbers = np.array([])
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InvalidInput(
            f'{name!r}: {key} = {text!r} is not allowed: {count} finite number(s) needed'
        )
    return numbers


def _text(element: xml.Element, key: str) -> str:
    text = element.get(key)
    if not text:
        raise InvalidInput(f'<{element.tag}> needs {key}="…"')
    return text


def read(
    path: str | os.PathLike[str], feet: Sequence[str]
) -> tuple[Urdf, list[list[Joint]], Array]:
    """Return a URDF file, the joints of the legs to these links, and the feet in the last joints.

    Raises
    ------
    ConfigError
        When the file is not valid, or the legs have not all the same number of joints.
    """
    file = Urdf(path)
    legs = [file.leg(foot) for foot in feet]
    counts = sorted({len(joints) for joints, _ in legs})
    if len(counts) > 1:
        raise ConfigError(
            f'{os.fspath(path)}: legs with {" and ".join(map(str, counts))} joints: each leg needs'
            ' the same number'
        )
    return file, [joints for joints, _ in legs], np.array([at for _, at in legs])

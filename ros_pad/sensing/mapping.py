# SPDX-License-Identifier: Apache-2.0
"""What the messages of a robot mean: from fields of its topics to readings in SI units.

A mapping is a YAML file, see docs/mappings.md. It needs no message package: a message is any
object with attributes, as rclpy and rosbags make them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from collections.abc import Mapping as MappingType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad import configuration
from ros_pad.configuration import Table, shown
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing.stage import SensingStage

_AXES = dict(
    zip(('x', 'y', 'z', '-x', '-y', '-z'), np.vstack([np.eye(3), -np.eye(3)]), strict=True)
)
_CORNERS = {
    'front_left': (1.0, 1.0),
    'front_right': (1.0, -1.0),
    'rear_left': (-1.0, 1.0),
    'rear_right': (-1.0, -1.0),
}

_Read: TypeAlias = Callable[[Any], Any]


class Readings(NamedTuple):
    """What one message contains, in the order of the robot; None where it has no such reading.

    Attributes
    ----------
    stamp : int
        Time of the readings, ns.
    gyro : array (3,) or None
        Angular velocity in the axes of the IMU, rad/s.
    accelerometer : array (3,) or None
        Specific force in the axes of the IMU, m/s².
    positions : array (joints,) or None
        Joint positions in the order of ``robot.joint_names``, rad (m).
    velocities : array (joints,) or None
        Joint velocities, rad/s (m/s).
    efforts : array (joints,) or None
        Joint torques, N m (N).
    forces : dict of int to array (3,)
        Forces of the ground on feet, N, by index of the leg, in the axes of
        :attr:`Mapping.force_axes`.
    """

    stamp: int
    gyro: Array | None = None
    accelerometer: Array | None = None
    positions: Array | None = None
    velocities: Array | None = None
    efforts: Array | None = None
    forces: MappingType[int, Array] = {}

    def pass_to(self, stage: SensingStage) -> None:
        """Pass the readings to a sensing stage, forces first, so that the joints find them.

        Parameters
        ----------
        stage : SensingStage
            The stage that receives them.
        """
        for leg, force in self.forces.items():
            stage.force(leg, self.stamp, force.tolist())
        if self.gyro is not None and self.accelerometer is not None:
            stage.imu(self.stamp, self.gyro, self.accelerometer)
        if self.positions is not None:
            stage.joints(self.stamp, self.positions, self.velocities, self.efforts)


class Source(NamedTuple):
    """One topic of a mapping, and what reads its messages.

    Attributes
    ----------
    topic : str
        Name of the topic.
    type_name : str
        Its message type, such as ``sensor_msgs/msg/Imu``.
    gives : frozenset of str
        What its messages have: ``stamps``, ``gyro``, ``accelerometer``, ``positions``,
        ``velocities``, ``efforts``, and of forces ``vector``, ``normal`` (one axis) or
        ``contact`` (flags).
    read : callable
        Return the readings of a message and the time of its arrival, ns.
    """

    topic: str
    type_name: str
    gives: frozenset[str]
    read: Callable[[Any, int], Readings]


class Mapping:
    """What the messages of a robot mean.

    Use :meth:`load`.

    Parameters
    ----------
    name : str
        Name of the file.
    sources : sequence of Source
        Topics to subscribe to, with their types and fields.
    notes : sequence of str
        What is missing besides what the sources show, as in ``missing``.
    axes : str
        Value of ``force_axes``.

    Attributes
    ----------
    name : str
        Name of the file.
    sources : tuple of Source
        Topics to subscribe to, with their types.
    missing : tuple of str
        What this robot's messages cannot give, and what follows: a kind, a colon, and a sentence.
    force_axes : str
        ``base`` or ``foot``: the axes of the forces.
    force_kind : str
        ``vector``, ``normal`` (one axis) or ``contact`` (flags); empty without forces.

    Examples
    --------
    >>> from ros_pad.robots import Robot
    >>> from ros_pad.sensing import Mapping
    >>> mapping = Mapping.load('default', Robot.load('ch3r'))
    >>> [source.topic for source in mapping.sources][:3], mapping.force_kind
    (['imu/data', 'joint_states', 'leg_1/foot_wrench'], 'vector')
    """

    def __init__(self, name: str, sources: Sequence[Source], notes: Sequence[str], axes: str):
        self.name = name
        self.sources = tuple(sources)
        self.force_axes = axes
        gives = frozenset().union(*(source.gives for source in sources))
        kinds = (kind for kind in ('vector', 'normal', 'contact') if kind in gives)
        self.force_kind = next(kinds, '')
        arrive = [source.topic for source in sources if 'stamps' not in source.gives]
        self.missing = (*_missing(gives, self.force_kind, arrive), *notes)
        self._sources = {source.topic.lstrip('/'): source for source in sources}

    @classmethod
    def load(cls, source: str | os.PathLike[str], robot: Robot) -> Mapping:
        """Read ``config/mappings/<name>.yaml`` or another YAML file, for a robot.

        Parameters
        ----------
        source : str or path
            Name of a shipped mapping, or path of a file that ends in .yaml or .yml.
        robot : Robot
            The robot whose joints and legs give the order of the readings.

        Returns
        -------
        Mapping
            The mapping.

        Raises
        ------
        ConfigError
            When there is no such mapping, its file is not valid, or it does not fit the robot.
        """
        configuration.instance('robot', robot, Robot)
        path = configuration.locate('mappings', source)
        table = Table.load(path)
        table.text('description', default='')
        table.text('robot', default='')  # for readers
        sources = []
        axes = table.choice('force_axes', ('base', 'foot'), 'base')
        with table.table('topics') as topics:
            for pattern in topics.keys:
                with topics.table(pattern) as part:
                    sources += _sources(part, str(pattern), robot)
        notes = table.sequence('missing', ())
        table.finish()
        if not sources:
            raise ConfigError(f'{path}: topics: at least one is needed')
        return cls(path.stem, sources, notes, axes)

    def read(self, topic: str, message: Any, arrival: int) -> Readings:
        """Return the readings of a message.

        Parameters
        ----------
        topic : str
            Name of the topic, as in :attr:`sources`, with or without a slash at the beginning.
        message : object
            The message, with its fields as attributes.
        arrival : int
            Time at which it arrived, or was recorded, ns.

        Returns
        -------
        Readings
            What the message contains, in SI units.

        Raises
        ------
        InvalidInput
            When the mapping does not have the topic, the message does not have a field or a
            joint, or a value is not finite; the message names it.
        """
        source = self._sources.get(topic.lstrip('/'))
        if source is None:
            raise InvalidInput(
                f'topic {topic!r} is not in mapping {self.name}: one of'
                f' {", ".join(self._sources)} is needed'
            )
        try:
            return source.read(message, arrival)
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise InvalidInput(f'{topic} ({source.type_name}): {error}') from error


def _missing(gives: frozenset[str], forces: str, arrive: Sequence[str]) -> list[str]:
    """Return what is not given, and what follows from that.

    ``forces`` is the kind of the forces, and ``arrive`` are the topics without stamps.
    """
    must = 'the body estimator cannot run without'
    found = (
        ('gyro' in gives, f'gyro: no topic has raw angular velocity; {must}'),
        ('accelerometer' in gives, f'accelerometer: no topic has specific force; {must}'),
        ('positions' in gives, f'joints: no topic has positions; {must}'),
        (
            'velocities' in gives or 'positions' not in gives,
            'joint velocities: differences of positions replace them, with more noise',
        ),
        (
            forces or 'efforts' in gives,
            'force: neither foot forces nor efforts; contact and friction are unobservable',
        ),
        (forces != 'normal', 'friction: unobservable, the force has one axis'),
        (forces != 'contact', 'friction: unobservable, there are flags of contact and no forces'),
        (
            not arrive,
            f'stamps: {", ".join(arrive)} has none; delays of its messages are not corrected',
        ),
    )
    return [text for there, text in found if not there]


def _sources(part: Table, pattern: str, robot: Robot) -> list[Source]:
    """Read the table of one topic, or of one topic for each leg."""
    type_name = part.text('type')
    if not re.fullmatch(r'[a-z]\w*/msg/[A-Z]\w*', type_name):
        raise ConfigError(
            f'{part.origin}: type = {type_name!r} is not allowed: package/msg/Name is needed'
        )
    fields = {key: _vector(part, key) for key in ('gyro', 'accelerometer') if key in part}
    joints, kinds = _joints(part, robot)
    single = '{leg}' in pattern or '{name}' in pattern
    forces, kind = _forces(part, robot, single)
    path = part.text('stamp')
    unit = part.number('tick', 's', 1e-9, 1.0) * 1e9 if 'tick' in part else 0.0
    delay = round(part.number('delay', 's', -1.0, 1.0, default=0.0) * 1e9)
    field = None if path == 'arrival' else _reader(path, part.origin)
    gives = frozenset({*fields, *kinds, kind, 'stamps' if field else ''} - {''})

    def made(topic: str, leg: int = 0) -> Source:
        stamp = _clock(field, unit, delay)

        def read(message: Any, arrival: int) -> Readings:
            return Readings(
                stamp(message, arrival),
                **{key: vector(message) for key, vector in fields.items()},
                **(joints(message) if joints else {}),
                forces={leg + at: force for at, force in forces(message)} if forces else {},
            )

        return Source(topic, type_name, gives, read)

    if not single:
        return [made(pattern)]
    if forces is None:
        raise ConfigError(f'{part.origin}: a topic of each leg needs a table force')
    return [
        made(pattern.replace('{leg}', str(leg + 1)).replace('{name}', str(name)), leg)
        for leg, name in enumerate(robot.legs)
    ]


def _clock(read: _Read | None, unit: float, delay: int) -> Callable[[Any, int], int]:
    """Return what gives the stamps of a topic: a field, the arrival, or a counter.

    ``unit`` is ns a count, 0 for a stamp with seconds and nanoseconds; ``delay`` is the time from
    the measurement to the stamp, ns.
    """
    offset: int | None = None

    def stamp(message: Any, arrival: int) -> int:
        nonlocal offset
        if read is None:
            return arrival - delay
        value = read(message)
        if not unit:
            return int(value.sec) * 1_000_000_000 + int(value.nanosec) - delay
        count = round(float(value) * unit)
        # The first arrival gives the offset; the delay of the others is not in their stamps. A
        # counter that is 1 s off has begun anew.
        if offset is None or abs(count + offset - arrival) > 1_000_000_000:
            offset = arrival - count
        return count + offset - delay

    return stamp


def _vector(part: Table, key: str) -> _Read:
    """Read three components of a sensor, turned into the axes of the IMU."""
    with part.table(key) as row:
        field, turn = _reader(row.text('field'), row.origin), _turn(row)
        # A covariance whose first element is -1 where nothing is measured.
        absent = _reader(row.text('absent'), row.origin) if 'absent' in row else None

    def read(message: Any) -> Array | None:
        if absent is not None and np.ravel(absent(message))[0] == -1.0:
            return None
        return np.asarray(turn @ _finite(field(message), 3))

    return read


def _turn(row: Table) -> Array:
    """Read ``axes`` and ``scale``: the matrix that turns a reading into axes of the robot."""
    axes = row.sequence('axes', ('x', 'y', 'z'))
    if len(axes) != 3 or not set(axes) <= set(_AXES) or len({each[-1] for each in axes}) != 3:
        raise ConfigError(
            f'{row.origin}: axes = {axes} is not allowed: x, y and z in any order, each with or'
            ' without a minus, are needed'
        )
    return np.array([_AXES[each] for each in axes]) * _scale(row, 'scale')


def _scale(row: Table, key: str) -> float:
    return row.number(key, '', -1e9, 1e9, default=1.0)


def _joints(part: Table, robot: Robot) -> tuple[_Read | None, tuple[str, ...]]:
    """Read what gives readings of joints, or feet in the body for legs that slide along its axes.

    Return it, and its kinds: ``positions``, and ``velocities`` and ``efforts`` where given.
    """
    if 'joints' not in part and 'feet' not in part:
        return None, ()
    known = list(robot.joint_names)
    with part.table('joints' if 'joints' in part else 'feet') as row:
        if 'joints' in part:
            names, wanted, signs, offsets = _named(row, known)
        else:
            offsets, order = _feet(row, robot)
            names, wanted, signs = lambda _: order, known, np.ones(len(known))
        scale = row.number('scale', '', 1e-9, 1e9, default=1.0)
        scales = {'positions': scale, 'velocities': scale, 'efforts': _scale(row, 'effort_scale')}
        fields = {
            kind: _reader(row.text(kind), row.origin)
            for kind in scales
            if kind == 'positions' or kind in row
        }
        exact = 'names' in row
    last: dict[tuple[str, ...], Array] = {}  # places by the last names

    def read(message: Any) -> dict[str, Array | None]:
        given = tuple(map(str, names(message)))
        if given not in last:
            places = _places(wanted, given)
            last.clear()
            last[given] = places
        found: dict[str, Array | None] = {}
        for kind, field in fields.items():
            values = np.ravel(np.asarray(field(message), dtype=float))
            if np.isnan(values).all() and (values.size or kind != 'positions'):
                found[kind] = None  # drivers leave out, or fill with NaN, what they do not measure
                continue
            if len(values) < len(given) or (exact and len(values) > len(given)):
                raise InvalidInput(
                    f'{kind} of {len(values)} joints are not allowed: {len(given)} are needed'
                )
            read_out = _finite(values[last[given]], len(known)) * (signs * scales[kind])
            found[kind] = read_out + offsets if kind == 'positions' else read_out
        return found

    return read, tuple(fields)


def _named(row: Table, known: Sequence[str]) -> tuple[_Read, list[str], Array, Array]:
    """Read what gives the names in a message, and for each joint its name there, sign and zero."""

    def place(name: Any) -> int:
        return known.index(configuration.choice('joint', name, known))

    if ('names' in row) == ('order' in row):
        raise ConfigError(f'{row.origin}: either names or order is needed')
    wanted, signs, offsets = list(known), np.ones(len(known)), np.zeros(len(known))
    try:
        with row.table('rename', default={}) as words:
            for name in words.keys:
                wanted[place(name)] = words.text(name)
        for name in row.sequence('reversed', ()):
            signs[place(name)] = -1.0
        with row.table('offsets', default={}) as values:
            for name in values.keys:
                offsets[place(name)] = values.number(name, 'rad', -100.0, 100.0)
        if 'names' in row:
            return _reader(row.text('names'), row.origin), wanted, signs, offsets
        order = row.sequence('order')
        _places(wanted, order)
    except InvalidInput as error:
        raise ConfigError(f'{row.origin}: {error}') from None
    return lambda _: order, wanted, signs, offsets


def _feet(row: Table, robot: Robot) -> tuple[Array, tuple[str, ...]]:
    """Read the legs of places of feet; return what zeroes them, and the order of the joints."""
    zero = np.zeros(robot.home.size)
    lines = robot.kinematics(zero).jacobians
    if lines.shape != (len(robot.legs), 3, 3) or np.abs(lines - np.eye(3)).max() > 1e-9:
        raise ConfigError(
            f'{row.origin}: places of feet need a robot whose legs slide along x, y and z,'
            f' such as go2_feet; legs of {robot.name} do not'
        )
    legs = _legs(row, robot)
    if sorted(legs) != list(range(len(robot.legs))):
        raise ConfigError(f'{row.origin}: legs: each of {robot.legs} is needed once')
    order = tuple(robot.joint_names[3 * leg + axis] for leg in legs for axis in range(3))
    return -robot.foot_positions(zero).ravel(), order


def _forces(part: Table, robot: Robot, single: bool) -> tuple[_Read | None, str]:
    """Read what gives the forces of feet, by leg, and their kind: vector, normal or contact.

    With ``single``, a message has the force of one leg, which is named 0.
    """
    keys = [key for key in ('force', 'normal_force', 'contact') if key in part]
    if not keys:
        return None, ''
    if len(keys) > 1:
        raise ConfigError(f'{part.origin}: only one of {", ".join(keys)} is allowed')
    kind = {'force': 'vector', 'normal_force': 'normal', 'contact': 'contact'}[keys[0]]
    with part.table(keys[0]) as row:
        field = _reader(row.text('field'), row.origin)
        legs = (0,) if single else _legs(row, robot)
        # A foot that stands has the load that the estimator expects.
        load = robot.mass * 9.81 / (0.5 * len(robot.legs))
        turn = _turn(row) if kind == 'vector' else _AXES['z'][:, None]
        if kind == 'normal':
            offset, scale = row.number('offset', '', default=0.0), _scale(row, 'scale')

    def read(message: Any) -> list[tuple[int, Array]]:
        if kind == 'vector':
            values = _finite(field(message), 3 * len(legs)).reshape(-1, 3)
        else:
            values = _finite(field(message), len(legs))[:, None]
            values = load * (values == 1.0) if kind == 'contact' else (values + offset) * scale
        return list(zip(legs, values @ turn.T, strict=True))

    return read, kind


def _legs(row: Table, robot: Robot) -> tuple[int, ...]:
    """Read indices of legs: by name, or by the corner of the robot at which the hip is."""
    found = []
    for name in row.sequence('legs'):
        x, y = _CORNERS.get(name, (0.0, 0.0))
        corner = [i for i, hip in enumerate(robot.hips) if hip[0] * x > 0.0 and hip[1] * y > 0.0]
        leg = [robot.legs.index(name)] if name in robot.legs else corner
        if len(leg) != 1 or leg[0] in found:
            raise ConfigError(
                f'{row.origin}: legs: {shown(name)} is not allowed: different ones of'
                f' {", ".join(map(str, robot.legs))}, or of {", ".join(_CORNERS)}, are needed'
            )
        found += leg
    return tuple(found)


def _places(wanted: Sequence[str], names: Sequence[str]) -> Array:
    """Return where each wanted joint is among names; raise `InvalidInput` for one that is not."""
    if len(set(names)) < len(names):
        raise InvalidInput(
            f'joint names {", ".join(map(str, names))} are not allowed: one is double'
        )
    for joint in wanted:
        if joint not in names:
            raise InvalidInput(
                f'joint {joint!r} is not among {", ".join(map(str, names)) or "no names"}'
            )
    return np.array([names.index(joint) for joint in wanted], dtype=np.intp)


def _finite(values: Any, count: int) -> Array:
    """Return values as an array (count,); raise `InvalidInput` for others."""
    found = np.asarray(values, dtype=float).ravel()
    if len(found) != count or not np.isfinite(found).all():
        raise InvalidInput(
            f'{shown(found.tolist())} is not allowed: {count} finite numbers are needed'
        )
    return found


def _reader(path: str, origin: str) -> _Read:
    """Return a function that reads a field of a message.

    A path has names with dots between them. After a name, ``[2]`` is one element of a list, and
    ``[]`` all of them; ``xyz`` at the end stands for the fields x, y and z.
    """
    matches = [re.fullmatch(r'([A-Za-z]\w*)(\[\d*\])?', word) for word in path.split('.')]
    steps = [(match[1], match[2] or '') for match in matches if match]
    if len(steps) < len(matches):
        raise ConfigError(
            f'{origin}: {path!r} is not allowed: names of fields with dots between them, each'
            ' with [] or a number in brackets or without, are needed'
        )

    def read(message: Any, at: int = 0) -> Any:
        for place, (name, index) in enumerate(steps[at:], at):
            if name == 'xyz' and place == len(steps) - 1:
                return message.x, message.y, message.z
            message = getattr(message, name)
            if index == '[]':
                if place == len(steps) - 1:
                    return message
                return [read(each, place + 1) for each in message]
            if index:
                message = message[int(index[1:-1])]
        return message

    return read

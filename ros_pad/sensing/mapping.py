# SPDX-License-Identifier: Apache-2.0
"""What the messages of a robot mean: from fields of its topics to readings in SI units.

A mapping is a YAML file, see docs/mappings.md. It needs no message package: a message is any
object with attributes, as rclpy and rosbags make them.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Sequence
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad import configuration
from ros_pad.configuration import Table, shown
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing.stage import SensingStage

ARRIVAL = 'arrival'
"""Source of stamps of messages that have none: the time at which they arrive."""

RESET = 1.0
"""Largest difference between arrival and the count of a counter that began before, s: if it is
larger, the counter has begun anew."""

_GRAVITY = 9.81  # m/s²
_STEP = re.compile(r'([A-Za-z]\w*)(\[\d*\])?')
_TYPE = re.compile(r'[a-z]\w*/msg/[A-Z]\w*')
_AXES = {
    f'{sign}{name}': factor * line
    for name, line in zip('xyz', np.eye(3), strict=True)
    for sign, factor in (('', 1.0), ('-', -1.0))
}
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


@dataclass
class _Clock:
    """Where the stamps of a topic come from: a field, the arrival, or a counter."""

    read: _Read | None
    unit: float  # ns a count; 0 for a stamp with seconds and nanoseconds
    delay: int = 0  # ns from the measurement to the stamp
    offset: int | None = None

    def stamp(self, message: Any, arrival: int) -> int:
        return self._given(message, arrival) - self.delay

    def _given(self, message: Any, arrival: int) -> int:
        if self.read is None:
            return arrival
        value = self.read(message)
        if not self.unit:
            return int(value.sec) * 1_000_000_000 + int(value.nanosec)
        count = round(float(value) * self.unit)
        # The first arrival gives the offset; the delay of the others is not in their stamps.
        if self.offset is None or abs(count + self.offset - arrival) > RESET * 1e9:
            self.offset = arrival - count
        return count + self.offset


@dataclass(frozen=True)
class _Vector:
    """Three components of a sensor, turned into the axes of the IMU, the base or the foot."""

    read: _Read
    turn: Array  # axes and scale
    absent: _Read | None  # a covariance whose first element is -1 where nothing is measured

    def __call__(self, message: Any) -> Array | None:
        if self.absent is not None and np.ravel(self.absent(message))[0] == -1.0:
            return None
        return self.turn @ _finite(self.read(message), 3)


@dataclass(frozen=True)
class _Joints:
    """Positions, velocities and efforts of joints."""

    names: _Read | None  # names in the message
    order: tuple[str, ...]  # names where the message has none
    fields: tuple[tuple[str, _Read], ...]  # positions, and velocities and efforts where given
    wanted: tuple[str, ...]  # of the robot, as the message names them
    factors: MappingType[str, Array]
    offsets: Array
    places: dict[tuple[str, ...], Array] = field(default_factory=dict)

    def __call__(self, message: Any) -> dict[str, Array | None]:
        names = self.order if self.names is None else tuple(map(str, self.names(message)))
        if names not in self.places:
            if len(self.places) > 16:
                self.places.clear()
            self.places[names] = _places(self.wanted, names)
        place = self.places[names]
        found: dict[str, Array | None] = {}
        for kind, read in self.fields:
            values = np.ravel(np.asarray(read(message), dtype=float))
            if kind != 'positions' and (not values.size or np.isnan(values).all()):
                found[kind] = None  # drivers leave out, or fill with NaN, what they do not measure
                continue
            if len(values) < len(names):
                raise InvalidInput(
                    f'{kind} of {len(values)} joints are not allowed: {len(names)} are needed'
                )
            chosen = _finite(values[place], len(place))
            found[kind] = chosen * self.factors[kind]
            if kind == 'positions':
                found[kind] = chosen * self.factors[kind] + self.offsets
        return found


@dataclass(frozen=True)
class _Forces:
    """Forces of feet: vectors, one axis, or flags of contact."""

    kind: str  # vector, normal or contact
    read: _Read
    legs: tuple[int, ...]
    turn: Array  # axes and scale of a vector; of the others the direction, 3 x 1
    offset: float = 0.0
    made: tuple[float, ...] = ()

    def __call__(self, message: Any) -> dict[int, Array]:
        if self.kind == 'vector':
            values = _finite(self.read(message), 3 * len(self.legs)).reshape(-1, 3)
        else:
            values = _finite(self.read(message), len(self.legs))[:, None] + self.offset
            if self.kind == 'contact':
                values = np.isin(values, self.made).astype(float)
        return dict(zip(self.legs, values @ self.turn.T, strict=True))


@dataclass(frozen=True)
class Source:
    """One topic of a mapping.

    Attributes
    ----------
    topic : str
        Name of the topic.
    type_name : str
        Its message type, such as ``sensor_msgs/msg/Imu``.
    """

    topic: str
    type_name: str
    clock: _Clock
    gyro: _Vector | None
    accelerometer: _Vector | None
    joints: _Joints | None
    forces: _Forces | None

    @property
    def package(self) -> str:
        """The package of the message type."""
        return self.type_name.partition('/')[0]


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
        self.missing = (*_missing(self.sources), *notes)
        kinds = {source.forces.kind for source in sources if source.forces}
        self.force_kind = min(kinds, key=('vector', 'normal', 'contact').index, default='')
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
        made_for = table.text('robot', default='')
        sources = []
        axes = table.choice('force_axes', ('base', 'foot'), 'base')
        with table.table('topics') as topics:
            for pattern in topics.keys:
                with topics.table(pattern) as part:
                    sources += _sources(part, str(pattern), robot, made_for)
        notes = _words(table, 'missing', ())
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
            return Readings(
                source.clock.stamp(message, arrival),
                source.gyro(message) if source.gyro else None,
                source.accelerometer(message) if source.accelerometer else None,
                **(source.joints(message) if source.joints else {}),
                forces=source.forces(message) if source.forces else {},
            )
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise InvalidInput(f'{topic} ({source.type_name}): {error}') from error


def _missing(sources: Sequence[Source]) -> list[str]:
    """Return what no topic gives, and what follows from that."""
    found = []
    for name, words in (('gyro', 'raw angular velocity'), ('accelerometer', 'specific force')):
        if not any(getattr(source, name) for source in sources):
            found.append(f'{name}: no topic has {words}; the body estimator cannot run without it')
    kinds = {kind for source in sources if source.joints for kind, _ in source.joints.fields}
    if 'positions' not in kinds:
        found.append('joints: no topic has positions; the body estimator cannot run without them')
    elif 'velocities' not in kinds:
        found.append('joint velocities: differences of positions replace them, with more noise')
    forces = {source.forces.kind for source in sources if source.forces}
    if not forces and 'efforts' not in kinds:
        found.append(
            'force: neither foot forces nor efforts; contact and friction are unobservable'
        )
    elif 'vector' not in forces and 'normal' in forces:
        found.append('friction: unobservable, the force has one axis')
    elif 'vector' not in forces and 'contact' in forces:
        found.append('friction: unobservable, there are flags of contact and no forces')
    if any(source.clock.read is None for source in sources):
        late = ', '.join(source.topic for source in sources if source.clock.read is None)
        found.append(f'stamps: {late} has none; delays of its messages are not corrected')
    return found


def _sources(part: Table, pattern: str, robot: Robot, made_for: str) -> list[Source]:
    """Read the table of one topic, or of one topic for each leg."""
    type_name = part.text('type')
    if not _TYPE.fullmatch(type_name):
        raise ConfigError(
            f'{part.origin}: type = {type_name!r} is not allowed: package/msg/Name is needed'
        )
    gyro, accelerometer = _vector(part, 'gyro'), _vector(part, 'accelerometer')
    joints = _joints(part, robot, made_for) or _feet(part, robot, made_for)
    forces = _forces(part, robot, single='{leg}' in pattern or '{name}' in pattern)
    path = part.text('stamp')
    unit = part.number('tick', 's', 1e-9, 1.0) * 1e9 if 'tick' in part else 0.0

    delay = round(part.number('delay', 's', -1.0, 1.0, default=0.0) * 1e9)

    def made(topic: str, forces: _Forces | None) -> Source:
        clock = _Clock(None if path == ARRIVAL else _reader(path, part.origin), unit, delay)
        return Source(topic, type_name, clock, gyro, accelerometer, joints, forces)

    if '{leg}' not in pattern and '{name}' not in pattern:
        return [made(pattern, forces)]
    if forces is None:
        raise ConfigError(f'{part.origin}: a topic of each leg needs a table force')
    return [
        made(
            pattern.replace('{leg}', str(leg + 1)).replace('{name}', str(name)),
            _Forces(**(vars(forces) | {'legs': (leg,)})),
        )
        for leg, name in enumerate(robot.legs)
    ]


def _vector(part: Table, key: str) -> _Vector | None:
    if key not in part:
        return None
    with part.table(key) as row:
        absent = row.text('absent', default='')
        return _Vector(
            _reader(row.text('field'), row.origin),
            _turn(row),
            _reader(absent, row.origin) if absent else None,
        )


def _turn(row: Table) -> Array:
    """Read ``axes`` and ``scale``: the matrix that turns a reading into axes of the robot."""
    axes = _words(row, 'axes', ('x', 'y', 'z'))
    if len(axes) != 3 or not set(axes) <= set(_AXES) or len({each[-1] for each in axes}) != 3:
        raise ConfigError(
            f'{row.origin}: axes = {axes} is not allowed: x, y and z in any order, each with or'
            ' without a minus, are needed'
        )
    return np.array([_AXES[each] for each in axes]) * row.number(
        'scale', '', -1e9, 1e9, default=1.0
    )


def _joints(part: Table, robot: Robot, made_for: str) -> _Joints | None:
    if 'joints' not in part:
        return None
    with part.table('joints') as row:
        names = row.text('names', default='')
        order = _words(row, 'order', ())
        if bool(names) == bool(order):
            raise ConfigError(f'{row.origin}: either names or order is needed')
        fields = [
            (kind, _reader(row.text(kind), row.origin))
            for kind in ('positions', 'velocities', 'efforts')
            if kind == 'positions' or kind in row
        ]
        known = robot.joint_names
        with row.table('rename', default={}) as words:
            renamed = {_one_of(words, name, known): words.text(name) for name in words.keys}
        wanted = tuple(renamed.get(name, name) for name in known)
        if order:
            try:
                _places(wanted, order)
            except InvalidInput as error:
                hint = f'; this mapping is made for the robot {made_for}' if made_for else ''
                raise ConfigError(f'{row.origin}: order: {error}{hint}') from None
        signs = np.ones(len(known))
        for name in _words(row, 'reversed', ()):
            signs[known.index(_one_of(row, name, known))] = -1.0
        offsets = np.zeros(len(known))
        with row.table('offsets', default={}) as values:
            for name in values.keys:
                place = known.index(_one_of(values, name, known))
                offsets[place] = values.number(name, 'rad', -100.0, 100.0)
        scale = row.number('scale', '', 1e-9, 1e9, default=1.0)
        effort_scale = row.number('effort_scale', '', -1e9, 1e9, default=1.0)
        factors = {'positions': signs * scale, 'velocities': signs * scale}
        factors['efforts'] = signs * effort_scale
        reader = _reader(names, row.origin) if names else None
        return _Joints(reader, order, tuple(fields), wanted, factors, offsets)


def _feet(part: Table, robot: Robot, made_for: str) -> _Joints | None:
    """Read the table ``feet``: places of feet in the body, for legs that slide along its axes."""
    if 'feet' not in part:
        return None
    zero = np.zeros(robot.home.size)
    lines = robot.foot_jacobians(zero)
    if lines.shape != (len(robot.legs), 3, 3) or np.abs(lines - np.eye(3)).max() > 1e-9:
        raise ConfigError(
            f'{part.origin}: feet: places of feet need a robot whose legs slide along x, y and z,'
            f' such as {made_for or "go2_feet"}; legs of {robot.name} do not'
        )
    with part.table('feet') as row:
        legs = [_leg(row, each, robot) for each in row.sequence('legs')]
        if sorted(legs) != list(range(len(robot.legs))):
            raise ConfigError(f'{row.origin}: legs: each of {robot.legs} is needed once')
        names = robot.joint_names
        order = tuple(names[3 * leg + axis] for leg in legs for axis in range(3))
        fields = [
            (kind, _reader(row.text(kind), row.origin))
            for kind in ('positions', 'velocities')
            if kind == 'positions' or kind in row
        ]
        factors = {
            kind: np.full(len(names), row.number('scale', '', 1e-9, 1e9, default=1.0))
            for kind, _ in fields
        }
        places = -robot.foot_positions(zero).ravel()
        return _Joints(None, order, tuple(fields), names, factors, places)


def _forces(part: Table, robot: Robot, single: bool) -> _Forces | None:
    kinds = [key for key in ('force', 'normal_force', 'contact') if key in part]
    if not kinds:
        return None
    if len(kinds) > 1:
        raise ConfigError(f'{part.origin}: only one of {", ".join(kinds)} is allowed')
    with part.table(kinds[0]) as row:
        read = _reader(row.text('field'), row.origin)
        legs = (0,) if single else tuple(_leg(row, each, robot) for each in row.sequence('legs'))
        if len(set(legs)) != len(legs):
            raise ConfigError(f'{row.origin}: legs: each leg is allowed once')
        if kinds[0] == 'force':
            return _Forces('vector', read, legs, _turn(row))
        up = np.array(((0.0,), (0.0,), (1.0,)))
        if kinds[0] == 'normal_force':
            up *= row.number('scale', '', -1e9, 1e9, default=1.0)
            return _Forces('normal', read, legs, up, row.number('offset', '', default=0.0))
        made = tuple(map(float, row.sequence('made', (1,))))
        # A foot that stands has the load that the estimator expects.
        load = robot.mass * _GRAVITY / (0.5 * len(robot.legs))
        return _Forces('contact', read, legs, up * load, made=made)


def _leg(row: Table, name: Any, robot: Robot) -> int:
    """Return the index of a leg: its name, or the corner of the robot at which its hip is."""
    if name in robot.legs:
        return robot.legs.index(name)
    if name in _CORNERS:
        x, y = _CORNERS[name]
        found = [i for i, hip in enumerate(robot.hips) if hip[0] * x > 0.0 and hip[1] * y > 0.0]
        if len(found) == 1:
            return found[0]
        raise ConfigError(f'{row.origin}: {len(found)} legs of robot {robot.name} are {name}')
    raise ConfigError(
        f'{row.origin}: legs: {shown(name)} is not allowed: one of'
        f' {", ".join(map(str, robot.legs))}, or of {", ".join(_CORNERS)}, is needed'
    )


def _places(wanted: Sequence[str], names: Sequence[str]) -> Array:
    """Return where each wanted joint is among names; raise `InvalidInput` for one that is not."""
    for joint in wanted:
        if joint not in names:
            others = [name for name in names if name not in wanted]
            near = difflib.get_close_matches(joint, others, n=1)
            hint = f'; is {near[0]!r} this joint?' if near else ''
            raise InvalidInput(
                f'joint {joint!r} is not among {", ".join(map(str, names)) or "no names"}{hint}'
            )
    return np.array([names.index(joint) for joint in wanted], dtype=np.intp)


def _one_of(row: Table, name: Any, known: Sequence[str]) -> str:
    """Return a joint of the robot; raise `ConfigError` if it has none of this name."""
    if name not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        hint = f'; did you mean {near[0]!r}?' if near else ''
        raise ConfigError(
            f'{row.origin}: {shown(name)} is no joint of the robot: {", ".join(known)}{hint}'
        )
    return str(name)


def _words(row: Table, key: str, default: tuple[str, ...]) -> tuple[str, ...]:
    """Read a list of texts."""
    found = row.sequence(key, default)
    if not all(isinstance(each, str) for each in found):
        raise ConfigError(f'{row.origin}: {key} = {shown(found)} is not allowed: texts are needed')
    return found


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
    steps: list[tuple[str, str]] = []
    for word in path.split('.'):
        match = _STEP.fullmatch(word)
        if match is None:
            raise ConfigError(
                f'{origin}: {path!r} is not allowed: names of fields with dots between them, each'
                ' with [] or a number in brackets or without, are needed'
            )
        steps.append((match[1], match[2] or ''))

    def read(message: Any, at: int = 0) -> Any:
        for place in range(at, len(steps)):
            name, index = steps[place]
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

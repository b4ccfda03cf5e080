# SPDX-License-Identifier: Apache-2.0
"""Trials from bags: the series and the metrics of what was recorded, whoever walked.

A bag of ``pad run`` gives the series of the loop without ROS to the bit, but for the body's
heading, which is sent as a quaternion (1e-15 rad), and for pressures that are no whole number of
Pa, which are sent as absolute ones (1e-11 Pa). The bag of a robot may have other rates, gaps,
legs missing and a namespace: what was last heard holds, and NaN stands for what was never heard.
"""

from __future__ import annotations

import dataclasses
import datetime
import difflib
import json
import math
import os
import pathlib
import re
from array import array
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from typing import Any

import numpy as np

from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.estimation import DOUBTS
from ros_pad.simulation.scene import FloorPlan
from ros_pad.trials.bag import BagReader
from ros_pad.trials.label import AMBIENT_PRESSURE
from ros_pad.trials.label import KEY
from ros_pad.trials.label import LOST
from ros_pad.trials.repair import KEY as REPAIR
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial

Progress = Callable[[float], None]

_TOPIC = re.compile(r'(?P<namespace>.*?/)(?:leg_(?P<leg>\d+)/)?(?P<kind>\w+(?:/pose)?)')
_FIRST_DATE_NS = 10**18  # 2001: a bag that starts later has the time of day, not of a simulation
_REPORT_EVERY = 20_000  # messages


def _force(message: Any) -> tuple[float, ...]:
    force = message.wrench.force
    return force.x, force.y, force.z


def _point(message: Any) -> tuple[float, ...]:
    point = message.point
    return point.x, point.y, point.z


def _pose(message: Any) -> tuple[float, ...]:
    position, q = message.pose.position, message.pose.orientation
    if q.x == 0.0 and q.y == 0.0:
        # Where the body only turns about the vertical, this is exact to the last digits.
        heading = 2.0 * math.atan2(q.z, q.w)
    else:
        heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return position.x, position.y, heading


def _pressure(message: Any) -> tuple[float, ...]:
    return (message.fluid_pressure,)


def _slip_speed(message: Any) -> tuple[float, ...]:
    linear = message.twist.twist.linear
    return (math.hypot(linear.x, linear.y),)


def _data(message: Any) -> tuple[float, ...]:
    return (message.data,)


def _is_dome(message: Any) -> tuple[float, ...]:
    return (message.data == 'dome',)


def _doubt(message: Any) -> tuple[float, ...]:
    kind = message.data.partition(':')[0]
    return (DOUBTS.index(kind) if kind in DOUBTS else -1,)


# What is read: message type, numbers in a message, and how to get them.
_KINDS: dict[str, tuple[str, int, Callable[[Any], tuple[float, ...]]]] = {
    'wrench': ('geometry_msgs/msg/WrenchStamped', 3, _force),
    'position': ('geometry_msgs/msg/PointStamped', 3, _point),
    'body/pose': ('geometry_msgs/msg/PoseStamped', 3, _pose),
    'pressure': ('sensor_msgs/msg/FluidPressure', 1, _pressure),
    'pressure_setpoint': ('sensor_msgs/msg/FluidPressure', 1, _pressure),
    'slip': ('geometry_msgs/msg/TwistWithCovarianceStamped', 1, _slip_speed),
    'slipping': ('std_msgs/msg/Bool', 1, _data),
    'wetness': ('std_msgs/msg/Float64', 1, _data),
    'friction': ('std_msgs/msg/Float64', 1, _data),
    'friction_margin': ('std_msgs/msg/Float64', 1, _data),
    'doubt': ('std_msgs/msg/String', 1, _doubt),
    'morphology': ('std_msgs/msg/String', 1, _is_dome),
}
_BODY = -1  # in place of a leg's number, for the body's pose


@dataclasses.dataclass
class _Series:
    """Times in ns and numbers of the messages on one topic."""

    width: int
    stamps: array[int] = dataclasses.field(default_factory=lambda: array('q'))
    values: array[float] = dataclasses.field(default_factory=lambda: array('d'))

    def at(self, grid: np.ndarray) -> np.ndarray:
        """Return the last numbers not after each time of the grid: (len(grid), width)."""
        stamps = np.array(self.stamps, dtype=np.int64)
        values = np.array(self.values).reshape(len(stamps), self.width)
        order = np.argsort(stamps, kind='stable')
        rows = np.searchsorted(stamps[order], grid, side='right')
        first = np.full((1, self.width), np.nan)
        return np.concatenate([first, values[order]])[rows]


def load(
    folder: str | os.PathLike[str],
    namespace: str | None = None,
    progress: Progress | None = None,
    remaps: Mapping[str, str] | None = None,
) -> Trial:
    """Read a trial from a bag.

    Parameters
    ----------
    folder : path
        Of the bag, or one MCAP file.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.
    remaps : mapping or None
        See :func:`wanted_topics`.

    Returns
    -------
    Trial
        Fast series have a row for each time stamp of a wrench, slow series for each estimate of
        wetness or, without estimates, for each pressure. Times of day become seconds since the
        first message, and ``settings['recorded']`` then says when that was, in UTC.

    Raises
    ------
    BagError
        When there is no such bag, when it has no topic of a leg or several robots, or when a
        topic has another message type than ros_pad gives it.
    """
    bag = BagReader(folder)
    wanted = wanted_topics(bag, namespace, remaps)
    series = {key: _Series(_KINDS[key[1]][1]) for key in wanted.values()}
    _read(bag, wanted, series, progress)
    legs = tuple(sorted({leg for leg, _ in series if leg != _BODY}))

    def grid(*kinds: str) -> np.ndarray:
        """Return the time stamps of the leg that was heard most often."""
        for kind in kinds:
            heard = [series[leg, kind].stamps for leg in (*legs, _BODY) if (leg, kind) in series]
            if heard:
                return np.unique(np.array(max(heard, key=len), dtype=np.int64))
        return np.empty(0, dtype=np.int64)

    def column(kind: str, leg: int, times: np.ndarray) -> np.ndarray:
        return series.get((leg, kind), _Series(_KINDS[kind][1])).at(times)

    def fast(kind: str) -> np.ndarray:
        return np.stack([column(kind, leg, fast_ns) for leg in legs], axis=1)

    def slow(kind: str) -> np.ndarray:
        return np.concatenate([column(kind, leg, slow_ns) for leg in legs], axis=1)

    fast_ns = grid('wrench', 'position', 'body/pose')
    slow_ns = grid('wetness', 'pressure', *_KINDS)
    trial = _described(bag)
    zero_ns = 0
    if bag.start > _FIRST_DATE_NS:
        zero_ns = bag.start
        moment = datetime.datetime.fromtimestamp(bag.start // 10**9, datetime.UTC)
        trial['settings']['recorded'] = f'{moment:%Y-%m-%d %H:%M:%S} UTC'
    if bag.problem:
        trial['settings']['problem'] = bag.problem
    ambient = trial['settings']['ambient_pressure']
    return Trial(
        **trial,
        legs=legs,
        time=(fast_ns - zero_ns) * 1e-9,
        body=column('body/pose', _BODY, fast_ns),
        force=fast('wrench'),
        position=fast('position'),
        slow_time=(slow_ns - zero_ns) * 1e-9,
        pressure=slow('pressure') - ambient,
        setpoint=slow('pressure_setpoint') - ambient,
        wet_probability=slow('wetness'),
        friction=slow('friction'),
        margin=slow('friction_margin'),
        slip_speed=slow('slip'),
        slipping=slow('slipping') == 1.0,
        dome=slow('morphology') == 1.0,
        doubt=np.nan_to_num(slow('doubt'), nan=-1.0).astype(int),
    )


def _described(bag: BagReader) -> dict[str, Any]:
    """Return those fields of a trial that the label of a bag gives."""
    try:
        said = json.loads(bag.custom_data.get(KEY, '{}'))
        source = str(said.get('scene') or '')
        seed = int(said.get('seed') or 0)
        ambient = float(said.get('ambient_pressure', AMBIENT_PRESSURE))
        return {
            'scene': pathlib.PurePath(source).stem,
            'policy': str(said.get('policy') or ''),
            'fidelity': str(said.get('fidelity') or ''),
            'seed': seed,
            'floor': FloorPlan(**said['floor']).build(seed) if said.get('floor') else None,
            'metrics': Metrics(**said['metrics']) if said.get('metrics') else None,
            'settings': (said.get('settings') or {})
            | {
                'ambient_pressure': ambient,
                'lost': dict(json.loads(bag.custom_data.get(LOST, '{}'))),
                'repaired': REPAIR in bag.custom_data,
            },
            'real_time_factor': said.get('real_time_factor'),
        }
    except (AttributeError, TypeError, ValueError) as error:
        raise BagError(
            f'{bag.path}: custom data {KEY!r} does not describe a trial of ros_pad: {error}'
        ) from error


def message_type(kind: str) -> str:
    """Return the message type of a kind of topic, such as ``wetness``."""
    return _KINDS[kind][0]


def wanted_topics(
    bag: BagReader, namespace: str | None = None, remaps: Mapping[str, str] | None = None
) -> dict[str, tuple[int, str]]:
    """Return leg (-1 for the body's pose) and kind of each topic that a trial is read from.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag by its name in ros_pad, as in ROS: ``{'leg_1/wrench': '/ft'}``, or, for
        all legs, ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``. A topic without a slash before it is
        in the namespace.

    Raises
    ------
    BagError
        When there is no topic of a leg or several robots, or when a topic has another message
        type than ros_pad gives it.
    InvalidInput
        For a remap of what is no topic, or to what the bag does not have.
    """
    found: dict[str, dict[str, tuple[int, str]]] = {}
    for name, known_as in _names(bag, namespace, remaps or {}):
        match = _TOPIC.fullmatch(known_as)
        if not match or match['kind'] not in _KINDS or not bag.counts[name]:
            continue
        if (match['kind'] == 'body/pose') != (match['leg'] is None):
            continue
        expected = _KINDS[match['kind']][0]
        if bag.topics[name] != expected:
            raise BagError(f'{bag.path}: {name} is a {bag.topics[name]}: {expected} is needed')
        leg = int(match['leg'] or _BODY)
        found.setdefault(match['namespace'], {})[name] = leg, match['kind']
    robots = {
        prefix: topics
        for prefix, topics in found.items()
        if any(leg != _BODY for leg, _ in topics.values())
    }
    if namespace is not None:
        prefix = _prefix(namespace)
        if prefix not in robots:
            raise BagError(f'{bag.path}: no legs in namespace {prefix}: {_listed(robots)}')
        return robots[prefix]
    if len(robots) != 1:
        raise BagError(f'{bag.path}: one robot is needed, there are {_listed(robots)}')
    return next(iter(robots.values()))


def _prefix(namespace: str | None) -> str:
    return f'/{(namespace or "").strip("/")}/'.replace('//', '/')


def _names(
    bag: BagReader, namespace: str | None, remaps: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Return each topic of a bag with the name that ros_pad knows it by, in full."""
    prefix = _prefix(namespace)
    renamed: dict[str, str] = {}  # topic of the bag by the name that ros_pad has for it
    for own, other in remaps.items():
        given = f'--remap {own}:={other}'
        kind = own.removeprefix('/').partition('/')[2]
        leg = own.removeprefix('/').partition('/')[0].removeprefix('leg_')
        if not (own == 'body/pose' or (kind in _KINDS and (leg.isdecimal() or leg == '{leg}'))):
            near = difflib.get_close_matches(kind or own, _KINDS, n=1)
            hint = f' Did you mean leg_{{leg}}/{near[0]}?' if near else ''
            raise InvalidInput(
                f'{given}: {own} is no topic of ros_pad.{hint} Allowed: body/pose, and'
                f' leg_{{leg}}/ or leg_1/ before one of'
                f' {", ".join(each for each in _KINDS if "/" not in each)}'
            )
        if (leg == '{leg}') != ('{leg}' in other):
            raise InvalidInput(f'{given}: {{leg}} is needed on both sides, or on none')
        full = other if other.startswith('/') else prefix + other
        pattern = re.escape(full).replace(r'\{leg\}', r'(?P<leg>\d+)', 1)
        pattern = pattern.replace(r'\{leg\}', '(?P=leg)')
        fits = [match for topic in bag.topics if (match := re.fullmatch(pattern, topic))]
        if not fits:
            near = difflib.get_close_matches(full, bag.topics, n=3, cutoff=0.0)
            raise InvalidInput(
                f'{given}: {bag.path} has no topic {full}, the nearest are {", ".join(near)}'
            )
        for match in fits:
            number = match.groupdict().get('leg') or leg
            name = own.removeprefix('/').replace('{leg}', number)
            if renamed.setdefault(prefix + name, match[0]) != match[0]:
                raise InvalidInput(
                    f'{given}: {name} is {renamed[prefix + name]} already, by another remap'
                )
    moved = set(renamed.values())
    return [
        *((topic, name) for name, topic in renamed.items()),
        *((topic, topic) for topic in bag.topics if topic not in moved | set(renamed)),
    ]


def _listed(robots: Iterable[str]) -> str:
    return ', '.join(f'legs in {prefix}' for prefix in sorted(robots)) or 'no topics of legs'


def _read(
    bag: BagReader,
    wanted: dict[str, tuple[int, str]],
    series: dict[tuple[int, str], _Series],
    progress: Progress | None,
) -> None:
    """Fill the series from the messages of a bag."""
    total = sum(bag.counts[name] for name in wanted)
    readers = {}
    for name, (leg, kind) in wanted.items():
        one = series[leg, kind]
        readers[name] = one.stamps.append, one.values.extend, _KINDS[kind][2]
    for number, (name, message, log_ns) in enumerate(bag.messages(wanted)):
        add_stamp, add_values, numbers = readers[name]
        add_values(numbers(message))
        header = getattr(message, 'header', None)
        stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec if header else 0
        # What has no stamp, or one that its driver did not fill in, came when it was recorded.
        add_stamp(stamp_ns or log_ns)
        if progress and number % _REPORT_EVERY == 0:
            progress(number / total)
    if progress:
        progress(1.0)


__all__ = ['load', 'message_type', 'wanted_topics']

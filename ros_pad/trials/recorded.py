# SPDX-License-Identifier: Apache-2.0
"""Read trials from bags, simulated or of a robot: their series and metrics.

A bag of ``pad run`` gives the same series as the loop without ROS to the bit, with two exceptions:
the body's heading, which is published as a quaternion (1e-15 rad), and pressures that are no whole
number of Pa, because absolute pressures are published (1e-11 Pa). The bag of a robot may have
other rates, gaps, missing legs and a namespace: a series repeats the last message, and is NaN
before the first one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import difflib
import json
import math
import os
import pathlib
import re
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.recovery import KEY as REPAIR
from ros_pad.bags.topics import DIAGNOSTICS
from ros_pad.bags.topics import OF_BODY
from ros_pad.bags.topics import STAMP
from ros_pad.bags.topics import TRIAL
from ros_pad.bags.topics import Topic
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.estimation import DOUBTS
from ros_pad.pace import LATE
from ros_pad.pace import Progress
from ros_pad.pace import part
from ros_pad.simulation.scene import FloorPlan
from ros_pad.trials.label import AMBIENT_PRESSURE
from ros_pad.trials.label import KEY
from ros_pad.trials.label import LOST
from ros_pad.trials.label import RECORDED_AT
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial
from ros_pad.trials.trial import heading

_TOPIC = re.compile(r'(?P<namespace>.*?/)(?:leg_(?P<leg>\d+)/)?(?P<kind>\w+(?:/pose|/doubt)?)')
# A log time after 2001 is a date, an earlier one is simulated time.
_FIRST_DATE_NS = 10**18


def _doubt_code(text: str) -> float:
    kind = text.partition(':')[0]
    return DOUBTS.index(kind) if kind in DOUBTS else -1


def _is_dome(text: str) -> float:
    return text == 'dome'


_CODES: dict[str, Callable[[str], float]] = {'doubt': _doubt_code, 'morphology': _is_dome}
"""Functions that turn the text of a message into a number, by kind of topic."""

OF_ROBOT = -1
"""In place of the number of a leg, for what a robot has only once."""


def _each(function: Callable[..., float], values: np.ndarray) -> np.ndarray:
    """Apply a function of ``math`` to the rows of the last axis.

    The loop without ROS uses ``math``; NumPy's functions differ from it in the last bit.
    """
    columns = values.reshape(-1, values.shape[-1]).T.tolist()
    return np.reshape(list(map(function, *columns)), values.shape[:-1])


@dataclasses.dataclass
class _Series:
    """Time stamps, ns, and values of the messages on one topic, in the order of the stamps."""

    stamps: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, topic: Topic, log_times: np.ndarray, table: np.ndarray) -> _Series:
        """Return the series of a table of the values and, if the topic has them, stamps."""
        width = len(topic.values)
        stamps, values = log_times, table[:, :width]
        if topic.frame:
            seconds, nanoseconds = table[:, width:].astype(np.int64).T
            stamps = seconds * 10**9 + nanoseconds
            # A driver may leave the stamp empty.
            stamps = np.where(stamps == 0, log_times, stamps)
        if code := _CODES.get(topic.kind):
            values = np.array([[code(text)] for (text,) in values]).reshape(len(stamps), width)
        order = np.argsort(stamps, kind='stable')
        return cls(stamps[order], values[order])

    def at(self, grid: np.ndarray) -> np.ndarray:
        """Return the last values up to each time, ns, of the grid: shape (len(grid), width)."""
        rows = np.searchsorted(self.stamps, grid, side='right')
        first = np.full((1, self.values.shape[1]), np.nan)
        return np.concatenate([first, self.values])[rows]


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
        Folder of a bag, or one MCAP file.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.
    remaps : mapping or None
        Topics with other names, see :func:`wanted_topics`.

    Returns
    -------
    Trial
        Fast series have a row for each time stamp of a wrench, slow series a row for each estimate
        of wetness or, without estimates, for each pressure. If the times are dates, they become
        seconds since the first message, whose date is in ``settings['recorded']``, in UTC.

    Raises
    ------
    BagError
        When there is no such bag, when it has no topic of a leg or several robots, when a topic
        has another message type than in ros_pad, or when its custom data are not those of ros_pad.
    InvalidInput
        When a remap is not allowed.
    """
    bag = BagReader(folder, part(progress, 0.0, 0.4))
    wanted = wanted_topics(bag, namespace, remaps)
    first = 0.4 if bag.problem else 0.0  # a bag without damage is opened at once
    series = _read(bag, wanted, part(progress, first, 0.8))
    legs = tuple(sorted({leg for leg, _ in series if leg != OF_ROBOT}))

    def columns(kind: str, times: np.ndarray) -> np.ndarray:
        return np.stack([_column(series, kind, leg, times) for leg in legs], axis=1)

    def slow(kind: str) -> np.ndarray:
        return columns(kind, slow_ns)[:, :, 0]

    fast_ns = _grid(series, 'wrench', 'position', 'body/pose', 'odom')
    slow_ns = _grid(series, 'wetness', 'pressure', *TRIAL)
    slip = columns('slip', slow_ns)
    odom = np.zeros((0, 3))
    body = _pose_of(_column(series, 'body/pose', OF_ROBOT, fast_ns))
    if (OF_ROBOT, 'odom') in series:
        odom = _pose_of(np.delete(_column(series, 'odom', OF_ROBOT, fast_ns), 2, axis=1))
        if (OF_ROBOT, 'body/pose') not in series:
            body = odom
    trial = _described(bag)
    zero_ns = 0
    if bag.start > _FIRST_DATE_NS:
        zero_ns = bag.start
        moment = datetime.datetime.fromtimestamp(bag.start // 10**9, datetime.UTC)
        trial['settings']['recorded'] = f'{moment:%Y-%m-%d %H:%M:%S} UTC'
    if bag.problem:
        trial['settings']['problem'] = bag.problem
    trial['settings']['late'] = []
    with contextlib.suppress(BagError):  # a trial can be read without it
        trial['settings']['late'] = late(bag, part(progress, 0.8, 1.0))
    if progress:
        progress(1.0)
    ambient = trial['settings']['ambient_pressure']
    found = Trial(
        **trial,
        legs=legs,
        time=(fast_ns - zero_ns) * 1e-9,
        body=body,
        force=columns('wrench', fast_ns),
        position=columns('position', fast_ns),
        slow_time=(slow_ns - zero_ns) * 1e-9,
        pressure=slow('pressure') - ambient,
        setpoint=slow('pressure_setpoint') - ambient,
        wet_probability=slow('wetness'),
        friction=slow('friction'),
        margin=slow('friction_margin'),
        slip_speed=_each(math.hypot, slip[:, :, :2]),
        slipping=slow('slipping') == 1.0,
        dome=slow('morphology') == 1.0,
        doubt=np.nan_to_num(slow('doubt'), nan=-1.0).astype(int),
        odom=odom,
    )
    if len(odom):
        found.move_to_world()
    return found


def _pose_of(values: np.ndarray) -> np.ndarray:
    """Return x and y, m, and heading, rad, of positions x, y and quaternions: shape (n, 3)."""
    return np.column_stack([values[:, :2], _each(heading, values[:, 2:])])


def late(bag: BagReader, progress: Progress | None = None) -> list[str]:
    """Return a line for each node that reported on ``/diagnostics`` that it did not keep up.

    The callback is called now and then with the share that is done, 0 to 1.
    """
    if bag.custom_data.get(RECORDED_AT) == 'publisher':
        return []  # composed nodes wait for one another
    if bag.topics.get(DIAGNOSTICS.pattern) != DIAGNOSTICS.type_name:
        return []
    found: dict[str, list[tuple[float, str]]] = {}
    for _, array, log_ns in bag.messages([DIAGNOSTICS.pattern], LATE.encode(), progress):
        for status in array.status:
            if status.message.startswith(LATE):
                seconds = (log_ns - bag.start) * 1e-9
                found.setdefault(status.name, []).append((seconds, status.message))
    return [
        f'{name}, reported {len(each)} times from {each[0][0]:.1f} s on: {each[-1][1]}'
        for name, each in found.items()
    ]


def _grid(series: Mapping[tuple[int, str], _Series], *kinds: str) -> np.ndarray:
    """Return the time stamps, ns, of the first of these kinds that was recorded.

    They are those of the leg with the most messages of this kind.
    """
    for kind in kinds:
        stamps = [series[key].stamps for key in sorted(series) if key[1] == kind]
        if stamps:
            return np.unique(max(stamps, key=len))
    return np.empty(0, dtype=np.int64)


def _column(
    series: Mapping[tuple[int, str], _Series], kind: str, leg: int, times: np.ndarray
) -> np.ndarray:
    if (leg, kind) not in series:
        return np.full((len(times), len(TRIAL[kind].values)), np.nan)
    return series[leg, kind].at(times)


def _described(bag: BagReader) -> dict[str, Any]:
    """Return the fields of a trial that follow from the custom data of a bag."""
    try:
        noted = json.loads(bag.custom_data.get(KEY, '{}'))
        source = str(noted.get('scene') or '')
        seed = int(noted.get('seed') or 0)
        plan = FloorPlan(**noted['floor']) if noted.get('floor') else None
        ambient = float(noted.get('ambient_pressure', AMBIENT_PRESSURE.default))
        return {
            'scene': pathlib.PurePath(source).stem,
            'policy': str(noted.get('policy') or ''),
            'fidelity': str(noted.get('fidelity') or ''),
            'seed': seed,
            'floor': partial(plan.build, seed) if plan else None,
            'metrics': Metrics(**noted['metrics']) if noted.get('metrics') else None,
            'settings': (noted.get('settings') or {})
            | {
                'ambient_pressure': ambient,
                'lost': dict(json.loads(bag.custom_data.get(LOST, '{}'))),
                'repaired': REPAIR in bag.custom_data,
            },
            'real_time_factor': noted.get('real_time_factor'),
        }
    except (AttributeError, TypeError, ValueError) as error:
        raise BagError(
            f'{bag.path}: custom data {KEY!r} does not describe a trial of ros_pad: {error}'
        ) from error


def wanted_topics(
    bag: BagReader, namespace: str | None = None, remaps: Mapping[str, str] | None = None
) -> dict[str, tuple[int, str]]:
    """Return leg (-1 for those of the body) and kind of each topic that a trial is read from.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag, by its name in ros_pad: ``{'leg_1/wrench': '/ft'}``, or, for all legs,
        ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``. As in ROS, a topic that does not begin with a
        slash is in the namespace.

    Raises
    ------
    BagError
        When there is no topic of a leg or several robots, or when a topic has another message
        type than in ros_pad.
    InvalidInput
        When a remap is of a topic that ros_pad does not have, or to one that the bag does not
        have; when two remaps name the same topic, or only one side of a remap has ``{leg}``.
    """
    found: dict[str, dict[str, tuple[int, str]]] = {}
    for name, own_name in _names(bag, namespace, remaps or {}):
        match = _TOPIC.fullmatch(own_name)
        if not match or match['kind'] not in TRIAL or not bag.counts[name]:
            continue
        if (match['kind'] in OF_BODY) != (match['leg'] is None):
            continue
        expected = TRIAL[match['kind']].type_name
        if bag.topics[name] != expected:
            raise BagError(f'{bag.path}: {name} is a {bag.topics[name]}: {expected} is needed')
        leg = int(match['leg'] or OF_ROBOT)
        found.setdefault(match['namespace'], {})[name] = leg, match['kind']
    robots = {
        prefix: topics
        for prefix, topics in found.items()
        if any(leg != OF_ROBOT for leg, _ in topics.values())
    }
    if namespace is not None:
        prefix = _prefix(namespace)
        if prefix not in robots:
            raise BagError(
                f'{bag.path}: no legs in namespace {prefix}; the bag has {_listed(robots)}'
            )
        return robots[prefix]
    if len(robots) != 1:
        raise BagError(f'{bag.path}: one robot is needed, the bag has {_listed(robots)}')
    return next(iter(robots.values()))


def _prefix(namespace: str | None) -> str:
    return f'/{(namespace or "").strip("/")}/'.replace('//', '/')


def _names(
    bag: BagReader, namespace: str | None, remaps: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Return pairs of each topic of a bag and its full name in ros_pad after the remaps."""
    prefix = _prefix(namespace)
    renamed: dict[str, str] = {}  # topic of the bag by its name in ros_pad
    for own, other in remaps.items():
        given = f'--remap {own}:={other}'
        kind = own.removeprefix('/').partition('/')[2]
        leg = own.removeprefix('/').partition('/')[0].removeprefix('leg_')
        if not (own in OF_BODY or (kind in TRIAL and (leg.isdecimal() or leg == '{leg}'))):
            near = difflib.get_close_matches(kind or own, TRIAL, n=1)
            hint = f' Did you mean leg_{{leg}}/{near[0]}?' if near else ''
            raise InvalidInput(
                f'{given}: {own} is no topic of ros_pad.{hint} Allowed: {", ".join(OF_BODY)}, and'
                f' leg_{{leg}}/ or leg_1/ before one of'
                f' {", ".join(each for each in TRIAL if each not in OF_BODY)}'
            )
        if (leg == '{leg}') != ('{leg}' in other):
            raise InvalidInput(f'{given}: {{leg}} is needed on both sides of := or on neither')
        full = other if other.startswith('/') else prefix + other
        pattern = re.escape(full).replace(r'\{leg\}', r'(?P<leg>\d+)', 1)
        pattern = pattern.replace(r'\{leg\}', '(?P=leg)')
        matches = [match for topic in bag.topics if (match := re.fullmatch(pattern, topic))]
        if not matches:
            near = difflib.get_close_matches(full, bag.topics, n=3, cutoff=0.0)
            raise InvalidInput(
                f'{given}: {bag.path} has no topic {full}; similar ones are {", ".join(near)}'
            )
        for match in matches:
            number = match.groupdict().get('leg') or leg
            name = own.removeprefix('/').replace('{leg}', number)
            if renamed.setdefault(prefix + name, match[0]) != match[0]:
                raise InvalidInput(
                    f'{given}: another remap already takes {name} from {renamed[prefix + name]}'
                )
    moved = set(renamed.values())
    return [
        *((topic, name) for name, topic in renamed.items()),
        *((topic, topic) for topic in bag.topics if topic not in moved | set(renamed)),
    ]


def _listed(robots: Iterable[str]) -> str:
    return ', '.join(f'legs in {prefix}' for prefix in sorted(robots)) or 'no topics of legs'


def _read(
    bag: BagReader, wanted: Mapping[str, tuple[int, str]], progress: Progress
) -> dict[tuple[int, str], _Series]:
    """Return the series of the topics of a bag by leg and kind."""
    topics = {name: TRIAL[kind] for name, (_, kind) in wanted.items()}
    paths = {
        name: (*topic.values, *(STAMP if topic.frame else ())) for name, topic in topics.items()
    }
    tables = bag.tables(paths, progress)
    return {key: _Series.of(topics[name], *tables[name]) for name, key in wanted.items()}


__all__ = ['late', 'load', 'wanted_topics']

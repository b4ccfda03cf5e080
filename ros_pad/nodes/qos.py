# SPDX-License-Identifier: Apache-2.0
"""The QoS profiles of ros_pad by name, and their form in a bag."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from enum import IntEnum

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

SENSOR = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Subscribe to measurements: only recent ones are kept, and any driver's publisher matches."""

SENSOR_PUBLISH = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Publish measurements and estimates: reliable and best-effort subscribers both match."""

RECORDS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Subscribe to records: a node that pauses for some tenths of a second loses none."""

COMMAND = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
"""Publish set-points, or subscribe to them: only the newest is kept, and it must arrive."""

COMMANDS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Commands: one may lack the legs of the one before it."""

STATE = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Latched state such as the morphology: a late subscriber receives the last one."""

CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Subscribe to ``/clock``, as rclpy itself does."""

CLOCK_PUBLISH = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
"""Publish ``/clock``."""

DIAGNOSTICS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""``/diagnostics``, as diagnostic_updater publishes it."""

RECORD = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""Record a topic whose publishers are reliable.

A queue of fixed depth drops messages; with this profile every message waits until it is taken.
"""


def recording(offered: Sequence[QoSProfile], measured: bool = False) -> QoSProfile:
    """Return the strictest profile that matches every publisher of a topic.

    Parameters
    ----------
    offered : sequence of QoSProfile
        Profiles of the publishers. A single best-effort one makes the subscription best effort,
        a single volatile one makes it volatile. Without publishers, it is :data:`RECORD`.
    measured : bool
        Whether to be best effort anyway, as other subscribers of measurements are. Acknowledging
        6,000 messages a second takes a sixth more processor time of all nodes; a publisher keeps
        ten messages for repetition, the shared memory of one computer holds more.
    """
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in offered) and not measured
    latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return QoSProfile(
        history=RECORD.history,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if offered and latched else DurabilityPolicy.VOLATILE
        ),
    )


_INFINITE_NS = 2**63 - 1  # RMW_DURATION_INFINITE


@dataclasses.dataclass(frozen=True)
class Mismatch:
    """A policy for which DDS does not match a publisher and a subscription, with both values."""

    policy: str
    offered: str
    asked: str


def mismatches(offered: QoSProfile, asked: QoSProfile) -> list[Mismatch]:
    """Return the policies in which a publisher offers less than a subscription requests.

    rclpy's ``qos_check_compatible`` treats an unspecified duration as a very short one, and
    reports mismatches that do not exist.
    """
    found = []
    for policy, strict in (
        ('reliability', ReliabilityPolicy.RELIABLE),
        ('durability', DurabilityPolicy.TRANSIENT_LOCAL),
        ('liveliness', LivelinessPolicy.MANUAL_BY_TOPIC),
    ):
        given, wanted = getattr(offered, policy), getattr(asked, policy)
        if wanted == strict and given != strict:
            found.append(Mismatch(policy, _word(given), _word(wanted)))
    for policy in ('deadline', 'liveliness_lease_duration'):
        given_ns, wanted_ns = (_bound(getattr(each, policy)) for each in (offered, asked))
        if given_ns > wanted_ns:
            found.append(Mismatch(policy, _seconds(given_ns), _seconds(wanted_ns)))
    return found


def _word(policy: IntEnum) -> str:
    """Return a policy as bags have it, ``unknown`` where it is left to the middleware."""
    if policy == LivelinessPolicy.SYSTEM_DEFAULT and isinstance(policy, LivelinessPolicy):
        return 'automatic'
    word = policy.name.lower()
    return 'unknown' if word in ('system_default', 'best_available') else word


def _bound(duration: Duration) -> int:
    """Return a duration in ns; zero means unspecified, which is infinite."""
    return duration.nanoseconds or _INFINITE_NS


def _seconds(bound_ns: int) -> str:
    return 'infinite' if bound_ns >= _INFINITE_NS else f'{bound_ns * 1e-9:g} s'


def offered_profiles(*profiles: QoSProfile) -> str:
    """Return profiles as YAML text, in the form that bags of ROS 2 Jazzy have.

    A policy left to the middleware becomes ``unknown``, and a duration of zero, which means
    unspecified, becomes infinite.
    """

    def duration(value: Duration) -> dict[str, int]:
        seconds, nanoseconds = divmod(_bound(value), 10**9)
        return {'sec': seconds, 'nsec': nanoseconds}

    return yaml.safe_dump(
        [
            {
                'history': _word(profile.history),
                'depth': profile.depth,
                'reliability': _word(profile.reliability),
                'durability': _word(profile.durability),
                'deadline': duration(profile.deadline),
                'lifespan': duration(profile.lifespan),
                'liveliness': _word(profile.liveliness).replace('unknown', 'automatic'),
                'liveliness_lease_duration': duration(profile.liveliness_lease_duration),
                'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions,
            }
            for profile in profiles
        ],
        sort_keys=False,
    )

# SPDX-License-Identifier: Apache-2.0
"""Run walks of the closed loop with parts that a study can replace before the first sample."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ros_pad.simulation.scene import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop


class NoLog(TrialLog):
    """A log that keeps nothing."""

    def __init__(self) -> None:
        pass

    def sample(self, *_: Any) -> None:
        """Ignore a sample."""

    def control(self, *_: Any) -> None:
        """Ignore a control step."""


def samples(loop: ClosedLoop, scene: Scene, log: TrialLog | None = None) -> Iterator[None]:
    """Walk a scene and yield after each sample, until the scene ends or a verdict ends it early.

    The loop is closed afterwards.
    """
    log = log or NoLog()
    try:
        for _ in range(round(scene.duration * 1e9) // loop.period_ns):
            loop.tick(log)
            yield
            if loop.robot.verdict:
                break
    finally:
        loop.close()


def walk(loop: ClosedLoop, scene: Scene, log: TrialLog | None = None) -> None:
    """Walk a scene until it ends or a verdict ends it early."""
    for _ in samples(loop, scene, log):
        pass

# SPDX-License-Identifier: Apache-2.0
"""Walk a scene with other policies, in processes beside this one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from typing import TypeAlias

from ros_pad import workers
from ros_pad.estimation.tuning import Tuning
from ros_pad.pace import Progress
from ros_pad.simulation.scene import Scene
from ros_pad.trials import loop
from ros_pad.trials.trial import Metrics, Trial

SHORTEST = 15.0
"""Duration of a scene, s, from which processes are worth their start."""

Bar: TypeAlias = 'Callable[[str, float], AbstractContextManager[Progress]]'
"""Shows the progress of a text up to a total."""


class Others:
    """Walks that may be under way in other processes."""

    def __init__(
        self,
        scene: Scene,
        policies: Sequence[str],
        seed: int,
        level: str,
        sensing: str = 'markers',
        tuning: Tuning | None = None,
    ) -> None:
        self._duration, self._policies = scene.duration, policies
        self._run = partial(
            loop.run, scene, seed=seed, fidelity=level, tuning=tuning, sensing=sensing
        )
        self._walks: dict[str, Future[Trial]] = {}

    @contextmanager
    def beside(self) -> Iterator[Others]:
        """Walk in other processes until the block ends, if the scene is not too short."""
        count = min(workers.cores(), len(self._policies))
        if not count or self._duration < SHORTEST:
            yield self
            return
        with workers.pool(count, os.nice, 5) as executor:  # behind the trial itself
            for policy in self._policies:
                self._walks[policy] = executor.submit(self._run, policy=policy)
            yield self

    def metrics(self, bar: Bar) -> dict[str, Metrics]:
        """Return the metrics of the walks by policy; what no process walks is walked here.

        Raises
        ------
        PadError
            As :func:`ros_pad.trials.loop.run`.
        """
        found = {}
        for policy in self._policies:
            with bar(f'{policy:8} on the same ground', self._duration) as progress:
                trial = None
                with suppress(BrokenProcessPool):  # killed, possibly for lack of memory
                    trial = self._walks[policy].result() if policy in self._walks else None
                trial = trial or self._run(policy=policy, progress=progress)
            if trial.metrics:
                found[policy] = trial.metrics
        return found

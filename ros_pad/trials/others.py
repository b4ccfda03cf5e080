# SPDX-License-Identifier: Apache-2.0
"""Walk a scene with other policies, in processes beside this one."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, MutableSequence, Sequence
from concurrent.futures import Executor, Future
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

NICENESS = 5
"""How much the other processes stand back behind the trial itself, see nice(2)."""

Bar: TypeAlias = 'Callable[[str, float], AbstractContextManager[Progress]]'
"""Shows the progress of a text up to a total."""

_POLL = 0.1  # s, time between two looks at the progress of other processes
_reached: MutableSequence[float]  # simulated time of each walk, s; only in other processes


def _share(reached: MutableSequence[float]) -> None:
    global _reached  # the only way to pass an array to a process of a pool
    _reached = reached
    os.nice(NICENESS)


def _walk(run: Callable[..., Trial], policy: str, place: int) -> Metrics | None:
    def progress(seconds: float) -> None:
        _reached[place] = seconds

    return run(policy=policy, progress=progress).metrics


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
        self._duration = scene.duration
        self._run = partial(
            loop.run, scene, seed=seed, fidelity=level, tuning=tuning, sensing=sensing
        )
        self._policies = policies
        self._left: deque[str] = deque()  # not begun
        self._reached: MutableSequence[float] = []
        self._walks: dict[str, Future[Metrics | None]] = {}

    @contextmanager
    def beside(self) -> Iterator[Others]:
        """Walk in other processes as far as there are cores, until the block ends."""
        free = min(workers.cores() - 1, len(self._policies))
        if free < 1 or self._duration < SHORTEST:
            yield self
            return
        # Without a lock, which a killed process might keep.
        self._reached = workers.CONTEXT.RawArray('d', len(self._policies))
        self._left.extend(self._policies)
        with workers.pool(free, _share, self._reached) as executor:
            for _ in range(free):
                self._begin(executor)
            yield self
            self._left.clear()

    def _begin(self, executor: Executor) -> None:
        """Begin the next walk, and another one when it ends."""
        try:
            policy = self._left.popleft()
        except IndexError:
            return
        place = self._policies.index(policy)
        with suppress(RuntimeError):  # the executor has ended, or its processes were killed
            walk = executor.submit(_walk, self._run, policy, place)
            self._walks[policy] = walk
            walk.add_done_callback(lambda _: self._begin(executor))

    def metrics(self, bar: Bar) -> dict[str, Metrics]:
        """Return the metrics of the walks by policy; what has not begun is walked here.

        Raises
        ------
        PadError
            As :func:`ros_pad.trials.loop.run`.
        """
        found: dict[str, Metrics | None] = {}
        while True:
            try:
                policy = self._left.pop()  # from the last on: the others begin with the first
            except IndexError:
                break
            found[policy] = self._here(policy, bar)
        for place, policy in enumerate(self._policies):
            if policy not in found:
                try:
                    found[policy] = self._awaited(policy, place, bar)
                except (KeyError, BrokenProcessPool):  # killed, possibly for lack of memory
                    found[policy] = self._here(policy, bar)
        return {policy: each for policy in self._policies if (each := found[policy]) is not None}

    def _here(self, policy: str, bar: Bar) -> Metrics | None:
        with bar(_text(policy), self._duration) as progress:
            return self._run(policy=policy, progress=progress).metrics

    def _awaited(self, policy: str, place: int, bar: Bar) -> Metrics | None:
        walk = self._walks[policy]
        with bar(_text(policy), self._duration) as progress:
            while not walk.done():
                progress(self._reached[place])
                time.sleep(_POLL)
            return walk.result()


def _text(policy: str) -> str:
    return f'{policy:8} on the same ground'

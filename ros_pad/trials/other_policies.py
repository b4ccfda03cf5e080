# SPDX-License-Identifier: Apache-2.0
"""Walk a scene with other policies, in processes beside this one."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
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


@contextmanager
def beside(
    scene: Scene,
    policies: Sequence[str],
    seed: int,
    level: str,
    sensing: str,
    tuning: Tuning | None,
    alone: bool = False,
) -> Iterator[Callable[[Bar], dict[str, Metrics]]]:
    """Walk in other processes until the block ends, unless the scene is short, or ``alone``.

    Yield a function that returns the metrics by policy; what no process walks is walked by it.
    """
    run = partial(loop.run, scene, seed=seed, fidelity=level, tuning=tuning, sensing=sensing)
    walks: dict[str, Future[Trial]] = {}

    def metrics(bar: Bar) -> dict[str, Metrics]:
        found = {}
        for policy in policies:
            with bar(f'{policy:8} on the same ground', scene.duration) as progress:
                trial = None
                with suppress(BrokenProcessPool):  # killed, possibly for lack of memory
                    trial = walks[policy].result() if policy in walks else None
                trial = trial or run(policy=policy, progress=progress)
            if trial.metrics:
                found[policy] = trial.metrics
        return found

    with ExitStack() as stack:
        if policies and not alone and scene.duration >= SHORTEST:
            count = min(workers.cores(), len(policies))
            pool = stack.enter_context(workers.pool(count, os.nice, 5))  # behind the trial itself
            walks |= {policy: pool.submit(run, policy=policy) for policy in policies}
        yield metrics

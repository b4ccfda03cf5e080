# SPDX-License-Identifier: Apache-2.0
"""Processes that work for this one, and end with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any

from ros_pad.signals import children_spared

CONTEXT = multiprocessing.get_context('spawn')
"""Makes what the processes share."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def pool(
    count: int, start: Callable[..., object] | None = None, *given: Any
) -> Iterator[Executor]:
    """Open a number of processes, which are ended with the block, whatever they do.

    Parameters
    ----------
    count : int
        Number of processes.
    start : callable, optional
        Called in each of them first.
    *given
        Arguments of `start`.
    """
    alive, parent = CONTEXT.Pipe(duplex=False)
    executor = ProcessPoolExecutor(count, CONTEXT, _start, (alive, start, *given))
    with children_spared():
        for _ in range(count):
            executor.submit(int)  # starts a process
    try:
        yield executor
    finally:
        parent.close()  # ends processes that still run
        executor.shutdown(cancel_futures=True)
        alive.close()


def _start(alive: Connection, start: Callable[..., object] | None, *given: Any) -> None:
    # Ctrl-C in a terminal reaches all processes; only the first process shall act on it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, args=(alive,), daemon=True).start()
    if start:
        start(*given)


def _end_with_parent(alive: Connection) -> None:
    """End this process when the first process closes its end of a pipe, or is killed."""
    with suppress(EOFError, OSError):
        alive.recv_bytes()
    os._exit(1)

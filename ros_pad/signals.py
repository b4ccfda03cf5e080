# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM: the first ends the work in order, the second is ignored, the third kills.

This module imports nothing heavy, so that a process can call ``STOP.install`` before it imports
the rest.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

INTERRUPTED = 130  # exit status after Ctrl-C, the same as in shells
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_AGAIN = 0.01  # time until an interrupt that Python has dropped is raised again, s


def interrupt() -> None:
    """Raise KeyboardInterrupt: the action of work that can be left at any place."""
    sys.unraisablehook = _raise_again
    raise KeyboardInterrupt


def _raise_again(dropped: sys.UnraisableHookArgs) -> None:
    """Raise an interrupt soon again that Python has dropped, as it does in a destructor."""
    if dropped.exc_type is KeyboardInterrupt:
        signal.signal(signal.SIGALRM, lambda number, frame: STOP.act())
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)
    else:
        sys.__unraisablehook__(dropped)


def end(text: str = '') -> None:
    """End the process at once, with status 130: the action while nothing is open yet.

    An exception would not do: Python prints and drops one that is raised in a callback of its
    imports.

    Parameters
    ----------
    text : str
        Written to stderr before.
    """
    os.write(2, text.encode())
    os._exit(INTERRUPTED)


def _wait() -> None:
    """Do nothing: the work looks at ``STOP.requested``."""


class Stop:
    """What SIGINT and SIGTERM do in this process; there is one, :data:`STOP`.

    Attributes
    ----------
    requested : bool
        Whether a signal has come since the handlers were installed.
    """

    def __init__(self) -> None:
        self.requested = False
        self._installed = False
        self._action: Callable[[], object] = _wait

    def install(self, text: str = '') -> None:
        """Handle signals until the process ends; outside :meth:`during` the first one ends it.

        Parameters
        ----------
        text : str
            Written to stderr when a signal ends the process.
        """
        self._install(partial(end, text))
        # Nothing is open any more, and the end of Python cannot handle signals.
        atexit.register(_set_handlers, signal.SIG_IGN)
        atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)

    def _install(self, action: Callable[[], object]) -> None:
        self.requested, self._installed, self._action = False, True, action
        _set_handlers(self._receive)

    def _receive(self, number: int, frame: object) -> None:
        if self.requested:
            # The third signal needs no Python, which may hang by then.
            _set_handlers(signal.SIG_DFL)
        else:
            self.requested = True
            self.act()

    def act(self) -> None:
        """Call the present action, as a first signal does."""
        self._action()

    @contextmanager
    def during(self, action: Callable[[], object] = _wait) -> Iterator[None]:
        """Let the first signal call an action; at once if it has come already.

        Blocks may be nested. Handlers that this block installs are removed at its end. In another
        thread than the main one, which receives no signals, the block has no effect.

        Parameters
        ----------
        action : callable
            Called without arguments between two steps of Python code; may raise. By default it
            does nothing, and the block looks at :attr:`requested`.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
        elif self._installed:
            before, self._action = self._action, action
            try:
                if self.requested:
                    action()
                yield
            finally:
                self._action = before
        else:
            handlers, hook = [signal.getsignal(each) for each in _SIGNALS], sys.unraisablehook
            self._install(action)
            try:
                yield
            finally:
                self._installed, sys.unraisablehook = False, hook
                _set_handlers(*handlers)

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Put off the action of a first signal to the end of this block."""
        before = self.requested
        with self.during():
            yield
        if self.requested and not before:
            self._action()


@contextmanager
def children_spared() -> Iterator[None]:
    """Keep SIGINT, which a terminal sends to all its processes, from those that start here.

    In this process it acts after the block.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_handlers(*handlers: object) -> None:
    """Set one handler for each signal, or the same one for all."""
    for index, number in enumerate(_SIGNALS):
        signal.signal(number, handlers[index % len(handlers)])  # type: ignore[arg-type]


STOP = Stop()
"""What SIGINT and SIGTERM do in this process."""

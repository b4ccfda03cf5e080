# SPDX-License-Identifier: Apache-2.0
"""Scripted dialogues, emulated devices, and waiting for what they do."""

import contextlib
import fcntl
import os
import select
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable
from collections.abc import Iterator
from typing import Any

import pytest

from ros_pad.errors import PadError
from ros_pad.regulators import Regulator
from ros_pad.regulators import create
from ros_pad.regulators.emulate import EMULATORS
from ros_pad.regulators.emulate import Emulator

LIMIT = 20.0  # s, for slow machines: no test that passes takes so long
PATIENT = {'reply_timeout': 1.0, 'silence': 5.0}  # so that a slow machine is no lost device


def wait_until(condition: Callable[[], Any], limit: float = LIMIT) -> Any:
    """Wait for a condition and return what it returned."""
    end = time.monotonic() + limit
    while not (found := condition()):
        assert time.monotonic() < end, f'not within {limit} s'
        time.sleep(0.002)
    return found


class Dialogue:
    """A device that knows its script by heart: what it must hear, what it says then.

    It ends well only when the driver said all of it in this order, said nothing else, and read
    everything.
    """

    def __init__(self, script: list[tuple[str, str]], terminator: str = '\r') -> None:
        self._script = [(said + terminator, reply) for said, reply in script]
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)
        self._closing = False
        self.problems: list[str] = []
        self.said = 0
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        heard = ''
        while not self._closing:
            if not select.select([self._near], [], [], 0.01)[0]:
                continue
            heard += os.read(self._near, 4096).decode('latin-1')
            if self.said == len(self._script):
                self.problems.append(f'heard {heard!r} after the end of the script')
                return
            while heard and self.said < len(self._script):
                expected, reply = self._script[self.said]
                # Only what needs no answer may be followed by more.
                if heard == expected or (heard.startswith(expected) and not reply):
                    heard = heard.removeprefix(expected)
                    self.said += 1  # before whoever waits for the reply can look
                    os.write(self._near, reply.encode('latin-1'))
                elif expected.startswith(heard):
                    break
                else:
                    self.problems.append(f'heard {heard!r}, the script has {expected!r}')
                    return

    @property
    def over(self) -> bool:
        return self.said == len(self._script) or bool(self.problems)

    def close(self) -> None:
        self._closing = True
        self._thread.join()
        unread = struct.unpack('i', fcntl.ioctl(self._far, termios.FIONREAD, b'\0' * 4))[0]
        for end in (self._near, self._far):
            os.close(end)
        if unread:
            self.problems.append(f'{unread} bytes of replies were left unread')
        if self.said < len(self._script):
            self.problems.append(f'never heard {self._script[self.said][0]!r}')


@pytest.fixture
def dialogue() -> Iterator[Callable[..., Dialogue]]:
    """Make a scripted device; at the end of the test it must have heard and been heard."""
    made: list[Dialogue] = []

    def make(script: list[tuple[str, str]], terminator: str = '\r') -> Dialogue:
        made.append(Dialogue(script, terminator))
        return made[-1]

    yield make
    for each in made:
        each.close()
        assert not each.problems


@pytest.fixture
def mute() -> Callable[..., Dialogue]:
    """Make a scripted device whose ending the test judges itself."""
    return Dialogue


@pytest.fixture
def emulated() -> Iterator[Callable[..., Any]]:
    """Make an emulated device on a port: (device, emulator)."""
    made: list[Emulator] = []

    def make(name: str, link: str | None = None, **options: Any) -> tuple[Any, Emulator]:
        device = EMULATORS[name](**options)
        made.append(Emulator(device, link))
        return device, made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def opened() -> Iterator[Callable[..., Regulator]]:
    """Make and open a regulator; it is closed at the end of the test."""
    made: list[Regulator] = []

    def make(backend: str, **options: Any) -> Regulator:
        regulator = create(backend, **(PATIENT | options))
        made.append(regulator)
        regulator.open()
        return regulator

    yield make
    for each in made:
        with contextlib.suppress(PadError):  # what was wrong is the test's matter
            each.close()


@pytest.fixture
def until() -> Callable[..., Any]:
    return wait_until

# SPDX-License-Identifier: Apache-2.0
"""Scripted dialogues, emulated devices, and a function that waits for a condition."""

import contextlib
import fcntl
import os
import select
import struct
import termios
import threading
import tty

import pytest
from shared import wait_for

from ros_pad.errors import PadError
from ros_pad.regulators import Regulator, create
from ros_pad.regulators.emulate import EMULATORS, Emulator

PATIENT = {'reply_timeout': 1.0, 'silence': 5.0}  # s: slow machines must not lose devices


class Dialogue:
    """A device with a script: the commands it must receive, and its replies.

    ``problems`` is empty only if the driver sent all commands in this order and nothing else, and
    read all replies.
    """

    def __init__(self, script, terminator='\r'):
        self._script = [(command + terminator, reply) for command, reply in script]
        self._near, self._far = os.openpty()
        tty.setraw(self._far)
        self.path = os.ttyname(self._far)
        self._closing = False
        self.problems: list[str] = []
        self.sent = 0
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        received = ''
        while not self._closing:
            if not select.select([self._near], [], [], 0.01)[0]:
                continue
            received += os.read(self._near, 4096).decode('latin-1')
            if self.sent == len(self._script):
                self.problems.append(f'received {received!r} after the end of the script')
                return
            while received and self.sent < len(self._script):
                expected, reply = self._script[self.sent]
                # Only a command without a reply may be followed by the next one at once.
                if received == expected or (received.startswith(expected) and not reply):
                    received = received.removeprefix(expected)
                    self.sent += 1  # before the reply can be read
                    os.write(self._near, reply.encode('latin-1'))
                elif expected.startswith(received):
                    break
                else:
                    self.problems.append(f'received {received!r}, the script has {expected!r}')
                    return

    @property
    def over(self):
        return self.sent == len(self._script) or bool(self.problems)

    def close(self):
        self._closing = True
        self._thread.join()
        unread = struct.unpack('i', fcntl.ioctl(self._far, termios.FIONREAD, b'\0' * 4))[0]
        for end in (self._near, self._far):
            os.close(end)
        if unread:
            self.problems.append(f'{unread} bytes of replies were left unread')
        if self.sent < len(self._script):
            self.problems.append(f'never received {self._script[self.sent][0]!r}')


@pytest.fixture
def dialogue():
    """Return a function that makes a scripted device; its script must be complete at the end."""
    made: list[Dialogue] = []

    def make(script, terminator='\r'):
        made.append(Dialogue(script, terminator))
        return made[-1]

    yield make
    for each in made:
        each.close()
        assert not each.problems


@pytest.fixture
def mute():
    """Return a function that makes a scripted device, whose end the test itself checks."""
    return Dialogue


@pytest.fixture
def emulated():
    """Return a function that makes an emulated device on a port: (device, emulator)."""
    made: list[Emulator] = []

    def make(name, link=None, **options):
        device = EMULATORS[name](**options)
        made.append(Emulator(device, link))
        return device, made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture
def opened():
    """Return a function that opens a regulator, which is closed at the end of the test."""
    made: list[Regulator] = []

    def make(backend, **options):
        regulator = create(backend, **(PATIENT | options))
        made.append(regulator)
        regulator.open()
        return regulator

    yield make
    for each in made:
        with contextlib.suppress(PadError):  # errors of close() are checked elsewhere
            each.close()


@pytest.fixture
def until():
    return wait_for

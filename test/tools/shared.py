# SPDX-License-Identifier: Apache-2.0
"""What tests of several rooms share: a wait, Python in a process of its own, and a device."""

from __future__ import annotations

import subprocess
import sys
import time

from ros_pad.errors import TransportError
from ros_pad.regulators import Reading
from ros_pad.regulators.protocol import permitted


def wait_for(condition, what='the condition', turn=lambda: time.sleep(0.01), seconds=300.0):
    """Call ``turn`` until a condition holds, and return what it is; fail after some seconds."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f'waited for {what}: timeout after {seconds:g} s'
        turn()
    return found


def python(*words, **options):
    """Run Python with arguments to its end; return status and what it wrote."""
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300.0, **options)


class Device:
    """A device whose pressure is its set-point; it keeps what it received; its cable may break."""

    made: tuple[Device, ...] = ()

    def __init__(self, ceiling=80e3, port='usb', clock=None, pad_volume=0.0):
        self.ceiling, self.port = ceiling, port
        self.setpoint, self.received = 40e3, []  # of an earlier user
        self.is_open = False
        self.broken = None  # error with which its answers are lost
        self.reads = None  # pressure that is read, if not the set-point
        self.faults = ()
        Device.made = (*Device.made, self)

    def open(self):
        if self.port == 'none':
            raise TransportError("no such port: 'none'")
        self.is_open = True

    def set_pressure(self, gauge_pa):
        self.received.append(gauge_pa)
        self.setpoint = permitted(gauge_pa, self.ceiling)
        self._answer()

    def read(self):
        self._answer()
        pressure = self.setpoint if self.reads is None else self.reads
        return Reading(pressure, self.setpoint, self.faults, 0.0)

    def vent(self):
        self._answer()
        self.setpoint = 0.0

    def close(self):
        self.is_open = False

    def _answer(self):
        assert self.is_open
        if self.broken:
            raise self.broken

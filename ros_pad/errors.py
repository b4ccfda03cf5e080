# SPDX-License-Identifier: Apache-2.0
"""Errors of ros_pad, named after what is wrong.

Every message says the value, its unit, the allowed range and where the value came from.
"""

from __future__ import annotations


class PadError(Exception):
    """Base of every error that ros_pad raises on purpose."""


class InvalidInput(PadError, ValueError):
    """A value is non-finite, of the wrong kind, or outside its physical range."""


class ConfigError(PadError):
    """A YAML file or parameter has an unknown key, or a value that is not allowed."""


class NoEquilibrium(PadError):
    """The pad has no shape in equilibrium at this pressure and force.

    Attributes
    ----------
    status : str
        Which end of the model was reached: ``no_inflation``, ``flattened`` or ``fold_zone``.
    """

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class NoBridge(PadError):
    """A liquid bridge of this volume or filling angle does not exist: it has ruptured."""


class NoSurface(PadError):
    """A liquid surface, or a pad under it, has no equilibrium of the kind asked for.

    Attributes
    ----------
    status : str
        ``blocked`` (the surface would run through the wall), ``collapsed`` (it pinches off),
        ``rim`` (it reaches the rim of the pad) or ``no_convergence``.
    """

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class MeshError(PadError):
    """A mesh cannot be wetted: open, flipped, non-manifold, or off the floor."""


class DeviceError(PadError):
    """Something went wrong between here and a device.

    Attributes
    ----------
    port : str
        The line, such as ``/dev/ttyUSB0``; empty where there is none.
    command : str
        What was sent.
    reply : str or bytes
        What came back.
    """

    def __init__(
        self, message: str, port: str = '', command: str = '', reply: str | bytes = ''
    ) -> None:
        super().__init__(message)
        self.port, self.command, self.reply = port, command, reply


class TransportError(DeviceError):
    """The line to a device is closed, silent or broken."""


class ProtocolError(DeviceError):
    """A device answered something that its protocol does not allow."""


class DeviceFault(DeviceError):
    """A device reports a fault of its own."""


class LimitError(PadError):
    """A command would take a pad past a limit, for instance its pressure ceiling."""


class BagError(PadError):
    """A bag cannot be written or read."""

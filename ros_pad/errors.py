# SPDX-License-Identifier: Apache-2.0
"""Errors of ros_pad, named after what is wrong.

Every message names the value, its unit, the allowed range and the source of the value.
"""

from __future__ import annotations


class PadError(Exception):
    """Base class of all errors that ros_pad raises."""


class InvalidInput(PadError, ValueError):
    """A value is non-finite, of the wrong kind, or outside its physical range."""


class ConfigError(PadError):
    """A YAML file, key or optional package is missing, or a key or value is not allowed."""


class NoEquilibrium(PadError):
    """The model of a pad has no result for these values.

    Attributes
    ----------
    status : str
        ``no_inflation`` (the dome would grow without limit), ``out_of_range`` (the material would
        be stretched beyond its range), ``flattened`` (the contact would cover the pad),
        ``fold_zone`` (the shape depends on the history of the load) or ``no_rise`` (the equation
        printed in the thesis has no rise height).
    """

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class NoBridge(PadError):
    """A liquid bridge of this volume or filling angle does not exist."""


class NoSurface(PadError):
    """A liquid surface, or a pad under it, has no equilibrium of the required kind.

    Attributes
    ----------
    status : str
        ``blocked`` (the surface would run through the wall), ``collapsed`` (the surface pinches
        off), ``rim`` (the surface reaches the rim of the pad) or ``no_convergence``.
    """

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class MeshError(PadError):
    """A mesh cannot be wetted: it is open, inside out or non-manifold, or not on the floor."""


class DeviceError(PadError):
    """Communication with a device failed, or the device reports a fault.

    The message of an error on a serial line has port, command and reply.
    """


class TransportError(DeviceError):
    """The connection to a device is closed, silent or broken."""


class ProtocolError(DeviceError):
    """A device sent a reply that its protocol does not allow."""


class DeviceFault(DeviceError):
    """A device reports that it has a fault itself."""


class LimitError(PadError):
    """A command would exceed a limit of a pad, for instance its pressure ceiling."""


class BagError(PadError):
    """A bag cannot be written or read."""


class BadMessage(PadError):
    """The bytes of a message are too few, or do not fit its type."""


class NoConvergence(PadError, ArithmeticError):
    """A step of a simulation has not converged."""


def reason(error: Exception) -> str:
    """Return why an error of a library was raised, in words, for a message that names the file."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f'key {error} is missing'
    return str(error) or type(error).__name__

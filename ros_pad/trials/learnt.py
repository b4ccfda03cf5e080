# SPDX-License-Identifier: Apache-2.0
"""Keep what feet have learnt of friction for the next trial, in a small YAML file."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pathlib
from typing import Any

from ros_pad.configuration import Table
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError, PadError
from ros_pad.estimation.scales import (
    CLASSES,
    NEXT_FLOOR,
    SCALE_RANGE,
    SCALE_SD,
    SCALE_SD_RANGE,
    FrictionScales,
)

FILE = 'learnt.yaml'
"""Name of the file in the folder of a trial."""

_HEAD = """\
# Friction of feet on their floor over that of the contact model, learnt by ros_pad; sd is of its
# logarithm, on this floor. `pad run --learnt` and the parameter learnt of the estimator read it.
"""


def settings_of(shared: FrictionScales) -> dict[str, float]:
    """Return settings of an estimator that is where these feet are, on the same floor, by name."""
    found = {}
    for name, (scale, sd) in shared.scales.items():
        found[f'scale.{name}'] = round(scale, 4)
        found[f'scale_sd.{name}'] = round(max(sd, SCALE_SD_RANGE[0]), 4)
    return found


def save(path: str | os.PathLike[str], settings: dict[str, float], foot: Foot) -> None:
    """Write the settings of a robot with this foot to a file, completely or not at all.

    Raises
    ------
    PadError
        When the file cannot be written.
    """
    known = {
        n: {'scale': settings[f'scale.{n}'], 'sd': settings[f'scale_sd.{n}']} for n in CLASSES
    }
    lines = [
        f'{name}: {json.dumps(each)}\n' for name, each in ({'foot': foot.source} | known).items()
    ]
    new = pathlib.Path(f'{os.fspath(path)}.new')
    try:
        new.write_text(_HEAD + ''.join(lines), encoding='utf-8')
        new.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            new.unlink()
        raise PadError(f'{os.fspath(path)}: cannot be written: {error.strerror}') from error


def load(path: str | os.PathLike[str], foot: str) -> dict[str, Any]:
    """Read the settings from a file.

    The next floor may be another one, so the deviations are larger than in the file, up to those
    before any walk.

    Parameters
    ----------
    path : path
        The file.
    foot : str
        Name or path of the robot's foot, which must be that in the file.

    Raises
    ------
    ConfigError
        When the file cannot be read, is of another foot, or a key or value is not allowed.
    """
    table = Table.load(path)
    if (other := table.text('foot')) != foot:
        raise ConfigError(
            f'{table.origin}: foot = {other!r} is not allowed: it was learnt with another foot'
            f' than {foot!r}, which this robot has'
        )
    found = {}
    for name in CLASSES:
        with table.table(name) as part:
            found[f'scale.{name}'] = part.number('scale', '', *SCALE_RANGE)
            sd = part.number('sd', '', *SCALE_SD_RANGE)
        found[f'scale_sd.{name}'] = max(sd, min(math.hypot(sd, NEXT_FLOOR), SCALE_SD))
    table.finish()
    return found

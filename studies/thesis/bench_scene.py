# SPDX-License-Identifier: Apache-2.0
"""Bench scene: one pad or a foot, its test, and the measurements to compare with."""

from __future__ import annotations

import math
import os
import pathlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.contact.dome import BURST, largest_tension, signed_adhesion
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.limits import criteria, force_limit
from ros_pad.contact.pad import Pad, need_stiffness
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.simulation.scene import foot_of


@dataclass(frozen=True)
class BenchScene:
    """Everything that a bench needs. See ``config/scenes/bench_*.yaml``.

    Attributes
    ----------
    source : str
        Name of the shipped scene, or path of the file, that describes it.
    name, kind, description : str
        Name without folder; ``inflation``, ``press``, ``tangential`` or ``foot``; and the text
        ``description`` of the file.
    foot : Foot
        Foot whose pad is tested. In the tangential bench it has this one pad, and its whole sole;
        in the bench of a foot all of its pads, and the force limit of the scene.
    measurements : Path
        CSV file with the measured points.
    setup : namespace
        The test: the numbers of the file by their keys, SI units.
    """

    source: str
    name: str
    kind: str
    description: str
    foot: Foot
    measurements: pathlib.Path
    setup: Any

    @property
    def pad(self) -> Pad:
        """The pad on the bench."""
        return self.foot.pad

    def changed(self, **numbers: Any) -> BenchScene:
        """Return the scene with other numbers of its test."""
        return replace(self, setup=SimpleNamespace(**vars(self.setup) | numbers))

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str], foot: Foot | None = None) -> BenchScene:
        """Read ``config/scenes/<name>.yaml`` or the file of a path.

        Parameters
        ----------
        name_or_path : str or path
            Name of a shipped bench scene, or path of a YAML file.
        foot : Foot, optional
            Foot to use instead of the one named in the scene.

        Raises
        ------
        ConfigError
            Unknown scene (lists them, with the nearest name), a scene in which a robot walks, or
            a file with an unknown key or a value outside its range (names file, key, value and
            range).
        """
        path = configuration.locate('scenes', name_or_path)
        table = Table.load(path)
        if 'robot' in table and 'bench' not in table:
            raise ConfigError(
                f'{table.origin}: is no bench, but a scene with a robot: Scene.load reads it'
            )
        kind = table.choice('bench', tuple(_READERS))
        description = table.text('description', default='')
        own_foot = foot_of(table)
        foot = foot or own_foot
        measurements = _measurements(table)
        if kind != 'tangential':
            need_stiffness(f'the bench {kind}', foot.pad)
        if kind == 'foot':
            if foot.capillary_force:
                raise ConfigError(
                    f'{table.origin}: foot {foot.source}: capillary_force = '
                    f'{foot.capillary_force:g} N is not allowed: 0 is needed, for this bench puts '
                    'bounds of its own on that force'
                )
            foot = replace(foot, limit=table.choice('criterion', criteria(foot.pad)))
        setup = SimpleNamespace(**_READERS[kind](table, foot))
        if kind == 'tangential':
            # The sole keeps its size: around the one dome, the other pads stay part of it.
            foot = replace(foot, pads=1, shear_stiffness=foot.shear_stiffness / foot.pads)
        table.finish()
        source = os.fspath(name_or_path)
        return cls(source, path.stem, kind, description, foot, measurements, setup)


def _measurements(table: Table) -> pathlib.Path:
    """Return the CSV file: a shipped one by its name, or one in the scene's folder."""
    name = table.text('measurements')
    if name.endswith('.csv'):
        path = pathlib.Path(table.origin).parent / name
    else:
        path = configuration.shared_folder() / 'measurements' / f'{name}.csv'
    if not path.is_file():
        raise ConfigError(
            f'{table.origin}: measurements = {name!r}: there is no file {path}; a name in'
            ' config/measurements, or a .csv file in the folder of the scene, is needed'
        )
    return path


Numbers = dict[str, Any]


def _numbers(table: Table, **wanted: tuple[str, float, float]) -> Numbers:
    """Return numbers by key, each with unit, lowest and highest value."""
    return {name: table.number(name, *given) for name, given in wanted.items()}


def _inflation(table: Table, foot: Foot) -> Numbers:
    """Read the test in which a free pad is inflated (thesis 3.2.1)."""
    burst = 0.99 * BURST * foot.pad.stiffness / foot.pad.radius
    return _numbers(
        table, highest_pressure=('Pa', 1e3, burst), claimed_error=('(relative)', 0.0, 1.0)
    )


def _press(table: Table, foot: Foot) -> Numbers:
    """Read the test in which an inflated pad is pressed on a plate (thesis 3.2.1)."""
    pad = foot.pad
    end = largest_tension(signed_adhesion(pad, 'matlab')) * pad.stiffness / pad.radius
    pressure = table.number('pressure', 'Pa', 1e3, end)
    force = ('N', 0.0, pressure * math.pi * pad.radius**2)  # pressed flat
    text: Numbers = {}
    if 'text_forces' in table:
        with table.table('text_forces') as part:
            text = _numbers(part, first=force, second=force, third=force)
    found = {'pressure': pressure, 'text_forces': tuple(text.values())}
    return found | _numbers(table, highest_force=force)


def _dragged(table: Table, floor: Table) -> Numbers:
    """Read what is the same for a pad and a foot that are pressed, and dragged until they slip."""
    angle = _numbers(floor, advancing_angle=('rad', 0.0, math.pi))
    viscosity = floor.number('viscosity', 'Pa s', 1e-5, 10.0, default=WATER_VISCOSITY)
    return {
        **angle,
        'viscosity': viscosity,
        **_numbers(
            floor,
            film_thickness=('m', 1e-9, 0.01),
            receding_angle=('rad', 0.0, angle['advancing_angle']),
        ),
        **_numbers(table, speed=('m/s', 1e-6, 1.0), dwell=('s', 0.0, 3600.0)),
    }


def _foot(table: Table, foot: Foot) -> Numbers:
    """Read the test in which a whole foot is pressed and dragged on four floors (4.3.1)."""
    with table.table('floor') as part:
        numbers = _dragged(table, part) | _numbers(part, roughness=('m', 0.0, 1e-3))
    with table.table('doubt') as part:
        numbers |= _numbers(part, factor=('(factor)', 1.0, 10.0))
        numbers['samples'] = part.integer('samples', 20, 100000)
        numbers['seed'] = part.integer('seed', 0, 2**32 - 1)
    numbers |= _numbers(table, pressure=('Pa', 1e3, foot.ceiling))
    carried = foot.pads * float(force_limit(foot.pad, numbers['pressure'], foot.limit))
    if not carried:
        raise ConfigError(
            f'{table.origin}: criterion = {foot.limit!r}: domes of {numbers["pressure"]:g} Pa '
            'carry nothing by it: another criterion, or a higher pressure, is needed'
        )
    # With the fewest domes that are drawn, too, domes carry all of the load.
    numbers |= _numbers(table, highest_load=('N', 1e-3, carried / numbers['factor']))
    numbers |= _numbers(table, claimed_lowest=('(relative)', 0.0, 1.0))
    return numbers | _numbers(
        table,
        lowest_load=('N', 1e-4, 0.5 * numbers['highest_load']),
        claimed_highest=('(relative)', numbers['claimed_lowest'], 1),
    )


def _tangential(table: Table, foot: Foot) -> Numbers:
    """Read the test in which a pressed pad is dragged (thesis 3.2.2)."""
    with table.table('floor') as part:
        numbers = _dragged(table, part)
    with table.table('design') as part:
        numbers |= _numbers(part, smallest_radius=('m', 1e-5, 1e-2))
        numbers |= _numbers(part, largest_radius=('m', numbers['smallest_radius'], 1e-1))
        ends = numbers['smallest_radius'], numbers['largest_radius']
        numbers |= _numbers(part, claimed_smallest=('m', *ends))
        numbers |= _numbers(part, claimed_largest=('m', numbers['claimed_smallest'], ends[1]))
    return numbers | _numbers(table, highest_load=('N', 1e-3, 100.0))


_READERS: dict[str, Callable[[Table, Foot], Numbers]] = {
    'inflation': _inflation,
    'press': _press,
    'tangential': _tangential,
    'foot': _foot,
}

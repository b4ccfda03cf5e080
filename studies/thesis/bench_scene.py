# SPDX-License-Identifier: Apache-2.0
"""Bench scene: one pad or a foot, its test, and the measurements to compare with."""

from __future__ import annotations

import dataclasses
import math
import os
import pathlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.contact.dome import BURST, largest_tension, signed_adhesion
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.limits import criteria, force_limit
from ros_pad.contact.pad import Pad, need_stiffness
from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.simulation.scene import Scene, foot_of


@dataclass(frozen=True)
class InflationBench:
    """Test in which a free pad is inflated (thesis 3.2.1).

    Attributes
    ----------
    highest_pressure : float
        Gauge pressure at which curves end, Pa.
    claimed_error : float
        Relative error of height and radius that the thesis states.
    """

    kind: ClassVar[str] = 'inflation'
    highest_pressure: float
    claimed_error: float


@dataclass(frozen=True)
class PressBench:
    """Test in which an inflated pad is pressed on a plate (thesis 3.2.1).

    Attributes
    ----------
    pressure : float
        Gauge pressure, Pa.
    highest_force : float
        Normal force at which curves end, N.
    text_forces : tuple of float
        Normal forces that the thesis' text gives for the measured points, N, in the same order, if
        they differ from those in its program; else empty.
    """

    kind: ClassVar[str] = 'press'
    pressure: float
    highest_force: float
    text_forces: tuple[float, ...]


@dataclass(frozen=True)
class DragBench:
    """Test in which something is pressed and dragged until it begins to slip.

    Attributes
    ----------
    speed : float
        Speed of the stage that drags the foot, m/s.
    dwell : float
        Time from touch-down until the stage starts, s.
    film_thickness : float
        Depth of the liquid on wet ground, m.
    viscosity : float
        Viscosity of the liquid, Pa s.
    advancing_angle, receding_angle : float
        Contact angles at which the edge of the liquid advances and recedes, rad.
    """

    speed: float
    dwell: float
    film_thickness: float
    viscosity: float
    advancing_angle: float
    receding_angle: float


@dataclass(frozen=True)
class TangentialBench(DragBench):
    """Test in which a pressed pad is dragged (thesis 3.2.2).

    Attributes
    ----------
    highest_load : float
        Normal force up to which the flat pad is tried, N.
    smallest_radius, largest_radius : float
        Pad radii between which the height of rise is drawn, m.
    claimed_smallest, claimed_largest : float
        Pad radii between which the thesis claims the optimum, m.
    """

    kind: ClassVar[str] = 'tangential'
    highest_load: float
    smallest_radius: float
    largest_radius: float
    claimed_smallest: float
    claimed_largest: float


@dataclass(frozen=True)
class FootBench(DragBench):
    """Test in which a whole foot is pressed and dragged on four floors (thesis 4.3.1).

    Attributes
    ----------
    pressure : float
        Gauge pressure of the domes, Pa.
    lowest_load, highest_load : float
        Normal forces between which the foot is tried, N.
    roughness : float
        Root mean square height of the rough floor, m; the smooth one has none.
    factor : float
        Factor by which each assumed number may be too high or too low.
    samples, seed : int
        Number of draws of the assumed numbers, and what fixes them.
    claimed_lowest, claimed_highest : float
        Relative errors between which the thesis' estimate is claimed to be.
    """

    kind: ClassVar[str] = 'foot'
    pressure: float
    lowest_load: float
    highest_load: float
    roughness: float
    factor: float
    samples: int
    seed: int
    claimed_lowest: float
    claimed_highest: float


Setup: TypeAlias = InflationBench | PressBench | TangentialBench | FootBench


@dataclass(frozen=True)
class BenchScene:
    """Everything that a bench needs. See ``config/scenes/bench_*.yaml``.

    Attributes
    ----------
    source : str
        Name of the shipped scene, or path of the file, that describes it.
    name, description : str
        Name without folder, and the text ``description`` of the file.
    foot : Foot
        Foot whose pad is tested. In the tangential bench it has this one pad, and its whole sole;
        in the bench of a foot all of its pads, and the force limit of the scene.
    measurements : Path
        CSV file with the measured points.
    setup : InflationBench, PressBench, TangentialBench or FootBench
        The test.
    """

    source: str
    name: str
    description: str
    foot: Foot
    measurements: pathlib.Path
    setup: Setup

    @property
    def pad(self) -> Pad:
        """The pad on the bench."""
        return self.foot.pad

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
        return cls.read(Table.load(path), os.fspath(name_or_path), path.stem, foot)

    @classmethod
    def read(cls, table: Table, source: str, name: str, foot: Foot | None = None) -> BenchScene:
        """Read a bench scene from a table; raise ConfigError as :meth:`load` does."""
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
            foot = dataclasses.replace(foot, limit=table.choice('criterion', criteria(foot.pad)))
        setup = _READERS[kind](table, foot)
        if kind == 'tangential':
            # The sole keeps its size: around the one dome, the other pads stay part of it.
            share = foot.shear_stiffness / foot.pads
            foot = dataclasses.replace(foot, pads=1, shear_stiffness=share)
        table.finish()
        return cls(source, name, description, foot, measurements, setup)


def load(name_or_path: str | os.PathLike[str]) -> Scene | BenchScene:
    """Read a scene of either kind: a walk or a bench.

    Raises
    ------
    ConfigError
        As :meth:`BenchScene.load` and :meth:`ros_pad.simulation.scene.Scene.load`.
    """
    path = configuration.locate('scenes', name_or_path)
    table = Table.load(path)
    if 'bench' in table:
        return BenchScene.read(table, os.fspath(name_or_path), path.stem)
    return Scene.read(table, os.fspath(name_or_path), path.stem)


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


def _numbers(table: Table, **wanted: tuple[str, float, float]) -> dict[str, float]:
    """Return numbers by key, each with unit, lowest and highest value."""
    return {name: table.number(name, *given) for name, given in wanted.items()}


def _inflation(table: Table, foot: Foot) -> InflationBench:
    burst = 0.99 * BURST * foot.pad.stiffness / foot.pad.radius
    return InflationBench(
        **_numbers(
            table, highest_pressure=('Pa', 1e3, burst), claimed_error=('(relative)', 0.0, 1.0)
        )
    )


def _press(table: Table, foot: Foot) -> PressBench:
    pad = foot.pad
    end = largest_tension(signed_adhesion(pad, 'matlab')) * pad.stiffness / pad.radius
    pressure = table.number('pressure', 'Pa', 1e3, end)
    force = ('N', 0.0, pressure * math.pi * pad.radius**2)  # pressed flat
    text: dict[str, float] = {}
    if 'text_forces' in table:
        with table.table('text_forces') as part:
            text = _numbers(part, first=force, second=force, third=force)
    return PressBench(pressure, table.number('highest_force', *force), tuple(text.values()))


def _dragged(table: Table, floor: Table) -> dict[str, float]:
    """Return the numbers of :class:`DragBench`."""
    advancing = floor.number('advancing_angle', 'rad', 0.0, math.pi)
    return {
        'advancing_angle': advancing,
        'viscosity': floor.number('viscosity', 'Pa s', 1e-5, 10.0, default=WATER_VISCOSITY),
        **_numbers(
            floor, film_thickness=('m', 1e-9, 0.01), receding_angle=('rad', 0.0, advancing)
        ),
        **_numbers(table, speed=('m/s', 1e-6, 1.0), dwell=('s', 0.0, 3600.0)),
    }


def _foot(table: Table, foot: Foot) -> FootBench:
    with table.table('floor') as part:
        numbers = _dragged(table, part) | _numbers(part, roughness=('m', 0.0, 1e-3))
    with table.table('doubt') as part:
        factor = part.number('factor', '(factor)', 1.0, 10.0)
        samples, seed = (part.integer('samples', 20, 100000), part.integer('seed', 0, 2**32 - 1))
    pressure = table.number('pressure', 'Pa', 1e3, foot.ceiling)
    carried = foot.pads * float(force_limit(foot.pad, pressure, foot.limit))
    if not carried:
        raise ConfigError(
            f'{table.origin}: criterion = {foot.limit!r}: domes of {pressure:g} Pa carry nothing '
            'by it: another criterion, or a higher pressure, is needed'
        )
    # With the fewest domes that are drawn, too, domes carry all of the load.
    highest = table.number('highest_load', 'N', 1e-3, carried / factor)
    least = table.number('claimed_lowest', '(relative)', 0.0, 1.0)
    return FootBench(
        **numbers,
        **_numbers(
            table, lowest_load=('N', 1e-4, 0.5 * highest), claimed_highest=('(relative)', least, 1)
        ),
        **{'pressure': pressure, 'highest_load': highest, 'claimed_lowest': least},
        factor=factor,
        samples=samples,
        seed=seed,
    )


def _tangential(table: Table, foot: Foot) -> TangentialBench:
    with table.table('floor') as part:
        numbers = _dragged(table, part)
    with table.table('design') as part:
        numbers |= _numbers(part, smallest_radius=('m', 1e-5, 1e-2))
        numbers |= _numbers(part, largest_radius=('m', numbers['smallest_radius'], 1e-1))
        ends = numbers['smallest_radius'], numbers['largest_radius']
        numbers |= _numbers(part, claimed_smallest=('m', *ends))
        numbers |= _numbers(part, claimed_largest=('m', numbers['claimed_smallest'], ends[1]))
    return TangentialBench(**numbers, **_numbers(table, highest_load=('N', 1e-3, 100.0)))


_READERS: dict[str, Callable[[Table, Foot], Setup]] = {
    'inflation': _inflation,
    'press': _press,
    'tangential': _tangential,
    'foot': _foot,
}

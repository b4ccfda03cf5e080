# SPDX-License-Identifier: Apache-2.0
"""Tangential resistance of a whole foot: flat or dome, dry or wet.

The thesis writes F_re = μ N + τ A + F_cap (Eqs 3.65 to 3.67) and gives neither μ nor τ. Two
contact areas turn that one law into the four states it describes:

- a *flat* sole conforms to the floor: A = N / p_c until the whole sole touches, which on dry
  ground makes adhesion its larger part;
- *domes* touch only where their air pressure p carries the load, A = N / p (Eq. 3.53 without
  adhesion), several times less: a dome holds less on dry ground;
- a liquid film of thickness h leaves dry contact on a share exp(-(h/h_c)^m) of the area, and
  boundary friction on the rest; the high pressure under a dome drains it, the flat sole floats.

Domes past their force limit are pressed flat, and the sole carries what they cannot.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
from typing import Any
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.contact.dome import inflate
from ros_pad.contact.limits import force_limit
from ros_pad.contact.pad import MeasuredLimit
from ros_pad.contact.pad import Pad
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium

THICK_FILM = 1.0e-3
"""Film of liquid that does not drain within a stance under a flat sole, m."""

DOMED = 0.85
"""Share of the ceiling at which domes are taken to be walked on."""

FORCE_LIMITS = ('measured', 'max_depth', 'flattening')

# Unit of each number of a foot, and whether it must be above zero.
_UNITS = (
    ('sole_radius', 'm', True),
    ('friction', '(coefficient)', False),
    ('shear_strength', 'Pa', False),
    ('conforming_pressure', 'Pa', True),
    ('boundary_friction', '(coefficient)', False),
    ('critical_film', 'm', True),
    ('film_exponent', '(exponent)', True),
    ('shear_stiffness', 'N/m', True),
    ('chamber_volume', 'm³', False),
    ('ceiling', 'Pa', True),
    ('capillary_force', 'N', False),
)


@dataclass(frozen=True)
class Foot:
    """A sole with equal pads, and the constants of its friction.

    Attributes
    ----------
    source : str
        Name of the shipped foot, or path of the file, that describes it.
    pad : Pad
        One pad.
    pads : int
        How many of them share the load.
    sole_radius : float
        Radius of the sole, m.
    friction : float
        Load-proportional part of dry friction, μ of Eq. 3.66.
    shear_strength : float
        Shear strength of adhesive contact, τ of Eq. 3.67, Pa.
    conforming_pressure : float
        Mean pressure at which a flat sole touches all over, Pa.
    boundary_friction : float
        Friction coefficient on a film that does not drain.
    critical_film : float
        Film thickness that leaves 1/e of dry contact, whatever the exponent, m.
    film_exponent : float
        How sharply contact is lost with film thickness.
    shear_stiffness : float
        Tangential stiffness of sole and pads, N/m.
    chamber_volume : float
        Air in the foot besides that under the pads, m³.
    ceiling : float
        Highest gauge pressure that may be commanded, Pa.
    limit : str
        Criterion of the force limit: ``measured``, ``max_depth`` or ``flattening``.
    capillary_force : float
        Tangential force that liquid round one dome on wet ground adds, F_cap of Eq. 3.65, N: from
        ``pad wet``, or measured. 0 leaves it out.
    """

    source: str
    pad: Pad
    pads: int
    sole_radius: float
    friction: float
    shear_strength: float
    conforming_pressure: float
    boundary_friction: float
    critical_film: float
    film_exponent: float
    shear_stiffness: float
    chamber_volume: float
    ceiling: float
    limit: str = 'measured'
    capillary_force: float = 0.0
    _limit_table: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _limit_cell: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, unit, positive in _UNITS:
            number(name, getattr(self, name), unit, above=positive)
        if not isinstance(self.pads, int) or self.pads < 1:
            raise InvalidInput(f'pads = {self.pads!r} is not allowed: a whole number from 1')
        if self.pads * math.pi * self.pad.radius**2 > self.sole_area:
            raise InvalidInput(
                f'pads = {self.pads} is not allowed: so many of radius {self.pad.radius:g} m'
                f' do not fit on a sole of sole_radius = {self.sole_radius:g} m'
            )
        choice('limit', self.limit, FORCE_LIMITS)
        # The limit is asked for at every simulated step: tabulate it once, about each 0.5 kPa.
        cells = math.ceil(self.ceiling / 500.0)
        try:
            force_limit(self.pad, self.ceiling, self.limit)
        except (NoEquilibrium, InvalidInput) as error:
            raise InvalidInput(
                f'no force limit is known up to ceiling = {self.ceiling:g} Pa: {error}'
            ) from error
        limits = force_limit(self.pad, np.linspace(0.0, self.ceiling, cells + 1), self.limit)
        object.__setattr__(self, '_limit_table', tuple((self.pads * limits).tolist()))
        object.__setattr__(self, '_limit_cell', self.ceiling / cells)

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Foot:
        """Read ``config/feet/<name>.yaml`` or a file of one's own.

        Raises
        ------
        ConfigError
            Naming file, key, value and allowed range.
        """
        path = configuration.locate('feet', name_or_path)
        table = Table.load(path)
        table.text('description', default='')
        with table.table('pad') as pad_table:
            pad = Pad(
                radius=pad_table.number('radius', 'm', 1e-4, 1e-2),
                stiffness=pad_table.number('stiffness', 'N/m', 1.0, 1e4),
                adhesion_energy=pad_table.number('adhesion_energy', 'J/m2', 0.0, 1.0),
                measured_limit=_measured_limit(pad_table),
            )
        values: dict[str, Any] = {
            'pads': table.integer('pads', 1, 10000),
            'sole_radius': table.number('sole_radius', 'm', 1e-3, 0.2),
            'friction': table.number('friction', '(coefficient)', 0.01, 3.0),
            'shear_strength': table.number('shear_strength', 'Pa', 0.0, 1e6),
            'conforming_pressure': table.number('conforming_pressure', 'Pa', 1.0, 1e7),
            'boundary_friction': table.number('boundary_friction', '(coefficient)', 0.0, 3.0),
            'critical_film': table.number('critical_film', 'm', 1e-9, 1e-3),
            'film_exponent': table.number('film_exponent', '(exponent)', 0.1, 10.0),
            'shear_stiffness': table.number('shear_stiffness', 'N/m', 1.0, 1e7),
            'chamber_volume': table.number('chamber_volume', 'm3', 0.0, 1e-3),
            'ceiling': table.number('ceiling', 'Pa', 1e3, 1e6),
            'limit': table.choice('force_limit', FORCE_LIMITS, default='measured'),
            'capillary_force': table.number('capillary_force', 'N', 0.0, 1.0, default=0.0),
        }
        table.finish()
        try:
            return cls(source=os.fspath(name_or_path), pad=pad, **values)
        except InvalidInput as error:
            raise ConfigError(f'{table.origin}: {error}') from error

    @property
    def sole_area(self) -> float:
        """Area of the sole, m²."""
        return math.pi * self.sole_radius**2

    def on_rough(self, roughness: float) -> Foot:
        """Return this foot as it is on a floor with a texture of its own.

        Parameters
        ----------
        roughness : float
            Root mean square height of the texture under a foot, m, >= 0.

        Returns
        -------
        Foot
            With a critical film and a conforming pressure that are larger by the factor
            √(1 + (roughness/critical_film)²). The critical film stands for the roughness of pad
            and smooth floor; heights of floor and pad are taken to be independent, Gaussian and
            of one wavelength. Then what a film must cover is their composite, as in the
            film-thickness ratio of mixed lubrication (Tallian 1967), and the mean slope, hence the
            pressure at which soft rubber touches everywhere (Persson 2001), grows by the same.
            That valleys hold liquid is left out.

        Raises
        ------
        InvalidInput
            When the roughness is negative or not finite.
        """
        number('roughness', roughness, 'm')
        if not roughness:
            return self
        composite = math.hypot(self.critical_film, roughness)
        rougher = composite / self.critical_film
        return replace(
            self,
            critical_film=composite,
            conforming_pressure=rougher * self.conforming_pressure,
        )

    def air_volume(self, pressure: float) -> float:
        """Air that pads and chamber hold at a gauge pressure, Pa: m³ (free domes)."""
        domes = self.pads * float(inflate(self.pad, pressure).volume) if pressure > 0.0 else 0.0
        return self.chamber_volume + domes

    def dome_load(self, load: float, pressure: float) -> float:
        """Part of the load, N, that the domes carry at a gauge pressure, Pa: up to their limit.

        Made to be fast: nothing is checked. Above the ceiling the limit stays what it is there.
        """
        if pressure <= 0.0:
            return 0.0
        place = pressure / self._limit_cell
        index = int(place)
        table = self._limit_table
        if index >= len(table) - 1:
            limit = table[-1]
        else:
            limit = table[index] + (place - index) * (table[index + 1] - table[index])
        return load if load < limit else limit

    def resistance_of(
        self,
        dome_load: float,
        sole_load: float,
        pressure: float,
        dome_film: float,
        sole_film: float,
    ) -> float:
        """Resistance in newtons for a given share of the load: the kernel, scalars only."""
        total = under_domes = 0.0
        if dome_load > 0.0:
            # Where the air presses less than it takes to conform, only a share touches.
            under_domes = dome_load / max(pressure, self.conforming_pressure)
            dry = self.friction * dome_load + self.shear_strength * under_domes
            total += self._on_film(dry, dome_load, dome_film)
            if dome_film > 0.0:
                total += self.pads * self.capillary_force
        if sole_load > 0.0:
            area = min(self.sole_area - under_domes, sole_load / self.conforming_pressure)
            dry = self.friction * sole_load + self.shear_strength * area
            total += self._on_film(dry, sole_load, sole_film)
        return total

    def _on_film(self, dry: float, load: float, film: float) -> float:
        if film <= 0.0:
            return dry
        touching = math.exp(-((film / self.critical_film) ** self.film_exponent))
        return touching * dry + (1.0 - touching) * self.boundary_friction * load


def _measured_limit(pad_table: Table) -> MeasuredLimit | None:
    if 'measured_limit' not in pad_table:
        return None
    with pad_table.table('measured_limit') as table:
        return MeasuredLimit(
            force=table.number('force', 'N', 0.0, 1e3),
            pressure=table.number('pressure', 'Pa', 1.0, 1e6),
            slope=table.number('slope', 'N/Pa', 1e-9, 1.0),
        )


def tangential_resistance(
    foot: Foot,
    load: ArrayLike,
    pressure: ArrayLike,
    dome_film: ArrayLike = 0.0,
    sole_film: ArrayLike = 0.0,
) -> np.ndarray | float:
    """Largest tangential force that a foot holds, N (Eqs 3.65 to 3.67 with a film model).

    Parameters
    ----------
    foot : Foot
        The foot.
    load : array_like
        Normal force on the foot, N, >= 0.
    pressure : array_like
        Gauge pressure in the pads, Pa, from 0 (flat) to ``foot.ceiling``.
    dome_film, sole_film : array_like
        Liquid film under the domes and under the flat sole, m, >= 0; 0 is dry ground.

    Returns
    -------
    float or ndarray
        Resistance in newtons, broadcast over the inputs. The capillary force is what the foot
        says, by default none: the hysteresis of a contact line
        (:func:`ros_pad.contact.hysteresis_force`) is at most 1e-3 of the friction of a loaded pad.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of its range.
    """
    values = (
        quantity('load', load, 'N'),
        quantity('pressure', pressure, 'Pa', high=foot.ceiling),
        quantity('dome_film', dome_film, 'm'),
        quantity('sole_film', sole_film, 'm'),
    )

    def one(load: float, pressure: float, dome_film: float, sole_film: float) -> float:
        on_domes = foot.dome_load(load, pressure)
        return foot.resistance_of(on_domes, load - on_domes, pressure, dome_film, sole_film)

    try:
        result = np.vectorize(one, otypes=[float])(*values)
    except ValueError as error:
        raise InvalidInput('load, pressure and films do not broadcast') from error
    return float(result) if result.ndim == 0 else result


class ExpectedFriction(NamedTuple):
    """Coefficients of friction of a foot, flat on dry and on wet ground, and as a dome."""

    flat_dry: float
    flat_wet: float
    dome: float


def expected_friction(foot: Foot, load: float) -> ExpectedFriction:
    """Return what the contact model lets expect of a foot under a load, N, > 0.

    A dome holds about the same on wet and dry ground.
    """
    return ExpectedFriction(
        float(tangential_resistance(foot, load, 0.0)) / load,
        float(tangential_resistance(foot, load, 0.0, sole_film=THICK_FILM)) / load,
        float(tangential_resistance(foot, load, DOMED * foot.ceiling)) / load,
    )

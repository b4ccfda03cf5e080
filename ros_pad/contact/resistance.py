# SPDX-License-Identifier: Apache-2.0
"""Tangential resistance of a whole foot: flat or dome, dry or wet.

The thesis gives F_re = μ N + τ A + F_cap (Eqs 3.65 to 3.67), without values of μ and τ. The
contact area A depends on the morphology and on the liquid film:

- a *flat* sole conforms to the floor: A = N / p_c until the whole sole touches. On dry ground
  most of its resistance is adhesion, τ A;
- *domes* touch only where their air pressure p carries the load: A = N / p (Eq. 3.53 without
  adhesion), several times less. On dry ground a dome has less resistance than a flat sole;
- a liquid film of thickness h leaves dry contact on a share exp(-(h/h_c)^m) of the area, and
  boundary friction on the rest. The high pressure under a dome drains the film; under a flat sole
  it hardly drains.

Domes above their force limit are pressed flat; the flat sole carries the rest of the load.
"""

from __future__ import annotations

import functools
import math
import os
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ros_pad import configuration
from ros_pad.configuration import Setting, Table, choice, instance, integer, number, quantity, text
from ros_pad.contact import laws
from ros_pad.contact.dome import inflate, press
from ros_pad.contact.film import LANDING, Film
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.limits import CRITERIA, DEFAULT_CRITERION, check_criterion, force_limit
from ros_pad.contact.material import Material, factor_in
from ros_pad.contact.pad import MeasuredLimit, Pad, broadcast, plain
from ros_pad.errors import ConfigError, InvalidInput, NoEquilibrium

THICK_FILM = 1.0e-3
"""Thickness of a liquid film that does not drain under a flat sole within a stance, m."""

DOMED = 0.85
"""Typical pressure of domes while walking, as a share of the ceiling."""

SILICONE = 0.3e6
"""Young's modulus of the sole, Pa, as of soft casting silicones."""

DISC_TURNING_RADIUS = 2.0 / 3.0
"""Radius at which the friction of a turning disc acts, as a share of the disc's radius.

Howe and Cutkosky, Int. J. Robotics Research 15 (1996) 531, approximate the limit surface of a
sliding contact by an ellipsoid through its largest force and its largest moment. For a disc of
radius R under uniform pressure these are μN and 2/3 R μN."""

PAD_SETTINGS = (
    Setting('radius', float, 'Radius of the flat pad.', 'm', 1e-4, 1e-2),
    Setting('stiffness', float, 'Tension stiffness of the membrane.', 'N/m', 1.0, 1e4),
    Setting('adhesion_energy', float, 'Work of adhesion on the floor.', 'J/m²', 0.0, 1.0),
)
"""Settings of each pad in a foot file."""

RUBBER_SETTINGS = (
    PAD_SETTINGS[0],
    Setting('material', str, 'Name of a shipped material, or path of a material file.'),
    Setting('thickness', float, 'Thickness of the flat pad.', 'm', 1e-5, 1e-2),
)
"""Settings of each pad in a foot file that names a material; the last is optional without one."""

LIMIT_SETTINGS = (
    Setting('force', float, 'Largest normal force at this pressure.', 'N', 0.0, 1e3),
    Setting('pressure', float, 'Gauge pressure.', 'Pa', 1.0, 1e6),
    Setting('slope', float, 'Slope of the limit over pressure.', 'N/Pa', 1e-9, 1.0),
)
"""Settings of the measured force limit in a foot file."""

FOOT_SETTINGS = (
    Setting('pads', int, 'Number of pads.', '', 1, 10000),
    Setting('sole_radius', float, 'Radius of the sole.', 'm', 1e-3, 0.2),
    Setting('friction', float, 'Dry friction in proportion to load.', '(coefficient)', 0.01, 3.0),
    Setting('shear_strength', float, 'Shear strength of adhesive contact.', 'Pa', 0.0, 1e6),
    Setting('conforming_pressure', float, 'Pressure for full contact of a sole.', 'Pa', 1.0, 1e7),
    Setting('boundary_friction', float, 'Friction on a thick film.', '(coefficient)', 0.0, 3.0),
    Setting('critical_film', float, 'Film thickness for 1/e of dry contact.', 'm', 1e-9, 1e-3),
    Setting('film_exponent', float, 'Steepness of the loss of contact.', '(exponent)', 0.1, 10.0),
    Setting('shear_stiffness', float, 'Tangential stiffness of the foot.', 'N/m', 1.0, 1e7),
    Setting('chamber_volume', float, 'Air volume without the domes.', 'm³', 0.0, 1e-3),
    Setting('ceiling', float, 'Highest gauge pressure allowed.', 'Pa', 1e3, 1e6),
    Setting('sole_thickness', 7e-3, 'Thickness of the silicone of the sole.', 'm', 1e-4, 0.1),
    Setting('capillary_force', 0.0, 'Tangential force of the liquid on a dome.', 'N', 0.0, 1.0),
)
"""The other settings of a foot file."""


@dataclass(frozen=True)
class Foot:
    """A sole with equal pads, and the constants of its friction.

    Attributes
    ----------
    source : str
        Name of the shipped foot, or path of the foot file.
    pad : Pad
        One pad.
    pads : int
        Number of pads that share the load.
    sole_radius : float
        Radius of the sole, m.
    friction : float
        Coefficient of the load-proportional part of dry friction, μ of Eq. 3.66.
    shear_strength : float
        Shear strength of adhesive contact, τ of Eq. 3.67, Pa.
    conforming_pressure : float
        Mean pressure at which a flat sole touches all over, Pa.
    boundary_friction : float
        Friction coefficient on a film that has not drained.
    critical_film : float
        Film thickness that leaves 1/e of dry contact, for every exponent, m.
    film_exponent : float
        Exponent m, dimensionless: how steeply contact is lost with film thickness.
    shear_stiffness : float
        Tangential stiffness of sole and pads, N/m.
    chamber_volume : float
        Volume of air in the foot without the domes, m³.
    ceiling : float
        Highest gauge pressure that may be commanded, Pa.
    limit : str
        Criterion of the force limit, see :mod:`ros_pad.contact.limits`.
    capillary_force : float
        Tangential force that the liquid around one dome adds on wet ground, F_cap of Eq. 3.65, N:
        from ``pad wet``, or measured. 0 for none.
    sole_thickness : float
        Thickness of the silicone of the sole, which gives under load, m.
    silicones : tuple of str
        Names or paths of the materials of which the foot is cast: the sheet, then the body if that
        is another. No number here rests on them; ``pad mould`` casts with them.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, the pads do not fit on the sole, or there is no
        force limit at the ceiling.

    Examples
    --------
    >>> from ros_pad.contact import Foot
    >>> foot = Foot.load('large19')
    >>> foot.pads, foot.ceiling
    (19, 90000.0)
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
    limit: str = DEFAULT_CRITERION
    capillary_force: float = 0.0
    sole_thickness: float = 7e-3
    silicones: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for each in FOOT_SETTINGS[1:]:
            above = each.low > 0.0 and each.name != 'friction'
            number(each.name, getattr(self, each.name), each.unit, above=above)
        fit = int((self.sole_radius / self.pad.radius) ** 2)
        integer('pads', self.pads, 1, fit, f'(at most {fit} fit on the sole)')
        choice('limit', self.limit, CRITERIA)
        check_criterion(self.pad, self.limit, 'force_limit')
        try:
            _ = self.limits
        except (NoEquilibrium, InvalidInput) as error:
            raise InvalidInput(f'ceiling = {self.ceiling:g} Pa is not allowed: {error}') from error

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Foot:
        """Read ``config/feet/<name>.yaml`` or another foot file.

        Parameters
        ----------
        name_or_path : str or path
            Name of a shipped foot, or path of a file that ends in .yaml or .yml.

        Returns
        -------
        Foot
            The foot; ``source`` is its name or path.

        Raises
        ------
        ConfigError
            When the file is missing, or a key or value is not allowed. The message names file,
            key, value and allowed range.
        """
        path = configuration.locate('feet', name_or_path)
        table = Table.load(path)
        table.text('description', default='')
        with table.table('pad') as part:
            pad = _pad(part)
        values = table.values(FOOT_SETTINGS)
        limit = table.choice('force_limit', CRITERIA, default=DEFAULT_CRITERION)
        silicones = table.sequence('silicones', default=())
        table.finish()
        try:
            return cls(
                source=os.fspath(name_or_path),
                pad=pad,
                limit=limit,
                silicones=tuple(text('silicones', each) for each in silicones),
                **values,
            )
        except InvalidInput as error:
            raise ConfigError(f'{table.origin}: {error}') from error

    @property
    def turning_radius(self) -> float:
        """Lever of friction against turning about the vertical, m."""
        return DISC_TURNING_RADIUS * self.sole_radius

    @cached_property
    def sole_area(self) -> float:
        """Area of the sole, m²."""
        return math.pi * self.sole_radius**2

    @property
    def capillary(self) -> float:
        """Tangential force of the liquid around all domes, N."""
        return self.pads * self.capillary_force

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """Force limits of all pads, N, in equal steps of about 0.5 kPa up to the ceiling."""
        cells = math.ceil(self.ceiling / 500.0)
        limits = _limits(self.pad, self.ceiling, cells, self.limit)
        return tuple(self.pads * each for each in limits)

    @cached_property
    def limit_cell(self) -> float:
        """Step of pressure between them, Pa."""
        return self.ceiling / (len(self.limits) - 1)

    @cached_property
    def spheres(self) -> tuple[float, ...]:
        """Radius of the free domes, m, at the pressures of :attr:`limits`; at 0 that of a pad."""
        pressures = self.limit_cell * np.arange(1, len(self.limits))
        return self.pad.radius, *inflate(self.pad, pressures).sphere_radius.tolist()

    @cached_property
    def stiffnesses(self) -> tuple[float, ...]:
        """Stiffness of all domes, N/m, at the pressures of :attr:`limits`: to half of the limit.

        0 where domes carry nothing.
        """
        pressures = self.limit_cell * np.arange(len(self.limits))
        forces = np.array(self.limits) / (2.0 * self.pads)
        found = np.zeros(len(pressures))
        if (able := forces > 0.0).any():
            free = inflate(self.pad, pressures[able]).height
            gaps = press(self.pad, pressures[able], forces[able]).gap
            found[able] = self.pads * forces[able] / (free - gaps)
        return tuple(found.tolist())

    @cached_property
    def dome_stiffness(self) -> float:
        """Stiffness of all domes at a typical pressure, N/m."""
        return laws.between(self.stiffnesses, DOMED * self.ceiling / self.limit_cell)

    @cached_property
    def sole_stiffness(self) -> float:
        """Stiffness of the flat sole, N/m: a layer of silicone, free at its sides."""
        return SILICONE * self.sole_area / self.sole_thickness

    def on_rough(self, roughness: float) -> Foot:
        """Return the foot with its constants on a rough floor.

        Parameters
        ----------
        roughness : float
            Root mean square height of the floor under a foot, m, from 0.

        Returns
        -------
        Foot
            With critical film and conforming pressure increased by the factor
            √(1 + (roughness/critical_film)²).

        Raises
        ------
        InvalidInput
            When the roughness is negative or not finite.

        Notes
        -----
        The critical film represents the roughness of the pad and a smooth floor. Heights of floor
        and pad are assumed independent, Gaussian and of one wavelength. Then the film must cover
        the composite roughness (film-thickness ratio of mixed lubrication, Tallian 1967). The mean
        slope grows by the same factor, and with it the pressure at which soft rubber touches
        everywhere (Persson 2001). Liquid stored in valleys is ignored.
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
        """Return the air volume of free domes and chamber.

        Pads of a material that would balloon keep the volume that they have at their largest
        pressure: a regulator can overshoot the ceiling, and no model has what they do then.

        Parameters
        ----------
        pressure : float
            Gauge pressure, Pa, from 0.

        Returns
        -------
        float
            Volume, m³.
        """
        if self.pad.material is not None:
            pressure = min(pressure, pressure_end(self.pad)[0])
        domes = self.pads * float(inflate(self.pad, pressure).volume) if pressure > 0.0 else 0.0
        return self.chamber_volume + domes

    def dome_load(self, load: float, pressure: float) -> float:
        """Return the part of a load that the domes carry; for speed the input is not checked.

        Parameters
        ----------
        load : float
            Normal force on the foot, N, from 0.
        pressure : float
            Gauge pressure, Pa, from 0.

        Returns
        -------
        float
            Normal force on the domes, N: at most their force limit; above the ceiling, that at the
            ceiling.
        """
        return laws.dome_load(self, load, pressure)

    def grip(
        self,
        load: float,
        pressure: float,
        film: Film | None = None,
        duration: float = 0.0,
        slip: float = 0.0,
    ) -> float:
        """Return the tangential resistance, N; for speed the input is not checked.

        Parameters
        ----------
        load : float
            Normal force on the foot, N, from 0.
        pressure : float
            Gauge pressure, Pa, from 0.
        film : Film, optional
            Film on which the foot stands; by default the ground is dry.
        duration : float
            Time for which the film drains before, s, from 0.
        slip : float
            Speed at which the foot slips in it, m/s.
        """
        on_domes = self.dome_load(load, pressure)
        on_sole, films = load - on_domes, (0.0, 0.0)
        if film is not None:
            films = film.drain(on_domes, on_sole, pressure, duration, slip)
        return laws.resistance(self, on_domes, on_sole, pressure, *films)

    def grip_after(self, load: float, pressure: float, film: Film | None, time: float) -> float:
        """Return the tangential resistance, N, after a time in stance, s; None is dry ground.

        The film has just been touched; for speed the input is not checked.
        """
        if film is None:
            return self.grip(load, pressure)
        on_domes = self.dome_load(load, pressure)
        films = film.stand(on_domes, load - on_domes, pressure, time)
        return laws.resistance(self, on_domes, load - on_domes, pressure, *films)


@functools.lru_cache(maxsize=64)
def _limits(pad: Pad, ceiling: float, cells: int, criterion: str) -> tuple[float, ...]:
    """Return the force limits of a pad, N, at the ends of equal cells up to the ceiling, Pa."""
    limits = force_limit(pad, np.linspace(0.0, ceiling, cells + 1), criterion)
    if np.isnan(limits[-1]):
        force_limit(pad, ceiling, criterion)  # raises
    return tuple(limits.tolist())


def _pad(table: Table) -> Pad:
    line, rubber = None, 'material' in table
    if 'measured_limit' in table:
        with table.table('measured_limit') as part:
            line = MeasuredLimit(**part.values(LIMIT_SETTINGS))
    values = table.values(RUBBER_SETTINGS if rubber else PAD_SETTINGS)
    try:
        if not rubber:
            if 'thickness' in table:
                values['thickness'] = table.value(RUBBER_SETTINGS[-1])
            return Pad(**values, measured_limit=line)
        material, factor = Material.load(values.pop('material')), factor_in(table)
        if factor:
            material = material.times(*factor.values())
        return Pad.of(material, **values, measured_limit=line)
    except InvalidInput as error:
        raise ConfigError(f'{table.origin}: {error}') from error


def tangential_resistance(
    foot: Foot,
    load: ArrayLike,
    pressure: ArrayLike,
    dome_film: ArrayLike = 0.0,
    sole_film: ArrayLike = 0.0,
) -> np.ndarray | float:
    """Return the largest tangential force of a foot, N (Eqs 3.65 to 3.67 with a film model).

    Parameters
    ----------
    foot : Foot
        The foot.
    load : float or array
        Normal force on the foot, N, from 0.
    pressure : float or array
        Gauge pressure in the pads, Pa, from 0 (flat) to ``foot.ceiling``.
    dome_film, sole_film : float or array
        Liquid film under the domes and under the flat sole, m, from 0 (dry ground).

    Returns
    -------
    float or array
        Resistance, N, broadcast over the inputs. It includes ``foot.capillary_force``, by default
        0: the hysteresis of a contact line (:func:`ros_pad.contact.hysteresis_force`) is at most
        1e-3 of the friction of a loaded pad.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, or shapes do not broadcast.

    Examples
    --------
    A flat sole and domes at 75 kPa, 2 N, on dry ground and on films of the same liquid:

    >>> from ros_pad.contact import Foot, tangential_resistance
    >>> foot = Foot.load('large19')
    >>> tangential_resistance(foot, 2.0, [0.0, 75e3]).round(2).tolist()
    [1.6, 0.83]
    >>> films = {'dome_film': 0.1e-6, 'sole_film': 20e-6}
    >>> tangential_resistance(foot, 2.0, [0.0, 75e3], **films).round(2).tolist()
    [0.24, 0.8]
    """
    instance('foot', foot, Foot)
    values = broadcast(
        'load, pressure and films',
        quantity('load', load, 'N'),
        quantity('pressure', pressure, 'Pa', high=foot.ceiling),
        quantity('dome_film', dome_film, 'm'),
        quantity('sole_film', sole_film, 'm'),
    )

    def one(load: float, pressure: float, dome_film: float, sole_film: float) -> float:
        on_domes = foot.dome_load(load, pressure)
        films = dome_film, sole_film
        return laws.resistance(foot, on_domes, load - on_domes, pressure, *films)

    return plain(np.vectorize(one, otypes=[float])(*values))


class ExpectedFriction(NamedTuple):
    """Friction coefficients of a foot by the contact model.

    Attributes
    ----------
    flat_dry, flat_wet, dome : float
        Flat on dry and on wet ground, and as a dome on dry ground.
    landed : float
        As a dome on wet ground with the film that half of the load has left just after landing:
        from there friction grows, at most to that on dry ground.
    """

    flat_dry: float
    flat_wet: float
    dome: float
    landed: float


def expected_friction(foot: Foot, load: float) -> ExpectedFriction:
    """Return the friction coefficients of a foot by the contact model, at a load, N, above 0.

    Wet ground has water, too thick to drain under a flat sole.
    """
    film, pressure = Film(foot), DOMED * foot.ceiling
    on_domes = foot.dome_load(load, pressure)
    film.touch_down(THICK_FILM)
    films = film.drain(0.5 * on_domes, 0.5 * (load - on_domes), pressure, LANDING)
    return ExpectedFriction(
        foot.grip(load, 0.0) / load,
        laws.resistance(foot, 0.0, load, 0.0, 0.0, THICK_FILM) / load,
        foot.grip(load, pressure) / load,
        laws.resistance(foot, on_domes, load - on_domes, pressure, *films) / load,
    )

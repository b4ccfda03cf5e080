# SPDX-License-Identifier: Apache-2.0
"""The floor: where it is wet, how deep, and how uneven."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace

import numpy as np
from scipy import ndimage
from scipy import special

from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput

FLOORS = ('dry', 'wet', 'patches', 'drawn')

# Period of a patchy floor along x and y, and edge of its cells, m.
LENGTH, WIDTH, CELL = 16.0, 8.0, 0.02

# Heights of an uneven floor lose their likeness (to 1/e) over this distance, m: more than a foot,
# less than a step.
UNEVEN_LENGTH = 0.05


def patch_lengths(wet_fraction: float) -> tuple[float, float]:
    """Return the range of mean patch lengths, m, that a floor can show at this wet fraction.

    The field's smoothing must be no finer than a cell, or patches come out too long, and no
    coarser than an eighth of the floor's width, or too few fit in to be random.
    """
    per_smoothing = 1.0 / _smoothing(wet_fraction, 1.0)
    return CELL * per_smoothing, WIDTH / 8.0 * per_smoothing


def _smoothing(wet_fraction: float, patch_length: float) -> float:
    """Return the smoothing of the field, m.

    A Gaussian field smoothed with a kernel of standard deviation s crosses the level z upwards
    exp(-z²/2)/(2 π √2 s) times a metre (Rice 1944), and wet_fraction/patch_length is that rate.
    """
    level = float(special.ndtri(wet_fraction))
    rate = wet_fraction / patch_length
    return math.exp(-(level**2) / 2.0) / (2.0 * math.pi * math.sqrt(2.0) * rate)


def _field(smoothing: float, seed: int, stream: int) -> np.ndarray:
    """Return smoothed noise on the cells of a floor; ``smoothing`` in m."""
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InvalidInput(f'seed = {seed!r}: a whole number from 0 is needed')
    shape = (round(WIDTH / CELL), round(LENGTH / CELL))
    noise = np.random.default_rng([seed, stream]).normal(size=shape)
    smooth: np.ndarray = ndimage.gaussian_filter(noise, smoothing / CELL, mode='wrap')
    return smooth


@dataclass(frozen=True)
class Floor:
    """A floor with a map of wet ground, and one of heights, repeated in both directions.

    Attributes
    ----------
    wet_map : ndarray of bool, (rows along y, columns along x)
        True where liquid stands.
    cell : float
        Edge of one cell of the map, m.
    origin : tuple of float
        World position of the corner of cell [0, 0], m.
    film_thickness : float
        Depth of the liquid on wet ground, m.
    heights : ndarray of float, (rows along y, columns along x), or None
        Height of the ground where a foot may stand, m, about zero; None for an even floor. Its
        cells have an edge of ``CELL``, its corner is at (-1 m, -WIDTH/2).

    Raises
    ------
    InvalidInput
        When the cell is not above zero, or the depth below it or not finite.
    """

    wet_map: np.ndarray
    cell: float
    origin: tuple[float, float]
    film_thickness: float
    heights: np.ndarray | None = None
    _rows: list[list[bool]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        number('cell', self.cell, 'm', above=True)
        number('film_thickness', self.film_thickness, 'm')
        object.__setattr__(self, '_rows', self.wet_map.tolist())

    @classmethod
    def uniform(cls, wet: bool, film_thickness: float) -> Floor:
        """Return a floor that is wet, or dry, everywhere."""
        return cls(np.array([[wet]]), 1.0, (0.0, 0.0), film_thickness)

    @classmethod
    def patches(
        cls,
        wet_fraction: float,
        patch_length: float,
        film_thickness: float,
        seed: int,
    ) -> Floor:
        """Return random patches: a smoothed Gaussian field, wet where it is high.

        Parameters
        ----------
        wet_fraction : float
            Share of the floor that is wet, in (0, 1).
        patch_length : float
            Mean length of a wet patch along a straight walk, m, within :func:`patch_lengths`.
        film_thickness : float
            Depth of the liquid, m.
        seed : int
            Whole number from 0; the same seed gives the same floor.

        Raises
        ------
        InvalidInput
            When wet fraction, patch length, depth or seed is out of its range.
        """
        if not 0.0 < wet_fraction < 1.0:
            raise InvalidInput(f'wet_fraction = {wet_fraction!r}: must be between 0 and 1')
        shortest, longest = patch_lengths(wet_fraction)
        if not shortest <= patch_length <= longest:
            raise InvalidInput(
                f'patch_length = {patch_length!r} m: with a wet fraction of {wet_fraction:g} the'
                f' floor has room for {shortest:.3g} to {longest:.3g} m'
            )
        level = _field(_smoothing(wet_fraction, patch_length), seed, 1)
        wet = level > np.quantile(level, 1.0 - wet_fraction)
        return cls(wet, CELL, (-1.0, -WIDTH / 2.0), film_thickness)

    @classmethod
    def drawn(cls, drawing: Sequence[str], cell: float, film_thickness: float) -> Floor:
        """Return a floor that is wet where a drawing says so.

        Parameters
        ----------
        drawing : sequence of str
            Rows of equal length, from left (+y) to right of the robot; along a row goes +x, the
            way the robot walks. ``#`` is wet, ``.`` is dry. The robot starts in the middle of the
            first column, and the drawing begins again where it ends.
        cell : float
            Edge of what one character covers, m, > 0.
        film_thickness : float
            Depth of the liquid, m.

        Raises
        ------
        InvalidInput
            When rows differ in length or there are other characters, or no rows at all; or when
            cell or depth is out of its range.
        """
        if not drawing or not drawing[0]:
            raise InvalidInput('drawing is empty: rows of # (wet) and . (dry) are needed')
        for place, row in enumerate(drawing, 1):
            if len(row) != len(drawing[0]):
                raise InvalidInput(
                    f'drawing: row {place} has {len(row)} characters, the first {len(drawing[0])}'
                )
            if odd := set(row) - set('#.'):
                raise InvalidInput(
                    f'drawing: row {place} has {min(odd)!r}: # (wet) and . (dry) are known'
                )
        # Rows of the map go along +y, those of a drawing against it.
        wet = np.array([[each == '#' for each in row] for row in reversed(drawing)])
        return cls(wet, cell, (-cell / 2.0, -cell * len(drawing) / 2.0), film_thickness)

    def uneven(self, unevenness: float, seed: int) -> Floor:
        """Return this floor with random heights.

        Parameters
        ----------
        unevenness : float
            Root mean square of the heights, m, >= 0.
        seed : int
            Whole number from 0; the same seed gives the same heights.

        Raises
        ------
        InvalidInput
            When one of them is out of its range.
        """
        number('unevenness', unevenness, 'm')
        if not unevenness:
            return self
        # Smoothing noise with a Gaussian of s.d. s makes it correlated as exp(-d²/4s²).
        heights = _field(UNEVEN_LENGTH / 2.0, seed, 3)
        heights -= heights.mean()
        return replace(self, heights=heights * (unevenness / heights.std()))

    def height(self, x: float, y: float) -> float:
        """Height of the ground at a world position, m."""
        heights = self.heights
        if heights is None:
            return 0.0
        rows, columns = heights.shape
        row, column = int((y + WIDTH / 2.0) // CELL) % rows, int((x + 1.0) // CELL) % columns
        return float(heights[row, column])

    def wet(self, x: float, y: float) -> bool:
        """Whether there is liquid at a world position, m."""
        rows = self._rows
        row = rows[int((y - self.origin[1]) // self.cell) % len(rows)]
        return row[int((x - self.origin[0]) // self.cell) % len(row)]

    def depth(self, x: float, y: float) -> float:
        """Depth of the liquid at a world position, m; 0 on dry ground."""
        return self.film_thickness if self.wet(x, y) else 0.0

    def wet_along(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return :meth:`wet` for arrays of positions, as booleans of their shape."""
        rows, columns = self.wet_map.shape
        # floor_divide is exact, as // is: a rounded quotient takes cell edges for the next cell.
        row = np.floor_divide(np.asarray(y) - self.origin[1], self.cell).astype(int) % rows
        column = np.floor_divide(np.asarray(x) - self.origin[0], self.cell).astype(int) % columns
        return self.wet_map[row, column]

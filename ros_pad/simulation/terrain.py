# SPDX-License-Identifier: Apache-2.0
"""Floor with a map of liquid and a map of heights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from ros_pad.configuration import integer, number
from ros_pad.errors import InvalidInput

FLOORS = ('dry', 'wet', 'patches', 'drawn')

# Period of a patchy floor along x and y, and edge of its cells, m.
LENGTH, WIDTH, CELL = 16.0, 8.0, 0.02

# Correlation length (to 1/e) of the heights of an uneven floor, m: more than a foot, less than a
# step.
UNEVEN_LENGTH = 0.05


def patch_lengths(wet_fraction: float) -> tuple[float, float]:
    """Return the range of mean patch lengths, m, that a floor can have at this wet fraction.

    The shortest patches need a smoothing of one cell; finer smoothing is lost in the cells. The
    longest need a smoothing of an eighth of the floor's width; with more, a random floor would
    have too few patches.
    """
    per_smoothing = 1.0 / _smoothing(wet_fraction, 1.0)
    return CELL * per_smoothing, WIDTH / 8.0 * per_smoothing


def _smoothing(wet_fraction: float, patch_length: float) -> float:
    """Return the standard deviation of the smoothing kernel that gives these patches, m.

    A Gaussian field smoothed with a kernel of standard deviation s crosses the level z upwards
    exp(-z²/2)/(2 π √2 s) times a metre (Rice 1944). This rate must be wet_fraction/patch_length.
    """
    level = NormalDist().inv_cdf(wet_fraction)
    rate = wet_fraction / patch_length
    return math.exp(-(level**2) / 2.0) / (2.0 * math.pi * math.sqrt(2.0) * rate)


def _field(smoothing: float, seed: int, stream: int) -> np.ndarray:
    """Return smoothed noise on the cells of a floor; ``smoothing`` is in m."""
    integer('seed', seed)
    shape = (round(WIDTH / CELL), round(LENGTH / CELL))
    noise = np.random.default_rng([seed, stream]).normal(size=shape)
    from scipy.ndimage import gaussian_filter  # here, because many floors have no patches

    return np.asarray(gaussian_filter(noise, smoothing / CELL, mode='wrap'))


@dataclass(frozen=True)
class Floor:
    """A floor with a map of liquid and one of heights, both repeated in x and y.

    Attributes
    ----------
    wet_map : ndarray of bool, (rows along y, columns along x)
        True where there is liquid.
    cell : float
        Edge of one cell of the map, m.
    origin : tuple of float
        World position of the corner of cell [0, 0], m.
    film_thickness : float
        Depth of the liquid on wet ground, m.
    heights : ndarray of float, (rows along y, columns along x), or None
        Height of the ground, m, of mean zero; None for an even floor. The cells of this map have
        an edge of ``CELL``; the corner of cell [0, 0] is at (-1 m, -WIDTH/2).

    Raises
    ------
    InvalidInput
        When the cell is not finite and above 0, or the depth is negative or not finite.
    """

    wet_map: np.ndarray
    cell: float
    origin: tuple[float, float]
    film_thickness: float
    heights: np.ndarray | None = None

    def __post_init__(self) -> None:
        number('cell', self.cell, 'm', above=True)
        number('film_thickness', self.film_thickness, 'm')

    @classmethod
    def uniform(cls, wet: bool, film_thickness: float) -> Floor:
        """Return a floor that is wet, or dry, everywhere.

        Parameters
        ----------
        wet : bool
            Whether it is wet.
        film_thickness : float
            Depth of the liquid, m, from 0.

        Returns
        -------
        Floor
            The floor.

        Raises
        ------
        InvalidInput
            When the depth is negative or not finite.
        """
        return cls(np.array([[wet]]), 1.0, (0.0, 0.0), film_thickness)

    @classmethod
    def patches(
        cls, wet_fraction: float, patch_length: float, film_thickness: float, seed: int
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

        Returns
        -------
        Floor
            The floor.

        Raises
        ------
        InvalidInput
            When wet fraction, patch length, depth or seed is out of its range.

        Examples
        --------
        >>> from ros_pad.simulation import Floor
        >>> floor = Floor.patches(0.4, patch_length=0.5, film_thickness=0.3e-3, seed=1)
        >>> round(float(floor.wet_map.mean()), 3), floor.depth(0.0, 0.0)  # m
        (0.4, 0.0003)
        """
        number('wet_fraction', wet_fraction, '(share)', 1e-6, 1.0 - 1e-6)
        number('patch_length', patch_length, 'm', *patch_lengths(wet_fraction))
        level = _field(_smoothing(wet_fraction, patch_length), seed, 1)
        wet = level > np.quantile(level, 1.0 - wet_fraction)
        return cls(wet, CELL, (-1.0, -WIDTH / 2.0), film_thickness)

    @classmethod
    def drawn(cls, drawing: Sequence[str], cell: float, film_thickness: float) -> Floor:
        """Return a floor that is wet where a drawing shows it.

        Parameters
        ----------
        drawing : sequence of str
            Rows of equal length, from left (+y) to right of the robot; a row goes along +x, the
            direction of walking. ``#`` is wet, ``.`` is dry. The robot starts in the middle of the
            first column. The drawing is repeated in both directions.
        cell : float
            Edge of the square that one character stands for, m, above 0.
        film_thickness : float
            Depth of the liquid, m.

        Returns
        -------
        Floor
            The floor.

        Raises
        ------
        InvalidInput
            When rows differ in length, are missing or have other characters, or when ``cell`` or
            ``film_thickness`` is out of its range.
        """
        wide = len(drawing[0]) if drawing else 0
        if not wide or any(len(row) != wide or set(row) - set('#.') for row in drawing):
            raise InvalidInput(
                f'drawing = {drawing!r} is not allowed: rows of one length of # (wet) and . (dry)'
                ' are needed'
            )
        number('cell', cell, 'm', above=True)
        # Rows of the map go along +y, those of a drawing against it.
        wet = np.array([[each == '#' for each in row] for row in reversed(drawing)])
        return cls(wet, cell, (-cell / 2.0, -cell * len(drawing) / 2.0), film_thickness)

    def uneven(self, unevenness: float, seed: int) -> Floor:
        """Return this floor with random heights.

        Parameters
        ----------
        unevenness : float
            Root mean square of the heights, m, 0 or more.
        seed : int
            Whole number from 0; the same seed gives the same heights.

        Returns
        -------
        Floor
            A floor with these heights and the same liquid.

        Raises
        ------
        InvalidInput
            When the unevenness or the seed is out of its range.
        """
        number('unevenness', unevenness, 'm')
        if not unevenness:
            return self
        # Noise smoothed with a Gaussian of standard deviation s has the correlation exp(-d²/4s²).
        heights = _field(UNEVEN_LENGTH / 2.0, seed, 3)
        heights -= heights.mean()
        return replace(self, heights=heights * (unevenness / heights.std()))

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground at a position.

        Parameters
        ----------
        x, y : float
            World position, m.

        Returns
        -------
        float
            Height, m.
        """
        heights = self.heights
        if heights is None:
            return 0.0
        rows, columns = heights.shape
        row, column = int((y + WIDTH / 2.0) // CELL) % rows, int((x + 1.0) // CELL) % columns
        return float(heights[row, column])

    def wet(self, x: float, y: float) -> bool:
        """Return whether there is liquid at a position.

        Parameters
        ----------
        x, y : float
            World position, m.

        Returns
        -------
        bool
            True on wet ground.
        """
        rows, columns = self.wet_map.shape
        row = int((y - self.origin[1]) // self.cell) % rows
        return bool(self.wet_map[row, int((x - self.origin[0]) // self.cell) % columns])

    def depth(self, x: float, y: float) -> float:
        """Return the depth of the liquid at a position.

        Parameters
        ----------
        x, y : float
            World position, m.

        Returns
        -------
        float
            Depth, m; 0 on dry ground.
        """
        return self.film_thickness if self.wet(x, y) else 0.0

    def wet_along(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return :meth:`wet` for arrays of positions.

        Parameters
        ----------
        x, y : array
            World position, m.

        Returns
        -------
        array of bool
            True on wet ground, in the shape of the positions.
        """
        rows, columns = self.wet_map.shape
        # floor_divide is as exact as //; a rounded quotient could put a position just before the
        # edge of a cell in the next cell.
        row = np.floor_divide(np.asarray(y) - self.origin[1], self.cell).astype(int) % rows
        column = np.floor_divide(np.asarray(x) - self.origin[0], self.cell).astype(int) % columns
        return self.wet_map[row, column]

# SPDX-License-Identifier: Apache-2.0
"""The floor: where it is wet, and how deep."""

from __future__ import annotations

import math
from dataclasses import dataclass
from dataclasses import field

import numpy as np
from scipy import ndimage
from scipy import special

FLOORS = ('dry', 'wet', 'patches')


@dataclass(frozen=True)
class Floor:
    """A level floor with a map of wet ground, repeated in both directions.

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
    """

    wet_map: np.ndarray
    cell: float
    origin: tuple[float, float]
    film_thickness: float
    _rows: list[list[bool]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
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
        length: float = 16.0,
        width: float = 8.0,
        cell: float = 0.02,
    ) -> Floor:
        """Return random patches: a smoothed Gaussian field, wet where it is high.

        Parameters
        ----------
        wet_fraction : float
            Share of the floor that is wet, in (0, 1).
        patch_length : float
            Mean length of a wet patch along a straight walk, m.
        film_thickness : float
            Depth of the liquid, m.
        seed : int
            The same seed gives the same floor.
        length, width, cell : float
            Period of the floor along x and y, and its resolution, m.

        Notes
        -----
        A Gaussian field smoothed with a kernel of standard deviation s crosses the level z
        upwards exp(-z²/2)/(2 π √2 s) times a metre (Rice 1944), from which s follows.
        """
        level = -special.ndtri(wet_fraction)
        smoothing = (
            patch_length
            * math.exp(-(level**2) / 2.0)
            / (2.0 * math.pi * math.sqrt(2.0) * wet_fraction)
        )
        shape = (round(width / cell), round(length / cell))
        noise = np.random.default_rng([seed, 1]).normal(size=shape)
        height = ndimage.gaussian_filter(noise, smoothing / cell, mode='wrap')
        wet = height > np.quantile(height, 1.0 - wet_fraction)
        return cls(wet, cell, (-1.0, -width / 2.0), film_thickness)

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
        row = np.floor((np.asarray(y) - self.origin[1]) / self.cell).astype(int) % rows
        column = np.floor((np.asarray(x) - self.origin[0]) / self.cell).astype(int) % columns
        return self.wet_map[row, column]

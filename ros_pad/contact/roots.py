# SPDX-License-Identifier: Apache-2.0
"""Zeros of many rising functions at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ros_pad.contact.pad import Array


def rising_root(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return the zero of a rising function (Illinois method); without a zero, the nearer end."""
    at_low, at_high = function(low), function(high)
    # Where the function does not change its sign, close the bracket on the nearer end.
    high = np.where(at_low >= 0, low, high)
    low = np.where(at_high <= 0, high, low)
    at_low, at_high = np.minimum(at_low, 0.0), np.maximum(at_high, 0.0)
    x = low
    kept = np.zeros_like(low)  # end that was kept in the last step: -1 the low one, 1 the high one
    for _ in range(100):
        rise = at_high - at_low
        new = high - at_high * (high - low) / np.where(rise > 0, rise, 1.0)
        value = function(new)
        above = value > 0
        # An end that is kept twice gets half its weight, so that the other end moves too.
        at_low = np.where(above, np.where(kept < 0, 0.5 * at_low, at_low), value)
        at_high = np.where(above, value, np.where(kept > 0, 0.5 * at_high, at_high))
        low, high = np.where(above, low, new), np.where(above, new, high)
        kept = np.where(above, -1, 1)
        done = (abs(new - x) <= 4e-16 * abs(new)) | (value == 0)
        x = new
        if np.all(done):
            break
    return x

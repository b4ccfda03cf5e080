# SPDX-License-Identifier: Apache-2.0
"""A figure of the thesis as ros_pad has it: what of it is measured, modelled and assumed."""

from __future__ import annotations

from dataclasses import dataclass

from ros_pad.trials.bench import Claim
from ros_pad.trials.page import Drawn


@dataclass(frozen=True)
class Explained:
    """One figure of the thesis.

    Attributes
    ----------
    number : int
        Of the thesis.
    drawn : Drawn
        Our version, in the looks of :data:`ros_pad.trials.page.PAPER_STYLE`.
    measured, modelled, assumed : str
        What is from the thesis' measurements, what from the model, and what nobody has measured.
    claims : tuple of Claim
        What the thesis says of it, and what comes out here.
    """

    number: int
    drawn: Drawn
    measured: str
    modelled: str
    assumed: str
    claims: tuple[Claim, ...]

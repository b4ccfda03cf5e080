# SPDX-License-Identifier: Apache-2.0
"""Figure of the thesis drawn by ros_pad, with its measured, modelled and assumed parts."""

from __future__ import annotations

from dataclasses import dataclass

from ros_pad.reports.style import Drawn

MINIMAL = 0.10  # relative difference up to which one counts as "minimal"; not from the thesis


@dataclass(frozen=True)
class Claim:
    """A claim of the thesis, and the result of the model.

    Attributes
    ----------
    figure : int
        Number of the figure in the thesis.
    thesis, ours : str
        The claim, and the result here, with numbers.
    numbers : tuple of float
        Numbers that decide whether the claim holds.
    holds : bool or None
        None where the thesis does not give enough to decide.
    """

    figure: int
    thesis: str
    ours: str
    numbers: tuple[float, ...]
    holds: bool | None


@dataclass(frozen=True)
class Explained:
    """One figure of the thesis.

    Attributes
    ----------
    number : int
        Number of the figure in the thesis.
    drawn : Drawn
        Figure of this project, in the style of :data:`ros_pad.reports.style.PAPER_STYLE`.
    measured, modelled, assumed : str
        Texts about the parts that come from the thesis' measurements, from the model, and from
        assumptions.
    claims : tuple of Claim
        Claims of the thesis about the figure, and the results here.
    """

    number: int
    drawn: Drawn
    measured: str
    modelled: str
    assumed: str
    claims: tuple[Claim, ...]

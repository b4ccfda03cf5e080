# SPDX-License-Identifier: Apache-2.0
"""Statement of the thesis with its verdict, and a figure of the thesis drawn by ros_pad."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ros_pad.reports.style import Drawn

MINIMAL = 0.10  # relative difference up to which one counts as "minimal"; not from the thesis

REPRODUCED = 'reproduced'
SAME = 'same formula'
REFUTED = 'refuted'
TUNED = 'tuned to agree'
OPEN = 'underdetermined'
NOT_MODELLED = 'not modelled'
VERDICTS = (REPRODUCED, SAME, REFUTED, TUNED, OPEN, NOT_MODELLED)


@dataclass(frozen=True)
class Claim:
    """A statement of the thesis, and the result of the model.

    Attributes
    ----------
    figure : int
        Number of the figure in the thesis; 0 for a statement without one.
    thesis, ours : str
        The statement in our words, and the result here, with sample size.
    numbers : tuple of float
        Numbers that decide whether the statement holds.
    holds : bool or None
        None where that cannot be computed.
    section : str
        Section of the thesis, and equation.
    printed : str
        Number of the thesis.
    rule : str
        What counts as agreement, and the condition under which it holds.
    tuned : str
        Assumed numbers that were chosen such that the statement holds.
    missing : str
        Numbers which the thesis lacks, where that leaves the statement open.
    see : str
        Derivation: a page of docs with its anchor.
    same : bool
        Whether the number of the thesis comes from the formula that it is compared with.
    """

    figure: int
    thesis: str
    ours: str
    numbers: tuple[float, ...]
    holds: bool | None
    section: str
    printed: str = ''
    rule: str = ''
    tuned: str = ''
    missing: str = ''
    see: str = ''
    same: bool = False

    @property
    def verdict(self) -> str:
        """Return one of :data:`VERDICTS`."""
        if self.holds is None:
            return OPEN if self.missing else NOT_MODELLED
        if not self.holds:
            return REFUTED
        return TUNED if self.tuned else SAME if self.same else REPRODUCED

    @property
    def where(self) -> str:
        """Return section and figure."""
        return f'{self.section}, Fig. {self.figure}' if self.figure else self.section

    def reason(self) -> str:
        """Return rule and condition, what was tuned if it holds, or what is missing."""
        tuned = f'Tuned: {self.tuned}.' if self.verdict == TUNED else ''
        missing = f'Missing: {self.missing}.' if self.verdict == OPEN else ''
        return ' '.join(filter(None, (self.rule, tuned, missing)))

    def as_dict(self) -> dict[str, Any]:
        """Return the statement for JSON."""
        return asdict(self) | {'where': self.where, 'verdict': self.verdict}


def counted(claims: Sequence[Claim]) -> str:
    """Return as text how many statements have each verdict."""
    found = Counter(claim.verdict for claim in claims)
    return ', '.join(f'{found[verdict]} {verdict}' for verdict in VERDICTS if found[verdict])


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
        Statements of the thesis about the figure, and the results here.
    """

    number: int
    drawn: Drawn
    measured: str
    modelled: str
    assumed: str
    claims: tuple[Claim, ...]

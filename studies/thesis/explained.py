# SPDX-License-Identifier: Apache-2.0
"""Statement of the thesis with its verdict, and a figure of the thesis drawn by ros_pad.

What the thesis says, and every word that no number changes, is in words.yaml beside this file.
"""

from __future__ import annotations

import pathlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import yaml
from matplotlib.figure import Figure

from ros_pad.reports.style import Drawn

MINIMAL = 0.10  # relative difference up to which one counts as "minimal"; not from the thesis

REPRODUCED = 'reproduced'
SAME = 'same formula'
REFUTED = 'refuted'
TUNED = 'tuned to agree'
OPEN = 'underdetermined'
NOT_MODELLED = 'not modelled'
VERDICTS = (REPRODUCED, SAME, REFUTED, TUNED, OPEN, NOT_MODELLED)

_WORDS = yaml.safe_load((pathlib.Path(__file__).parent / 'words.yaml').read_text('utf-8'))


@dataclass(frozen=True, kw_only=True)
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


def claim(
    key: str, ours: str, numbers: tuple[float, ...], holds: bool | None, **more: Any
) -> Claim:
    """Return the statement of words.yaml with a key; ``more`` replaces or adds attributes."""
    words = _WORDS['statements'][key]
    return Claim(**{'ours': ours, 'numbers': numbers, 'holds': holds, **words, **more})


def counted(claims: Sequence[Claim]) -> str:
    """Return as text how many statements have each verdict."""
    found = Counter(each.verdict for each in claims)
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
    claims : tuple of Claim
        Statements of the thesis about the figure, and the results here.
    parts : dict of str to str
        Texts about what is ``measured`` in the thesis, ``modelled`` and ``assumed``.
    """

    number: int
    drawn: Drawn
    claims: tuple[Claim, ...]
    parts: dict[str, str]


def drawn(number: int, figure: Figure, **more: str) -> Drawn:
    """Return a drawn figure with its title, text and caption; ``more`` replaces or adds them."""
    words = _WORDS['figures'][number] | more
    return Drawn(figure, words['title'], words['alt'], words['caption'])


def explained(
    number: int, figure: Figure | Drawn, claims: Sequence[Claim], **more: str
) -> Explained:
    """Return a figure of the thesis with the texts of words.yaml; ``more`` replaces them."""
    words = _WORDS['figures'][number] | more
    shown = figure if isinstance(figure, Drawn) else drawn(number, figure, **more)
    parts = {name: words[name] for name in ('measured', 'modelled', 'assumed')}
    return Explained(number, shown, tuple(claims), parts)


class Omission(NamedTuple):
    """What a bench leaves out, with a bound on its effect, if one is known, and of what."""

    term: str
    bound: float | None
    reason: str


def left_out(bench: str, **bounds: float) -> tuple[Omission, ...]:
    """Return what a bench leaves out, with the bounds by key; without one it is unknown."""
    terms = _WORDS['benches'][bench]['left_out']
    return tuple(Omission(row['term'], bounds.get(key), row['of']) for key, row in terms.items())


def notes(bench: str, **numbers: object) -> tuple[str, ...]:
    """Return the notes of a bench, with numbers by name."""
    return tuple(note.format(**numbers) for note in _WORDS['benches'][bench]['notes'])

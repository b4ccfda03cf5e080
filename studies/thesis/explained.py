# SPDX-License-Identifier: Apache-2.0
"""Statement of the thesis with its verdict, and a figure of the thesis drawn by ros_pad.

What the thesis says, and every word that no number changes, is in words.yaml beside this file.
"""

from __future__ import annotations

import pathlib
import string
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import yaml
from matplotlib.figure import Figure

from ros_pad.reports.style import Drawn

MINIMAL = 0.10  # relative difference up to which one counts as "minimal"; not from the thesis

AGREES = 'agrees'
SAME = 'same formula'
TUNED = 'agrees, tuned'
MISPRINT = 'misprint'
WRONG = 'error in a derivation'
DISAGREES = 'our model disagrees'
OPEN = 'underdetermined'
NOT_MODELLED = 'not modelled'
VERDICTS = (AGREES, SAME, TUNED, MISPRINT, WRONG, DISAGREES, OPEN, NOT_MODELLED)

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
    why : str
        Line of thought of the verdict: what counts as agreement, or who says otherwise.
    fails : str
        Verdict where the statement does not hold, and anyone can check that: :data:`MISPRINT` or
        :data:`WRONG`. Without it our model disagrees.
    tuned : str
        Assumed numbers that were chosen such that the statement holds.
    missing : str
        Numbers which the thesis lacks, where that leaves the statement open.
    see : str
        Derivation: a page of docs with its anchor.
    same : bool
        Whether its number comes from the formula or the text that it is compared with.
    """

    figure: int
    thesis: str
    ours: str
    numbers: tuple[float, ...]
    holds: bool | None
    section: str
    printed: str = ''
    why: str = ''
    fails: str = DISAGREES
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
            return self.fails
        return TUNED if self.tuned else SAME if self.same else AGREES

    @property
    def where(self) -> str:
        """Return section and figure."""
        return f'{self.section}, Fig. {self.figure}' if self.figure else self.section

    def reason(self) -> str:
        """Return the line of thought, what was tuned if it holds, or what is missing."""
        tuned = f'Tuned: {self.tuned}.' if self.verdict == TUNED else ''
        missing = f'Missing: {self.missing}.' if self.verdict == OPEN else ''
        return ' '.join(filter(None, (self.why, tuned, missing)))

    def as_dict(self) -> dict[str, Any]:
        """Return the statement for JSON."""
        return asdict(self) | {'where': self.where, 'verdict': self.verdict}


class _Words(string.Formatter):
    """Formats a share with ``%`` behind its form, and sequences with commas and "and"."""

    def format_field(self, value: Any, form: str) -> Any:
        """Return a value as text."""
        if isinstance(value, (list, tuple, np.ndarray)):
            return join([self.format_field(each, form) for each in value])
        if form.endswith('%'):
            value, form, end = 100.0 * value, form[:-1], ' %'
        else:
            end = ''
        text = format(value, form) + end
        return text.replace('-', '−', 1) if text.startswith('-') else text


def join(words: list[str]) -> str:
    """Return words with commas, and "and" before the last one."""
    return ' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)


def worded(text: Any, /, *ordered: Any, **values: Any) -> Any:
    """Return a text of words.yaml with values in place of their names."""
    return _Words().format(text, *ordered, **values) if isinstance(text, str) else text


def claim(key: str, numbers: Any, holds: Any, /, **values: Any) -> Claim:
    """Return a statement of words.yaml by its key, with the numbers that decide, and if it holds.

    ``values`` are what the texts name in braces; ``figure`` and ``section`` where words.yaml has
    none.
    """
    words = {name: worded(text, **values) for name, text in _WORDS['statements'][key].items()}
    words |= {name: values[name] for name in ('figure', 'section') if name in values}
    deciding = tuple(np.ravel(numbers).tolist())
    return Claim(**words, numbers=deciding, holds=None if holds is None else bool(holds))


def counted(claims: Sequence[Claim]) -> str:
    """Return as text how many statements have each verdict."""
    found = Counter(each.verdict for each in claims)
    return '; '.join(f'{verdict} {found[verdict]}' for verdict in VERDICTS if found[verdict])


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


def drawn(number: int, figure: Figure, **values: Any) -> Drawn:
    """Return a drawn figure with its title, text and caption, in which ``values`` are named."""
    words = [worded(_WORDS['figures'][number][name], **values) for name in _SHOWN]
    return Drawn(figure, *words)


_SHOWN = ('title', 'alt', 'caption')


def explained(
    number: int, figure: Figure | Drawn, claims: Sequence[Claim], **values: Any
) -> Explained:
    """Return a figure with the texts of words.yaml, in which ``values`` are named."""
    shown = figure if isinstance(figure, Drawn) else drawn(number, figure, **values)
    words = _WORDS['figures'][number]
    parts = {name: words[name] for name in ('measured', 'modelled', 'assumed')}
    return Explained(number, shown, tuple(claims), parts)


class Omission(NamedTuple):
    """What a bench leaves out, with a bound on its effect, if one is known, and of what."""

    term: str
    bound: float | None
    reason: str

    def words(self) -> tuple[str, str, str]:
        """Return it as text."""
        bound = 'unknown' if self.bound is None else f'≤ {100.0 * self.bound:.2g} %'
        return self.term, bound, self.reason


def left_out(bench: str, **bounds: float) -> tuple[Omission, ...]:
    """Return what a bench leaves out, with the bounds by key; without one it is unknown."""
    terms = _WORDS['benches'][bench]['left_out']
    return tuple(Omission(row['term'], bounds.get(key), row['of']) for key, row in terms.items())


def notes(bench: str, **numbers: object) -> tuple[str, ...]:
    """Return the notes of a bench, with numbers by name."""
    return tuple(worded(note, **numbers) for note in _WORDS['benches'][bench]['notes'])

# SPDX-License-Identifier: Apache-2.0
"""The report of a trial: one HTML file with its figures."""

from __future__ import annotations

import html
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np

from ros_pad.configuration import refuse
from ros_pad.estimation import DOUBTS
from ros_pad.pace import Progress
from ros_pad.reports import pictures
from ros_pad.reports.files import save
from ros_pad.reports.page import heading, page, plain_table, section, table, warning
from ros_pad.reports.pictures import POLICY_NAMES
from ros_pad.reports.style import PAPER_STYLE, Drawn
from ros_pad.reports.view import View, view_of
from ros_pad.trials import conditions
from ros_pad.trials.label import promise
from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.trial import Trial, fault_lines

_POLICY_TEXTS = (
    'Always flat and always dome never change; adaptive feet decide at each lift-off by their '
    'estimates; the oracle uses the true ground where each foot will stand next.'
)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


_GOAL = 'time to the goal'


def _number_or_dash(value: float | None) -> str:
    return '–' if value is None else f'{value:.1f}'


# Name, unit and meaning of each metric, and the function that returns its value as text.
_METRICS: tuple[tuple[str, str, str, Callable[[dict[str, Any]], str]], ...] = (
    ('advance per cycle', 'mm', 'Distance of the body along x in a gait cycle.',
     lambda m: f'{1e3 * m["distance_per_cycle_m"]:.1f}'),
    ('distance', 'm', 'Distance of the body along x.', lambda m: f'{m["distance_m"]:.2f}'),
    ('duration', 's', 'Time of the trial.', lambda m: f'{m["duration_s"]:.1f}'),
    (_GOAL, 's', 'Time from the first step to the goal.',
     lambda m: _number_or_dash(m.get('time_to_goal_s'))),
    ('gait cycles', '', 'Cycles walked.', lambda m: f'{m["cycles"]:.1f}'),
    ('slip path', 'm', 'Length of all slip of a foot, mean of the feet.',
     lambda m: f'{_mean(m["slip_path_m"]):.2f}'),
    ('work lost in slip', 'J',
     'Friction force times slip, and yaw moment times rotation, all feet together.',
     lambda m: f'{m["dissipation_j"]:.2f}'),
    ('sideways drift', 'mm', 'Position of the body along y at the end.',
     lambda m: f'{1e3 * m["lateral_drift_m"]:z.1f}'),
    ('heading drift', '°', 'Heading of the body at the end, positive to the left.',
     lambda m: f'{math.degrees(m["yaw_drift_rad"]):z.2f}'),
    ('morphology changes', '', 'Between flat and dome, all feet together.',
     lambda m: f'{sum(m["switches"])}'),
    ('overload', 's', 'Time for which a dome was above its force limit, mean of the feet.',
     lambda m: f'{_mean(m["overload_s"]):.2f}'),
    ('wetness accuracy', '%',
     'Flat stances at whose end P(wet) was on the correct side of 0.5; domes do not count, '
     'because wet and dry ground give the same forces on them.',
     lambda m: '–' if m['wet_accuracy'] is None else f'{100.0 * m["wet_accuracy"]:.1f}'),
)  # fmt: skip


def _result(view: View) -> str:
    """Return the result of the trial in one or more sentences."""
    trial = view.trial
    if trial.metrics is None:
        body = trial.body[np.isfinite(trial.body).all(axis=1), :2]
        if not len(body):
            return 'The bag has neither metrics nor poses of the body.'
        distance = float(np.hypot(*(body[-1] - body[0])))
        duration = trial.time[-1] - trial.time[0]
        return f'From start to end the body moved by {distance:.2f} m in {duration:.1f} s.'
    own = trial.metrics
    name = POLICY_NAMES.get(trial.policy, trial.policy)
    text = (
        f'{name[:1].upper()}{name[1:]} feet: the robot walked {own.distance_m:.2f} m in '
        f'{own.cycles:.0f} gait cycles, {1e3 * own.distance_per_cycle_m:.0f} mm a cycle'
    )
    for row in view.rows:
        advance = row['distance_per_cycle_m']
        if row['policy'] == trial.policy or not advance > 0.0:
            continue
        gain = 100.0 * (own.distance_per_cycle_m / advance - 1.0)
        other = POLICY_NAMES.get(row['policy'], row['policy'])
        other = f'the {other}' if other == 'oracle' else other
        if abs(gain) < 0.5:
            text += f'; as far as {other}'
        else:
            text += f'; {abs(gain):.0f} % {"further" if gain > 0.0 else "less far"} than {other}'
        text += f' ({1e3 * advance:.0f} mm)'
    text += '.'
    if own.time_to_goal_s is not None:
        text += f' It reached the goal of {own.goal_m:g} m after {own.time_to_goal_s:.1f} s.'
    elif own.goal_m is not None:
        text += f' It did not reach the goal of {own.goal_m:g} m.'
    if own.verdict:
        text += f' The walk is not valid: {own.verdict}.'
    return text


def unobservable_shares(trial: Trial, load_gate: float) -> str:
    """Return sentences: at how many stance ends the ground was observable, and why not at others.

    A foot stands with more than ``load_gate`` newtons. Empty where no doubts are on record.
    """
    if not len(trial.doubt):
        return ''
    ends = [
        trial.doubt[np.maximum(rows - 1, 0), column]
        for column, rows in enumerate(stance_ends(trial, load_gate))
    ]
    places, counts = np.unique(np.concatenate(ends), return_counts=True)
    stances = dict(zip(places.tolist(), counts.tolist(), strict=True))
    total = sum(stances.values())
    if not total or set(stances) == {-1}:
        return ''
    others = sorted(((count, place) for place, count in stances.items() if place), reverse=True)
    why = ', '.join(
        f'{DOUBTS[place] if place > 0 else "not on record"} {100.0 * count / total:.0f} %'
        for count, place in others
    )
    text = f'At the end of {stances.get(0, 0)} of {total} stances the ground was observable.'
    return text + (f' Reasons at the other ends: {why}.' if why else '')


def _metrics_tables(view: View) -> str:
    if not view.rows:
        return '<p>This bag has no metrics: they need a floor whose true ground is known.</p>'
    names = [POLICY_NAMES.get(row['policy'], row['policy']) for row in view.rows]
    head = ['', 'unit', *(html.escape(name) for name in names), 'meaning']
    body = []
    for name, unit, meaning, number in _METRICS:
        if name == _GOAL and view.trial.metrics and view.trial.metrics.goal_m is None:
            continue
        values = [
            f'<b>{text}</b>' if row['policy'] == view.trial.policy else text
            for row in view.rows
            for text in [number(row).replace('-', '\N{MINUS SIGN}')]
        ]
        body.append([name, unit, *values, meaning])
    text = table(head, body, range(2, 2 + len(names)))
    if len(names) > 1:
        text += f'<p class="note">{_POLICY_TEXTS}</p>'
    own = view.trial.metrics
    if own is None or len(view.order) == 1:
        return text
    legs = [view.trial.legs[column] for column in view.order]
    per_leg = [
        ('slip path', 'mm', [f'{1e3 * own.slip_path_m[k]:.0f}' for k in view.order]),
        ('morphology changes', '', [str(own.switches[k]) for k in view.order]),
        ('overload', 's', [f'{own.overload_s[k]:.2f}' for k in view.order]),
    ]
    text += '<h3>Leg by leg</h3>' + table(
        ['', 'unit', *(f'leg {leg}' for leg in legs)],
        [[name, unit, *values] for name, unit, values in per_leg],
        range(2, 2 + len(legs)),
    )
    return text


def _terms_table(settings: Mapping[str, Any]) -> str:
    """Return a table of the terms that the model leaves out, and of those that it has."""
    terms = [*settings.get('omitted', ()), *settings.get('taken', ())]
    if not terms:
        return '<p>No simulation is on record for this trial.</p>'
    rows = [
        [
            html.escape(str(each['term'])),
            'yes' if each.get('taken') else 'no',
            _bound(each),
            _effect(each),
            html.escape(str(each['reason'])),
        ]
        for each in terms
    ]
    head = ['term', 'modelled', 'bound', 'effect on the result', 'quantity, and source']
    return table(head, rows, range(2, 4))


def _bound(term: dict[str, Any]) -> str:
    """Return the bound of a term, and how often it is kept if that is not always."""
    if term['bound'] is None:
        return 'not known'
    often = ' in 95 of 100 scenes' if term.get('kind') == 'promise' else ''
    return f'≤ {100.0 * term["bound"]:.1f} %{often}'


def _effect(term: dict[str, Any]) -> str:
    """Return the effect of a term, and whether it is above the accuracy of the scene."""
    if term.get('effect') is None:
        return 'not known'
    note = ', exceeds the accuracy required' if term['exceeds'] else ''
    share = 100.0 * term['effect']
    return (f'≈ {share:.1f} %' if share <= 100.0 else 'all of it') + note


def _facts(trial: Trial) -> list[str]:
    """Return the parts of the line below the title; some may be empty."""
    return [
        f'policy {POLICY_NAMES.get(trial.policy, trial.policy)}' if trial.policy else '',
        f'seed {trial.seed}' if trial.scene else '',
        f'simulation {trial.fidelity}' if trial.fidelity else '',
        f'sensing {sensing}' if (sensing := trial.settings.get('sensing')) else '',
        f'recorded {trial.settings["recorded"]}' if 'recorded' in trial.settings else '',
        f'{trial.real_time_factor:.1f} times real time' if trial.real_time_factor else '',
        f'ros_pad {trial.settings["version"]}' if 'version' in trial.settings else '',
    ]


def _fidelity_note(view: View) -> str:
    if 'fidelity_note' not in view.settings:
        return ''
    note = html.escape(promise(view.trial))
    return (
        f'<p>{note[:1].upper()}{note[1:]}. The bound was calibrated on random scenes and checked '
        'on others; the reference is the highest level with short time steps.</p>'
    )


def write(
    trial: Trial,
    path: str | os.PathLike[str],
    others: Iterable[Trial] = (),
    progress: Progress | None = None,
    force: bool = False,
) -> None:
    """Write the report of a trial: one HTML file that needs no other file and no network.

    Parameters
    ----------
    trial : Trial
        Trial from the loop or from a bag; figures whose data are missing are left out.
    path : path
        HTML file to write.
    others : iterable of Trial
        Trials of other policies on the same ground to compare with, in addition to
        ``trial.settings['comparison']``.
    progress : callable or None
        Called with the share that is done, 0 to 1.
    force : bool
        Whether to replace an existing file.

    Raises
    ------
    InvalidInput
        When the file exists and ``force`` is False.
    PadError
        When the file cannot be written.
    """
    refuse(path, force)
    view = view_of(trial, others)
    figures = pictures.draw(view, progress and (lambda share: progress(0.5 * share)))
    name = trial.scene or 'Recorded trial'
    parts = [
        heading(name, _facts(trial)),
        f'<p class="result">{html.escape(_result(view))}</p>',
        *map(warning, _warnings(trial)),
    ]
    sections = {}
    with matplotlib.rc_context(PAPER_STYLE):
        for number, (key, drawn) in enumerate(figures.items()):
            sections[key] = section(drawn)
            if progress:
                progress(0.5 + 0.5 * number / len(figures))
    # The comparison of policies stands before the metrics; the other figures follow below.
    parts.append(sections.pop('comparison', ''))
    parts.append('<h2>Metrics</h2>' + _metrics_tables(view))
    parts += sections.values()
    if words := unobservable_shares(trial, view.load_gate):
        parts.append(f'<h2>Where the ground was observable</h2><p>{html.escape(words)}</p>')
    parts.append('<h2>What the model has and leaves out</h2>' + _fidelity_note(view))
    parts.append(_terms_table(view.settings))
    parts.append('<h2>Conditions</h2>' + plain_table(conditions.rows(trial)))
    save(path, page(f'{name}: ros_pad', parts).encode())
    if progress:
        progress(1.0)


def drawn(
    trial: Trial, others: Iterable[Trial] = (), progress: Progress | None = None
) -> dict[str, Drawn]:
    """Draw the figures of a trial's report, by name, for a paper.

    They are 85 mm (one column) or 175 mm (two columns) wide, with type of 8 points;
    :func:`ros_pad.reports.files.write_figures` writes them. Parameters are as for :func:`write`.
    """
    return pictures.draw(view_of(trial, others), progress)


def _warnings(trial: Trial) -> list[str]:
    found = []
    if trial.settings.get('interrupted'):
        found.append('The trial was stopped early: its metrics are those of the part before.')
    found += [f'Scheduled fault: {fault}' for fault in trial.settings.get('faults', ())]
    if trial.metrics is not None:
        found += [
            f'A foot that should be a dome stayed flat: {why}' for why in trial.metrics.refusals
        ]
        found += fault_lines(trial.metrics.faults)
    if trial.settings.get('repaired'):
        found.append(
            'The bag was repaired: its recorder was stopped, and its last messages are missing.'
        )
    if lost := trial.settings.get('lost'):
        counts = ', '.join(f'{count} on {topic}' for topic, count in sorted(lost.items()))
        found.append(f'Messages were lost before the recorder received them: {counts}.')
    found += [f'{line}.' for line in trial.settings.get('late', ())]
    if trial.settings.get('problem'):
        found.append(str(trial.settings['problem']))
    return found

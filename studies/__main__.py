# SPDX-License-Identifier: Apache-2.0
"""Run one study: ``python -m studies NAME``, from a checkout of ros_pad."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from ros_pad.commands.command import exit_status

STUDIES = {
    'contact': ('work_precision.contact', 'methods for the contact model (15 s)'),
    'meniscus': ('work_precision.meniscus', 'methods for the meniscus (90 s)'),
    'capillary': ('work_precision.capillary', 'methods for liquid on meshes (2 min)'),
    'walk': ('work_precision.walk.study', 'fidelity levels of a walk (1 min, with Drake 30 min)'),
    'limit_surface': ('work_precision.limit_surface', 'force and moment of turning soles (30 s)'),
    'stability': ('work_precision.stability', 'where usual methods and ours go wrong (15 s)'),
    'estimator': ('work_precision.estimator.study', 'methods of slip and wetness (20 min)'),
    'priors': ('work_precision.estimator.priors', 'friction with wrong foot files (15 min)'),
    'sensing': ('sensing.study', 'body and slip from IMU, joints and forces (3 min)'),
    'foreign': ('sensing.foreign', 'the same on recordings of real robots (2 min)'),
    'film': ('work_precision.film', 'liquid squeezed from under soft pads (6 min)'),
    'bench': ('thesis.bench_command', 'one pad of the thesis beside its measurements (5 s)'),
    'thesis': ('thesis.command', 'all figures and statements of the thesis (1 min)'),
    'behaviour': ('closed_loop.behaviour', 'metrics of every scene, and what changed (5 min)'),
    'assumptions': ('closed_loop.assumptions', 'assumed numbers wrong by a factor of 2 (1 h)'),
    'policies': ('closed_loop.policies', 'policies beside rivals on held-out floors (35 min)'),
    'landing': ('closed_loop.landing', 'feet that land more slowly, where it could pay (15 min)'),
    'moulds': ('moulds', 'moulds of shipped and random feet, judged (11 min)'),
    'force_limits': ('closed_loop.force_limits', 'force limits of pads by each criterion (10 s)'),
    'fidelity': (
        'closed_loop.fidelity',
        'bounds of the fidelity levels, and if they hold (40 min)',
    ),
    'gaits': ('closed_loop.gaits', 'quadrupeds from their URDF files alone (5 min)'),
    'forces': ('work_precision.forces', 'forces of feet within their cones (2 min)'),
    'gait_charts': ('closed_loop.gait_charts', 'a cycle, steps and falls of such a gait (10 min)'),
    'faults': ('closed_loop.faults', 'a walk with faults, with and without monitor (8 min)'),
    'joints': ('closed_loop.joints', 'walks without markers, beside those with them (10 min)'),
    'labelled_contacts': ('closed_loop.labelled_contacts', 'slip alarm on recorded contacts'),
    'lead_picture': ('closed_loop.lead_picture', 'picture and figures of the README (2 min)'),
    'nodes': ('nodes.cost', 'time of trials and nodes, beside another checkout (20 min)'),
    'flood': ('nodes.flood', 'the regulator node under floods of messages (2 min)'),
    'fuzz': ('nodes.fuzz', 'every parser against random input (needs atheris)'),
}
"""Module of each study in this package, and a line about it, with its duration on two cores if it
is fixed."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the study that the first word names; return the exit status.

    Without a word, with ``--help`` or with an unknown name, print the list of studies; the status
    is 2 for an unknown name, else 0.
    """
    name, *rest = [*(sys.argv[1:] if words is None else words)] or ['--help']
    if name not in STUDIES:
        width = max(map(len, STUDIES))
        rows = [f'  {study:{width}}  {text}' for study, (_, text) in STUDIES.items()]
        print('usage: python -m studies NAME [--help]\n\n' + '\n'.join(rows))
        return 0 if name in ('-h', '--help') else 2
    return exit_status(lambda: _run(name, rest), f'studies {name}')


def _run(name: str, words: Sequence[str]) -> int:
    import ros_pad.reports  # noqa: F401  without Matplotlib, an error with the remedy
    from studies import command

    study = importlib.import_module(f'studies.{STUDIES[name][0]}')
    if hasattr(study, 'main'):
        return int(study.main(words))
    return command.compare_methods(name, study, words)


if __name__ == '__main__':
    sys.exit(main())

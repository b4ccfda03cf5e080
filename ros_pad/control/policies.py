# SPDX-License-Identifier: Apache-2.0
"""Policies that choose flat or dome for the next step of a foot that lifts off."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ros_pad.configuration import Setting, choice, number
from ros_pad.errors import InvalidInput

FLAT = 'flat'
DOME = 'dome'


@dataclass(frozen=True)
class LiftOff:
    """Inputs of a policy when a foot lifts off.

    Attributes
    ----------
    leg : int
        Number of the leg.
    morphology : str
        Morphology of the step that ends, ``flat`` or ``dome``.
    steps : float
        Number of steps (no unit) with that morphology, including the one that ends; infinite
        before the first change.
    probing : bool
        Whether that step was a probe.
    wet_ahead : float
        Probability that the ground is wet where the foot will stand next, 0 to 1.
    next_position : tuple of float
        Position where the foot will stand next, x and y, m.
    others_probing : bool
        Whether another leg probes now.
    flat_pays : bool
        Whether flat feet have more friction on dry ground than domes.
    break_even : float
        Probability of wet ground, 0 to 1, at which flat feet and domes are expected to have the
        same friction.
    """

    leg: int
    morphology: str
    steps: float
    probing: bool
    wet_ahead: float
    next_position: tuple[float, float]
    others_probing: bool
    flat_pays: bool = True
    break_even: float = 0.0


@dataclass(frozen=True)
class Choice:
    """Morphology of the next step, and whether that step is a probe.

    Attributes
    ----------
    morphology : str
        ``flat`` or ``dome``.
    probe : bool
        Whether the step is a probe.
    """

    morphology: str
    probe: bool = False


Policy = Callable[[LiftOff], Choice]

IsWet = Callable[[float, float], bool]
"""Function that returns whether the ground is wet at x and y, m."""

SETTINGS = (
    Setting('policy.wet_above', 0.65,
            'Adaptive policy: probability of wet ground ahead above which a foot becomes a dome,'
            ' if domes are expected to hold more there.',
            '', 0.0, 1.0),
    Setting('policy.dry_below', 0.35,
            'Adaptive policy: probability of wet ground ahead below which a foot becomes flat; at'
            ' most policy.wet_above.', '', 0.0, 1.0),
    Setting('policy.probe_below', 0.8,
            'Adaptive policy: probability of wet ground ahead below which a domed foot probes.',
            '', 0.0, 1.0),
    Setting('policy.dwell', 2, 'Adaptive policy: steps for which a morphology is kept at least.',
            'steps', 1, 1000),
)  # fmt: skip
"""The settings of :func:`adaptive`, each named ``policy.`` and its argument."""

SELDOM = 64
"""Steps as a dome, since a foot was flat, after which it probes where flat feet do not pay:
perhaps they do again."""

PREFIX = 'policy.'
_DEFAULTS = {each.name.removeprefix(PREFIX): each.default for each in SETTINGS}


def flat(step: LiftOff) -> Choice:
    """Choose flat at every step.

    Parameters
    ----------
    step : LiftOff
        The foot that lifts off; not used.

    Returns
    -------
    Choice
        ``flat``, no probe.
    """
    return Choice(FLAT)


def dome(step: LiftOff) -> Choice:
    """Choose dome at every step.

    Parameters
    ----------
    step : LiftOff
        The foot that lifts off; not used.

    Returns
    -------
    Choice
        ``dome``, no probe.
    """
    return Choice(DOME)


def adaptive(
    wet_above: float = _DEFAULTS['wet_above'],
    dry_below: float = _DEFAULTS['dry_below'],
    probe_below: float = _DEFAULTS['probe_below'],
    dwell: int = _DEFAULTS['dwell'],
) -> Policy:
    """Return a policy that follows the probability of wet ground, with hysteresis and probes.

    The friction of a dome hardly depends on whether the ground is wet, so under domes the estimate
    only fades: without probes, feet would stay domes for ever after the first wet ground. A probe
    is one flat step of a foot that is otherwise a dome. One leg probes at a time. Where flat feet
    do not pay, feet are domes on dry ground, too, and probe :data:`SELDOM` steps after they were
    flat; those that were domes from the start do not.

    Parameters
    ----------
    wet_above, dry_below : float
        Probabilities of wet ground ahead, 0 to 1, above which a foot becomes a dome, if that is
        above break-even, too, and below which it becomes flat again.
    probe_below : float
        Probability of wet ground ahead, 0 to 1, below which a domed foot probes.
    dwell : int
        Steps for which a morphology is kept at least, except in probes.

    Returns
    -------
    callable
        Policy: a function of :class:`LiftOff` that returns a :class:`Choice`.

    Raises
    ------
    InvalidInput
        For a probability outside 0 to 1, ``dry_below`` above ``wet_above``, or ``dwell`` outside
        its range.

    Examples
    --------
    >>> from ros_pad.control import LiftOff, adaptive
    >>> policy = adaptive(wet_above=0.65)
    >>> policy(LiftOff(1, 'flat', 3, False, 0.9, next_position=(0.1, 0), others_probing=False))
    Choice(morphology='dome', probe=False)
    """
    for setting, value in zip(SETTINGS, (wet_above, dry_below, probe_below, dwell), strict=True):
        setting.accept(value)
    number('policy.dry_below', dry_below, '', high=wet_above)

    def choose(step: LiftOff) -> Choice:
        if not (step.probing or step.steps >= dwell):
            return Choice(step.morphology)
        wet, even = step.wet_ahead, step.break_even
        if step.morphology == FLAT:
            return Choice(FLAT if wet <= max(wet_above, even) and step.flat_pays else DOME)
        if wet < dry_below and step.flat_pays:
            return Choice(FLAT)
        due = wet < max(probe_below, even) if step.flat_pays else SELDOM <= step.steps < math.inf
        probe = due and not step.others_probing
        return Choice(FLAT if probe else DOME, probe)

    return choose


def oracle(is_wet: IsWet) -> Policy:
    """Return a policy that chooses by the true ground at the foot's next position.

    Parameters
    ----------
    is_wet : callable
        Function of x and y, m, that returns whether the ground is wet there.

    Returns
    -------
    callable
        Policy, as from :func:`adaptive`.
    """
    return lambda step: Choice(DOME if is_wet(*step.next_position) else FLAT)


def first_morphologies(policy: str, legs: Sequence[int]) -> dict[int, str]:
    """Return the morphology that each leg starts with under a policy.

    With the adaptive policy the first and the last leg start flat to measure the ground; the
    others start as domes. Of a hexapod these are one of each tripod, of a quadruped one diagonal.
    On an unknown floor, six flat feet lose more on wet ground than six domes on dry ground, and
    two flat feet are enough to estimate the ground.

    Parameters
    ----------
    policy : str
        Name of a policy, see :data:`POLICIES`.
    legs : sequence of int
        Numbers of the legs, in their order about the body.

    Returns
    -------
    dict of int to str
        ``flat`` or ``dome`` for each leg.

    Raises
    ------
    InvalidInput
        For an unknown policy.

    Examples
    --------
    >>> from ros_pad.control import first_morphologies
    >>> first_morphologies('adaptive', [1, 2, 3])
    {1: 'flat', 2: 'dome', 3: 'flat'}
    """
    choice('policy', policy, POLICIES)
    if policy == 'adaptive':
        return {leg: FLAT if leg in (legs[0], legs[-1]) else DOME for leg in legs}
    return dict.fromkeys(legs, DOME if policy == 'dome' else FLAT)


POLICIES = ('flat', 'dome', 'adaptive', 'oracle')
"""Names of the policies."""


def policy_named(
    name: str,
    is_wet: IsWet | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Policy:
    """Return a policy by its name.

    Parameters
    ----------
    name : str
        One of :data:`POLICIES`.
    is_wet : callable or None
        Function that returns whether the ground is wet at x and y, m; only ``oracle`` needs it.
    parameters : mapping or None
        Arguments of :func:`adaptive` by name; the other policies have none.

    Returns
    -------
    callable
        Policy, as from :func:`adaptive`.

    Raises
    ------
    InvalidInput
        For an unknown name, an oracle without ``is_wet``, or a parameter that the policy does not
        have or that is outside its range.
    """
    choice('policy', name, POLICIES)
    if parameters and name != 'adaptive':
        raise InvalidInput(
            f'policy = {name!r} has no parameters, but {", ".join(parameters)} was given:'
            ' only the adaptive policy has parameters'
        )
    if name == 'oracle':
        if is_wet is None:
            raise InvalidInput("policy = 'oracle' needs the map of the floor (is_wet)")
        return oracle(is_wet)
    for parameter in parameters or ():
        choice('parameter of the adaptive policy', parameter, tuple(_DEFAULTS))
    return {'flat': flat, 'dome': dome}.get(name) or adaptive(**(parameters or {}))

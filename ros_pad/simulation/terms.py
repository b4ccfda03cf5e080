# SPDX-License-Identifier: Apache-2.0
"""The physical terms of a scene: those that a trial has, those that it leaves out, and why.

A term matters if its effect on the scene's metric is above the scene's accuracy. Most terms change
the friction of the feet; their effect is estimated with that of five per cent more friction, which
was measured on random scenes as the errors of the levels were.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from ros_pad.contact import WATER, hysteresis_force
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.resistance import THICK_FILM
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.margin import Stand, grounds, mid_stance_grip
from ros_pad.simulation.pneumatics import ATMOSPHERE
from ros_pad.simulation.scene import Scene

ADVANCING, RECEDING = 2.0944, 1.5708
"""Contact angles of water on the pads, rad, with which the force of contact lines is added."""

LINES = 'capillary force of the pads'

_FILM_ERROR = 0.03  # of dry contact; test_film.py
_STEP = 0.05  # more friction, with which its effect was measured
_VOIDS = 1.12  # Voids fill slowly: suction lasts 1.08 to 1.11 times; test_fidelity.py


@dataclass(frozen=True)
class Term:
    """A physical term that a trial has or leaves out.

    Attributes
    ----------
    term : str
        Name of the term.
    bound : float or None
        What the term changes, as a share of the quantity that ``reason`` names first; None if
        that is not known.
    reason : str
        To what the bound is relative, and its source.
    kind : str
        ``bound`` if the term cannot change more, ``promise`` if it does not in 95 of 100 scenes.
    taken : bool
        Whether the trial has the term.
    effect : float or None
        Estimated effect on the scene's metric, as a share of it; None if it is not known.
    exceeds : bool
        Whether the trial leaves out a term whose effect is above the scene's accuracy.
    """

    term: str
    bound: float | None
    reason: str
    kind: str = 'bound'
    taken: bool = False
    effect: float | None = None
    exceeds: bool = False


def terms(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> list[Term]:
    """Return the terms that a trial of this scene has or leaves out on a level.

    Parameters
    ----------
    scene, fidelity, policy
        As for :func:`ros_pad.simulation.fidelity.choose`.

    Raises
    ------
    InvalidInput
        When the level does not exist, or does not model the scene's robot.
    """
    policy = policy or scene.policy
    level = levels.level(scene, fidelity, policy)
    found = [] if scene.floor.kind == 'dry' else _of_liquid(scene, policy)
    if level == 'L1':
        found.append(_joints(scene, policy))
    if level != 'L0':
        found.append(_sole(scene, policy))
    found.append(replace(_soft_pads(scene), taken=level == 'L1'))
    if policy != 'flat':
        found.append(_air(scene))
    if level != 'L0':
        reason = 'of the friction: what turns on the spot holds no force along the ground'
        found.append(Term('torsion of the soles', 1.0, reason, taken=True))
    if scene.foot.pad.material is not None:
        reason = (
            f'above {pressure_end(scene.foot.pad)[0]:.6g} Pa the air under the pads keeps its'
            f' volume; the ceiling of the foot is {scene.foot.ceiling:g} Pa'
        )
        found.append(Term('pads that balloon', None, reason))
    return [
        replace(term, exceeds=not term.taken and (term.effect or 0.0) > scene.accuracy)
        for term in found
    ]


def with_terms(scene: Scene) -> Scene:
    """Return a scene with the terms that can be added and whose effect is above its accuracy.

    This is the hysteresis of the contact lines of domes on wet ground. To a scene with an accuracy
    of 1 nothing is added.
    """
    if scene.foot.capillary_force or not _lines(scene).taken:
        return scene
    radius, tension = scene.foot.pad.radius, WATER.surface_tension
    force = float(hysteresis_force(radius, tension, ADVANCING, RECEDING))
    return replace(scene, foot=replace(scene.foot, capillary_force=force))


def _lines(scene: Scene) -> Term:
    """Return the term of contact lines that are dragged, which only domes have."""
    foot = scene.foot
    if foot.capillary_force:
        return Term(LINES, None, 'the file of the foot has it', taken=True)
    # At most γ w (cos θ_rec - cos θ_adv) <= 2 γ w, with w = 2 r0 for each pad.
    most = foot.pads * 2.0 * WATER.surface_tension * 2.0 * foot.pad.radius
    reason = (
        'of the friction of a loaded foot: full hysteresis of the contact angle (180 to 0 degrees)'
        ' on every pad'
    )
    term = Term(LINES, _share(most, foot.friction * scene.expected_load), reason)
    term = replace(term, effect=_by_friction(term, scene, 'dome'))
    if term.effect is None or not scene.accuracy < min(1.0, term.effect):
        return term
    reason += '; added, since its effect is above the accuracy required'
    return replace(term, taken=True, reason=reason)


def _by_friction(term: Term, scene: Scene, policy: str) -> float | None:
    """Return the effect of a term that changes the friction; None if unknown."""
    if term.bound is None or scene.floor.kind == 'dry':
        return None
    effect = levels.Promises.load().bound(levels.FRICTION, scene, policy)
    return term.bound * (effect / _STEP) if effect < math.inf else None


def _share(part: float, whole: float) -> float | None:
    """Return a part over the whole; None if that is nothing, as the friction of some feet is."""
    return part / whole if whole else None


def _brief(value: float) -> str:
    return f'{float(f"{value:.3g}"):g}'


def _of_liquid(scene: Scene, policy: str) -> list[Term]:
    """Return the terms of wet ground."""
    stand = Stand(scene, policy != 'flat')
    films = stand.films(0.5 * scene.gait.stance)
    now = stand.resistance(*films)
    thick, none = stand.resistance(THICK_FILM, THICK_FILM), stand.resistance(0.0, 0.0)
    of_friction = [
        Term(
            'film that drains',
            _share(max(abs(thick - now), abs(none - now)), now),
            'of the friction on wet ground in mid-stance: a film that never drains, or none',
            taken=True,
        ),
        Term(
            'liquid dragged under a sole that slips',
            _share(abs(now - stand.resistance(films[0], THICK_FILM)), now),
            'of the friction on wet ground in mid-stance: no dry contact under the flat sole',
        ),
        _pull(scene, policy),
    ]
    if stand.on_domes > 0.0:
        dry = abs(stand.resistance(0.0, THICK_FILM) - thick)
        of_friction.append(
            Term(
                'shape of the film under domes',
                _share(_FILM_ERROR * dry, now),
                'of the friction on wet ground in mid-stance: 3 points of dry contact, rms of the'
                ' film over load histories beside its elastohydrodynamic equation',
                kind='promise',
            )
        )
    found = [_suction(scene, policy)]
    if scene.floor.roughness:
        reason = 'roughness enters as one composite height of pad and floor'
        found.append(Term('liquid held in the valleys of a rough floor', None, reason))
    if policy != 'flat':
        found.append(_lines(scene))
    return found + [replace(e, effect=_by_friction(e, scene, policy)) for e in of_friction]


def _pull(scene: Scene, policy: str) -> Term:
    """Return the pull of liquid on a foot that stands in it; one that adapts may be flat, too.

    The liquid around is deeper than that below, so that its surface meets the foot from outside:
    it pulls at a line of contact, at most with its tension all round.
    """
    foot = scene.foot
    lines = [0.0 if policy == 'flat' else foot.pads * foot.pad.radius]
    if policy != 'dome' or Stand(scene, True).on_sole > 0.0:
        lines.append(foot.sole_radius)
    pull = 2.0 * math.pi * max(lines) * WATER.surface_tension
    return Term(
        'pull of the liquid to the floor',
        pull / scene.expected_load,
        f'of the load of a foot: at most {_brief(pull)} N, its tension along the line of contact',
    )


def _suction(scene: Scene, policy: str) -> Term:
    """Return the pull of the film at lift-off.

    A swing begins with a rise of k t²/2 from the film that a stance leaves. A policy that adapts
    has flat feet on wet ground, too: until it has found out.
    """
    gait = scene.gait
    rise = 2.0 * gait.lift * (math.pi / (gait.cycle - gait.stance)) ** 2
    impulse, most = 0.0, 0.0
    for dome in {'flat': (False,), 'dome': (True,)}.get(policy, (False, True)):
        stand = Stand(scene, dome)
        count, radius = stand.discs
        film = stand.films(gait.stance)[count == 1]
        force = ATMOSPHERE * count * math.pi * radius**2
        pull = force * _suction_time(radius, film, rise, scene.floor.viscosity)
        impulse, most = max((impulse, most), (pull, force))
    term = Term(
        'suction of the film at lift-off',
        impulse / (scene.expected_load * gait.stance),
        f'of the impulse of a load of {_brief(scene.expected_load)} N in its stance: as much as'
        f' {_brief(most)} N, a vacuum below the whole contact, for {_brief(1e3 * impulse / most)}'
        ' ms; it loads the feet that stand',
    )
    return replace(term, effect=_of_one(term, 1.0, scene, policy))


def _suction_time(radius: float, film: float, rise: float, viscosity: float) -> float:
    """Return the impulse of a disc of a radius, m, over the force of a vacuum below it, s.

    It rises from a film, m, by ``rise`` t²/2. Suction below it is 3 η V (a² - r²)/h³ (Reynolds
    1886) up to a vacuum: liquid parts to a radius c, where the suction is that of a vacuum and
    even (Swift 1932, Stieber 1933). With u = c²/a², and x vacuums that the centre would have, x =
    1/(1 - u + u ln u), and the force is x (1 - u)²/2 of the full one.
    """
    parted = 1.0 - np.geomspace(1.0, 1e-6, 200)
    more = 1.0 / (1.0 - parted + parted * np.log(np.maximum(parted, 1e-9)))
    time = np.geomspace(1e-6, 1.0, 1000)  # s
    height = film + 0.5 * rise * time**2
    share = 3.0 * viscosity * rise * time * radius**2 / (ATMOSPHERE * height**3)
    broken = np.interp(share, more, 0.5 * more * (1.0 - parted) ** 2)
    force = np.where(share < 1.0, 0.5 * share, broken)
    return float(_VOIDS * 0.5 * (force[1:] + force[:-1]) @ np.diff(time))


def _air(scene: Scene) -> Term:
    """Return what pads that never fill would change."""
    found = []
    for wet in grounds(scene):
        dome, flat = (mid_stance_grip(scene, each, wet) for each in (True, False))
        found.append(_share(abs(dome - flat), dome))
    known = [each for each in found if each is not None]
    bound = max(known) if len(known) == len(found) else None
    reason = 'of the friction in mid-stance: pads that never fill'
    return Term('air in hose and pads', bound, reason, taken=True)


def _joints(scene: Scene, policy: str) -> Term:
    bound = levels.Promises.load().bound('L1', scene, policy)
    known = bound if bound < math.inf else None
    reason = (
        f'of the {scene.metric}: L1 against the top level, on which feet slip by millimetres where'
        ' those of L1 stick'
    )
    name = 'joints, servos, scuffing at touch-down, swinging legs, pitch and roll'
    return Term(name, known, reason, kind='promise', effect=known)


def _of_one(term: Term, share: float, scene: Scene, policy: str) -> float | None:
    """Return the effect of a share of a term that changes the load of one of the standing feet.

    On a rail, loads are given.
    """
    if not share or not isinstance(scene.gait, WalkingGait):
        return 0.0
    feet = int(len(scene.legs) * scene.gait.duty + 1e-9)
    assert term.bound is not None
    return _by_friction(replace(term, bound=share * term.bound / feet), scene, policy)


def _sole(scene: Scene, policy: str) -> Term:
    """Return what a foot that is a point, on an ankle that tilts freely, leaves out.

    The centre of pressure of a sole moves by a radius R at most. On three feet moments balance
    about the line through two of them: the load of the third, at a height h, moves by W R/h; that
    of two feet at a distance d by W R/d.
    """
    (body, gait), found, longest = scene.legged, 0.0, 0.0
    for middle in set(gait.middles):
        feet = [home for home, own in zip(body.homes, gait.middles, strict=True) if own == middle]
        if len(feet) not in (2, 3):
            return Term(
                'size of the sole', None, 'loads of feet are not those of a tripod or trot'
            )
        longest = max(math.dist(a, b) for a, b in itertools.combinations(feet, 2))
        height = longest
        if len(feet) == 3:
            (x0, y0), (x1, y1), (x2, y2) = feet
            height = abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / longest
        found = max(found, len(feet) * scene.foot.sole_radius / height)
    term = Term(
        'size of the sole',
        found,
        'of the load of a foot: centres of pressure move by a radius of the sole; what'
        ' one foot loses others gain',
    )
    share = _differ(scene, policy, longest)
    return replace(term, effect=_of_one(term, share, scene, policy))


def _differ(scene: Scene, policy: str, distance: float) -> float:
    """Return by what share friction differs between feet at a distance, m, mean over a walk."""
    grips = [
        mid_stance_grip(scene, policy == 'dome' or (wet and policy != 'flat'), wet)
        for wet in grounds(scene)
    ]
    low, high = min(grips), max(grips)
    if low == high:
        return 0.0
    floor, between = scene.floor, 1.0
    if floor.kind == 'patches':  # the probability that one foot is on wet ground, the other on dry
        wet, dry = floor.wet_fraction, 1.0 - floor.wet_fraction
        between = 2.0 * wet * dry * -math.expm1(-distance / (floor.patch_length * dry))
    return between * 2.0 * (high - low) / (high + low)


def _soft_pads(scene: Scene) -> Term:
    gait, foot = scene.gait, scene.foot
    grip = max(mid_stance_grip(scene, dome, False) for dome in (False, True))
    steps = 2.0 if isinstance(gait, WalkingGait) else 1.0
    lost = steps * grip * scene.expected_load / foot.shear_stiffness / gait.stride
    return Term(
        'effect of soft pads on the motion of the body',
        lost,
        'of the distance: at each step the pads shear by the whole grip over their stiffness, and'
        ' nothing of this shear is recovered',
        effect=lost if scene.metric == 'distance' else None,
    )

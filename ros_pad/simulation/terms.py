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

from ros_pad.contact import WATER, capillary_pull, hysteresis_force
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.resistance import THICK_FILM
from ros_pad.contact.squeeze import STIFF, dry_share
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.margin import Stand, dome_pressure, grounds, mid_stance_grip, stance
from ros_pad.simulation.pneumatics import ATMOSPHERE
from ros_pad.simulation.scene import LeggedBody, RailGait, Scene

ADVANCING, RECEDING = 2.0944, 1.5708
"""Contact angles of water on the pads, rad, with which the force of contact lines is added."""

LINES = 'capillary force of the pads'

_STEP = 0.05  # more friction, with which its effect was measured


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
    policy = scene.policy if policy is None else policy
    level = levels.level(scene, fidelity, policy)
    found = []
    if scene.floor.kind != 'dry':
        worth = _worth_of_friction(scene, policy)
        found += _of_liquid(scene, policy)
        if policy != 'flat':
            found.append(_lines(scene))
        found += [_by_friction(term, worth) for term in _of_friction(scene, policy)]
    if level == 'L1':
        found.append(_joints(scene, policy))
    if level != 'L0':
        found.append(_sole(scene))
    found.append(replace(_soft_pads(scene), taken=level == 'L1'))
    found += _always(scene, level, policy)
    return [
        replace(
            term,
            exceeds=not term.taken and term.effect is not None and term.effect > scene.accuracy,
        )
        for term in found
    ]


def with_terms(scene: Scene) -> Scene:
    """Return a scene with the terms that can be added and whose effect is above its accuracy.

    This is the hysteresis of the contact lines of domes on wet ground. To a scene with an accuracy
    of 1 nothing is added.
    """
    if scene.foot.capillary_force or not _lines(scene).taken:
        return scene
    force = float(
        hysteresis_force(scene.foot.pad.radius, WATER.surface_tension, ADVANCING, RECEDING)
    )
    return replace(scene, foot=replace(scene.foot, capillary_force=force))


def _lines(scene: Scene) -> Term:
    """Return the term of contact lines that are dragged, which only domes have."""
    foot = scene.foot
    if foot.capillary_force:
        return Term(LINES, None, 'the file of the foot has it', taken=True)
    # At most γ w (cos θ_rec - cos θ_adv) <= 2 γ w, with w = 2 r0 for each pad.
    most = foot.pads * 2.0 * WATER.surface_tension * 2.0 * foot.pad.radius
    share = _share(most, foot.friction * scene.expected_load)
    worth = None if scene.floor.kind == 'dry' else _worth_of_friction(scene, 'dome')
    term = _by_friction(
        Term(
            LINES,
            share,
            'of the friction of a loaded foot: full hysteresis of the contact angle (180 to 0'
            ' degrees) on every pad',
        ),
        worth,
    )
    if term.effect is None or not scene.accuracy < min(1.0, term.effect):
        return term
    reason = f'{term.reason}; added, since its effect is above the accuracy required'
    return replace(term, taken=True, reason=reason)


def _worth_of_friction(scene: Scene, policy: str) -> float | None:
    """Return the relative change of the metric over that of the friction; None if unknown."""
    promises = levels.Promises.load()
    if promises.beyond(scene, policy):
        return None
    effect = promises.bound(levels.FRICTION, scene, policy)
    return effect / _STEP if effect < math.inf else None


def _share(part: float, whole: float) -> float | None:
    """Return a part over the whole; None if that is nothing, as the friction of some feet is."""
    return part / whole if whole else None


def _by_friction(term: Term, worth: float | None) -> Term:
    """Return a term that changes the friction with its effect on the distance."""
    if term.bound is None or worth is None:
        return term
    return replace(term, effect=term.bound * worth)


def _of_friction(scene: Scene, policy: str) -> list[Term]:
    """Return the terms of liquid that change the friction of the feet."""
    stand = Stand(scene, policy != 'flat')
    now = stand.resistance(*stand.films(0.5 * stance(scene)))
    ends = stand.resistance(THICK_FILM, THICK_FILM), stand.resistance(0.0, 0.0)
    found = [
        Term(
            'film that drains',
            _share(max(abs(each - now) for each in ends), now),
            'of the friction on wet ground in mid-stance: a film that never drains, or none; it'
            ' costs no time',
            taken=True,
        )
    ]
    if soft := _soft_film(scene, policy):
        found.append(soft)
    found.append(_pull(scene, policy))
    return found


def _pull(scene: Scene, policy: str) -> Term:
    """Return the pull of liquid on a foot; one that adapts may be flat on wet ground, too."""
    foot = scene.foot
    highest = 2.0 * math.sqrt(WATER.surface_tension / WATER.density / GRAVITY)
    film = min(scene.floor.film_thickness, highest)
    # Domes are wetted to their rims, a foot that is flat or pressed flat all over.
    domed = policy == 'dome' and Stand(scene, True).on_sole == 0.0
    count, radius = (foot.pads, foot.pad.radius) if domed else (1, foot.sole_radius)
    pull = count * float(capillary_pull(radius, film, WATER))
    return Term(
        'pull of the liquid to the floor',
        pull / scene.expected_load,
        f'of the load of a foot: at most {_brief(pull)} N at rest on ground that stays wet',
    )


def _of_liquid(scene: Scene, policy: str) -> list[Term]:
    """Return the other terms of liquid."""
    found = [
        _suction(scene, policy),
        Term(
            'liquid dragged under a slipping foot',
            None,
            'the film is assumed to move with the foot; at 10 mm/s a plane wedge drags at most'
            f' {1e6 * dragged_film(scene, 0.01):.2g} um under a dome; a film of'
            f' {1e6 * scene.foot.critical_film:.2g} um leaves 1/e of dry contact',
        ),
    ]
    if scene.floor.roughness:
        found.append(
            Term(
                'liquid held in the valleys of a rough floor',
                None,
                'roughness enters as one composite height of pad and floor',
            )
        )
    return found


def _always(scene: Scene, level: str, policy: str) -> list[Term]:
    """Return the terms that a level always has, and pads that balloon, which none has."""
    found = []
    if policy != 'flat':
        grips = (
            [mid_stance_grip(scene, dome, wet) for dome in (True, False)] for wet in grounds(scene)
        )
        shares = [_share(abs(dome - flat), dome) for dome, flat in grips]
        found.append(
            Term(
                'air in hose and pads',
                None if None in shares else max(each or 0.0 for each in shares),
                'of the friction in mid-stance: pads that never fill; it costs no time',
                taken=True,
            )
        )
    if level != 'L0':
        found.append(
            Term(
                'torsion of the soles',
                1.0,
                'of the friction: what turns on the spot holds no force along the ground; it costs'
                ' no time',
                taken=True,
            )
        )
    if scene.foot.pad.material is not None:
        found.append(
            Term(
                'pads that balloon',
                None,
                f'above {pressure_end(scene.foot.pad)[0]:.6g} Pa the air under the pads keeps its'
                f' volume; the ceiling of the foot is {scene.foot.ceiling:g} Pa',
            )
        )
    return found


def _joints(scene: Scene, policy: str) -> Term:
    bound = levels.choose(scene, 'L1', policy).bound
    known = bound if bound < math.inf else None
    return Term(
        'joints, servos, scuffing at touch-down, swinging legs, pitch and roll',
        known,
        f'of the {scene.metric}: L1 against the top level, on which feet slip by millimetres where'
        ' those of L1 stick',
        kind='promise',
        effect=known,
    )


def _sole(scene: Scene) -> Term:
    """Return what a foot that is a point, on an ankle that tilts freely, leaves out.

    The centre of pressure of a sole moves by a radius R at most. On three feet moments balance
    about the line through two of them: the load of the third, at a height h, moves by W R/h.
    """
    gait, body = scene.gait, scene.body
    assert isinstance(gait, WalkingGait) and isinstance(body, LeggedBody)
    found = 0.0
    for middle in set(gait.middles):
        feet = [home for home, own in zip(body.homes, gait.middles, strict=True) if own == middle]
        if not gait.pushes or len(feet) != 3:
            return Term('size of the sole', None, 'loads of feet are not those of a tripod')
        longest = max(math.dist(a, b) for a, b in itertools.combinations(feet, 2))
        (x0, y0), (x1, y1), (x2, y2) = feet
        area = abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
        found = max(found, 3.0 * scene.foot.sole_radius * longest / area)
    return Term(
        'size of the sole',
        found,
        'of the load of a foot on a tripod: centres of pressure move by a radius of the sole; what'
        ' one foot loses others gain',
    )


def _soft_film(scene: Scene, policy: str) -> Term | None:
    """Return what Stefan and Reynolds leave out under a soft foot; None if that is nothing."""
    stand, time = Stand(scene, policy != 'flat'), 0.5 * stance(scene)
    foot, found = stand.foot, []
    for name, rigid, middle, mean in stand.dimples(time):
        if mean >= STIFF * rigid:
            dry = math.exp(-((rigid / foot.critical_film) ** foot.film_exponent))
            left = dry_share(middle, foot.critical_film, foot.film_exponent)
            found.append(
                f'; for a load at once, under the {name} the dimple is'
                f' {_brief(1e6 * middle)} um thick and leaves {100.0 * left:.1f} % of the contact'
                f' dry, the rigid film of {_brief(1e6 * rigid)} um {100.0 * dry:.1f} %'
            )
    if not found:
        return None
    most = stand.resistance(*stand.films(time))
    return Term(
        'dimple of the film under a soft foot',
        _share(abs(most - stand.resistance(THICK_FILM, THICK_FILM)), most),
        'of the friction on wet ground in mid-stance: no dry contact at all' + ''.join(found),
    )


def _brief(value: float) -> str:
    return f'{float(f"{value:.3g}"):g}'


def _suction(scene: Scene, policy: str) -> Term:
    """Return the pull of the film at lift-off.

    A policy that adapts has flat feet on wet ground, too: until it has found out.
    """
    domes = {'flat': (False,), 'dome': (True,)}.get(policy, (False, True))
    terms = [_suction_under(Stand(scene, dome), scene) for dome in domes]
    return max(terms, key=lambda term: term.bound or 0.0)


def _suction_under(stand: Stand, scene: Scene) -> Term:
    """Return the pull of the film under a foot at lift-off.

    Rigid discs that part at a speed V: F = 3 π η a⁴ V/(2 h³), at most the atmosphere on them. A
    swing begins with h = k t²/2, so F falls below that after (12 π η a⁴/(k² F))^(1/5).
    """
    gait, stands = scene.gait, stance(scene)
    swing = gait.swing if isinstance(gait, RailGait) else gait.cycle - stands
    count, radius = stand.discs
    resistance = 1.5 * math.pi * scene.floor.viscosity * count * radius**4
    most = ATMOSPHERE * count * math.pi * radius**2
    rise = 2.0 * gait.lift * (math.pi / swing) ** 2
    until = (8.0 * resistance / (rise**2 * most)) ** 0.2
    films = stand.films(stands)
    film = films[1] if stand.on_sole > 0.0 else films[0]
    return Term(
        'suction of the film at lift-off',
        1.25 * most * until / (scene.expected_load * stands),
        f'of the impulse of a load of {_brief(scene.expected_load)} N in its stance: at most'
        f' {_brief(most)} N, the atmosphere on the contact, for {_brief(1e3 * until)} ms; rigid'
        f' discs with a film of {_brief(1e6 * film)} um pull with'
        f' {_brief(1e-3 * resistance / film**3)} N a mm/s',
    )


def _soft_pads(scene: Scene) -> Term:
    gait, foot = scene.gait, scene.foot
    grip = max(mid_stance_grip(scene, False, False), mid_stance_grip(scene, True, False))
    steps, length = (1.0, gait.stroke) if isinstance(gait, RailGait) else (2.0, gait.stride)
    lost = steps * grip * scene.expected_load / foot.shear_stiffness / length
    return Term(
        'effect of soft pads on the motion of the body',
        lost,
        'of the distance: at each step the pads shear by the whole grip over their stiffness, and'
        ' nothing of this shear is recovered',
        effect=lost if scene.metric == 'distance' else None,
    )


def dragged_film(scene: Scene, speed: float) -> float:
    """Return the thickest film, m, that a plane wedge can drag under domes at a slip speed, m/s.

    The optimum slider of Reynolds' equation (Rayleigh 1918; Hamrock, Fundamentals of Fluid Film
    Lubrication, ch. 8) carries a mean pressure of 0.160 η U L / h².
    """
    pressure = dome_pressure(scene)
    width = math.sqrt(scene.expected_load / pressure / scene.foot.pads / math.pi)
    return math.sqrt(0.160 * scene.floor.viscosity * speed * 2.0 * width / pressure)

# SPDX-License-Identifier: Apache-2.0
"""Quantitative statements in the text of the thesis, chapters 3 to 5, that have no figure."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.optimize import brentq

from ros_pad.capillary import bath_meniscus
from ros_pad.contact.dome import inflate, press
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit, largest_pressure, resized
from ros_pad.contact.material import Material
from ros_pad.contact.meniscus import WATER, capillary_pull, hysteresis_force, meniscus
from ros_pad.contact.pad import LARGE_PAD, Pad
from ros_pad.contact.resistance import Foot
from studies.thesis.explained import MINIMAL, Claim, claim
from studies.thesis.sole import CELLS, FLAT, TENSION

PRESSURE = 75e3  # Pa gauge
FORCES = (0.08, 0.19, 0.285)  # N, as the program of the thesis presses
WALKED = (40e3, 60e3, 75e3)  # Pa gauge, thesis 5.2
LOAD, FILM = 2.5, 3e-4  # N and m, of the foot and the floor of those walks


def claims() -> tuple[Claim, ...]:
    """Return all statements, in the order of the thesis."""
    parts = (_energy, _ring, _domes, _soles, _pad, _layers, _feet, _walks)
    return tuple(claim for part in parts for claim in part())


# --- chapter 3 -----------------------------------------------------------------------------------


def _energy() -> tuple[Claim, ...]:
    height = inflate(LARGE_PAD, PRESSURE).height
    tension = PRESSURE * LARGE_PAD.radius / LARGE_PAD.stiffness
    angle = brentq(lambda t: 4.0 * math.sin(t) - 2.0 * math.sin(2.0 * t) - tension, 0.1, 2.0)
    right = LARGE_PAD.radius * math.tan(angle)
    pressed = press(LARGE_PAD, PRESSURE, list(FORCES))
    slender = np.asarray(pressed.contact_radius) / np.asarray(pressed.sphere_radius)
    light = 1e-3
    touching = press(LARGE_PAD, PRESSURE, light)
    program = float(touching.contact_radius)
    # 3.53 with the minus of the text in 3.43, on the same sphere
    pull = 2.0 * math.pi * LARGE_PAD.adhesion_energy * float(touching.sphere_radius)
    text = math.sqrt((light - pull) / (math.pi * PRESSURE))
    return (
        claim(
            'the energy of a',
            f'As ∫T dS the same k gives a dome {1e3 * right:.2f} mm high at 75 kPa in place of '
            f'{1e3 * height:.2f} mm.',
            (right, height),
            bool(abs(right / height - 1.0) <= MINIMAL),
        ),
        claim(
            'adhesion costs energy 3',
            f'At 1 mN the contact radius is {100 * (text / program - 1):+.1f} % from that with '
            'the plus of the appendix.'.replace('-', '−'),
            (text, program),
            text > program,
        ),
        claim(
            'contact radius and depth',
            f'b/R = {_few(slender, ".2f")} at {_few(FORCES, "g")} N.',
            tuple(slender.tolist()),
            bool(np.all(slender <= MINIMAL)),
        ),
    )


def _ring() -> tuple[Claim, ...]:
    pressed = press(LARGE_PAD, PRESSURE, list(FORCES))
    b = np.asarray(pressed.contact_radius)
    right, printed = (meniscus(pressed, WATER, each) for each in ('corrected', 'thesis'))
    ring, height = np.asarray(right.ring_radius), np.asarray(right.height)
    wrong = (2.0 * ring + height) / (2.0 * ring - height)
    exact = np.array([
        bath_meniscus(float(sphere), float(contact), liquid=WATER).height
        for sphere, contact in zip(np.asarray(pressed.sphere_radius), b, strict=True)
    ])  # fmt: skip
    off = np.asarray(printed.height) / exact
    return (
        claim(
            'a ring of liquid',
            'The other half of the ring pulls back: the sum is 0. What is left is the hysteresis '
            'of the contact angle, of which Fig. 21 has the bound.',
            (0.0,),
            False,
        ),
        claim(
            'ring and arc curve',
            f'That makes the force {_few(wrong, ".1f")} times as large (water, '
            f'{_few(FORCES, "g")} N).',
            tuple(wrong.tolist()),
            bool(np.all(np.abs(wrong - 1.0) <= MINIMAL)),
        ),
        claim(
            'contact and ring have',
            f'b/r = {_few(b / ring, ".2f")} for water at {_few(FORCES, "g")} N.',
            tuple((b / ring).tolist()),
            bool(np.all(b / ring >= 1.0 - MINIMAL)),
        ),
        claim(
            'height to which liquid',
            f'{_few(off, ".1f")} times the exact meniscus of a wide bath (water, '
            f'{_few(FORCES, "g")} N).',
            tuple(off.tolist()),
            bool(np.all(np.abs(off - 1.0) <= MINIMAL)),
        ),
    )


def _domes() -> tuple[Claim, ...]:
    area = 1.5 * 2.0 * (1.5 + math.sqrt(1.25))  # of the dome with R = 1.5 r, over π r²
    r, k = LARGE_PAD.radius, LARGE_PAD.stiffness
    needed = TENSION['corrected'] * k / r
    end = largest_pressure(LARGE_PAD, 'flattening')
    widest = float(inflate(LARGE_PAD, end).sphere_radius) / r
    return (
        claim(
            'area of a dome',
            f'{area:.2f} π r₀², {100 * (math.sqrt(area) - 1):.0f} %.',
            (area, math.sqrt(area) - 1.0),
            abs(area / 7.8 - 1.0) <= 0.01 and abs((math.sqrt(area) - 1.0) / 1.8 - 1.0) <= 0.01,
        ),
        claim(
            'domes work at r',
            f'That takes {1e-3 * needed:.0f} kPa; a pressed dome of this pad has one answer up to '
            f'{1e-3 * end:.1f} kPa, where R = {widest:.2f} r₀.',
            (needed, end),
            needed <= end,
        ),
    )


def _soles() -> tuple[Claim, ...]:
    pads = CELLS['corrected'] / CELLS['thesis']
    pressure, force = (each['thesis'] / each['corrected'] for each in (TENSION, FLAT))
    small = resized(dataclasses.replace(LARGE_PAD, thickness=None), 0.5e-3)
    small = dataclasses.replace(small, thickness=LARGE_PAD.thickness)
    per_area = [
        {c: float(force_limit(pad, PRESSURE, c)) / (math.pi * pad.radius**2) for c in _LIMITS}
        for pad in (small, LARGE_PAD)
    ]
    return (
        claim(
            'number of pads on',
            f'{pads:.2f} times as many as fit: even flat ones overlap.',
            (pads,),
            abs(pads - 1.0) <= MINIMAL,
        ),
        claim(
            'pressure for r 1',
            f'{TENSION["corrected"]:.4f} k/r₀.',
            (pressure,),
            abs(pressure - 1.0) <= 0.01,
        ),
        claim(
            'force that presses all',
            f'{FLAT["corrected"]:.3f} k S/r₀, {force:.2f} times less.',
            (force,),
            abs(force - 1.0) <= MINIMAL,
        ),
        claim(
            'smaller pads carry more',
            'Load over area at 75 kPa, pads of 0.5 and 1.5 mm of one sheet: '
            + '; '.join(
                f'{1e-3 * per_area[0][c]:.1f} and {1e-3 * per_area[1][c]:.1f} kPa by `{c}`'
                for c in _LIMITS
            )
            + '.',
            tuple(each[c] for each in per_area for c in _LIMITS),
            all(per_area[0][c] > per_area[1][c] for c in _LIMITS),
        ),
    )


_LIMITS = ('thickness', 'flattening')


def _pad() -> tuple[Claim, ...]:
    stretch = math.sqrt(1.0 + (2.0e-3 / LARGE_PAD.radius) ** 2)
    tenfold = dataclasses.replace(LARGE_PAD, adhesion_energy=0.06)
    wider = float(
        press(tenfold, PRESSURE, 0.08).contact_radius
        / press(LARGE_PAD, PRESSURE, 0.08).contact_radius
    )
    tensions = 2.0 * math.sqrt(WATER.solid_tension * 0.04)
    return (
        claim(
            'strain stays where rubber',
            f'Measured at 75 kPa the cap is 2.0 mm high, its mean stretch {stretch:.2f}.',
            (stretch,),
            stretch <= 1.1,
        ),
        claim(
            'adhesion energy 2 of',
            f'About {tensions:.2g} J/m², with 0.027 and 0.04 N/m. The contact at 0.08 N is '
            f'{100 * (wider - 1):.1f} % wider by it.',
            (tensions,),
            abs(tensions / 0.006 - 1.0) <= 1.0,
        ),
    )


# --- chapters 4 and 5 ----------------------------------------------------------------------------


def _layers() -> tuple[Claim, ...]:
    return (
        claim(
            'the energy of a 2',
            'Its two losses, 4.7 and 4.10, are equal and have opposite signs in 4.12: Q = W stays '
            'above 0 at every layer, and the loop does not end.',
            (0.0,),
            False,
        ),
    )


def _feet() -> tuple[Claim, ...]:
    small = Foot.load('small217')
    carried = small.pads * float(force_limit(small.pad, small.ceiling, small.limit))
    robot = 2.09 * 9.81 / 3.0
    return (
        _balloons('large', 1.5e-3, 0.4e-3, '5.1.1'),
        _balloons('small', 0.5e-3, 0.2e-3, '5.1.2'),
        claim(
            'the small foot is',
            f'{small.pads} pads of 0.5 mm, flat at {carried:.1f} N at {1e-3 * small.ceiling:.0f} '
            'kPa, '
            f'the most that they bear; a tripod of the hexapod puts {robot:.1f} N on each foot.',
            (carried, robot),
            None,
        ),
        claim('at high pressure the', 'Soles are rigid here.', (), None),
    )


def _balloons(name: str, radius: float, thickness: float, section: str) -> Claim:
    sheet = Material.load('ecoflex_00_20')
    assert sheet.factor_range is not None
    low, given, high = (
        1e-3 * largest_pressure(Pad.of(sheet.times(factor), radius, thickness), 'flattening')
        for factor in (sheet.factor_range[0], 1.0, sheet.factor_range[1])
    )
    least = 1e-3 * min(WALKED)
    return claim(
        'pads of the large',
        f'Such a membrane balloons at {given:.1f} kPa ({low:.1f} to {high:.1f}, by the doubts '
        'about the material, which was not tested).',
        (low, given, high),
        high >= least,
        thesis=f'Pads of the {name} foot, Ecoflex 00-20, {1e3 * thickness:g} mm thick, walk at '
        'these pressures.',
        section=section,
        printed=f'{_few([1e-3 * p for p in WALKED], "g")} kPa',
        rule=f'Stands at {least:g} kPa, with the stiffest that the material may be.',
    )


def _walks() -> tuple[Claim, ...]:
    foot = Foot.load('large19')
    dry = {}
    for critical in (0.5, 1.0, 2.0):
        own = dataclasses.replace(foot, critical_film=critical * foot.critical_film)
        film = Film(own)
        shares = []
        for pressure in WALKED:
            film.touch_down(FILM)
            film.drain(LOAD, 0.0, pressure, 0.5)
            shares.append(math.exp(-((film.under_domes / own.critical_film) ** own.film_exponent)))
        dry[critical] = shares
    radius, water = foot.pad.radius, WATER.surface_tension
    bound = foot.pads * (
        capillary_pull(radius, FILM, WATER)
        + hysteresis_force(radius, water, math.pi, 0.0) / foot.friction
    ) / LOAD  # fmt: skip
    return (
        claim(
            'domes of low pressure',
            'By films alone, at 40, 60 and 75 kPa, '
            + '; '.join(
                f'{_few([100 * s for s in shares], ".0f")} % is dry (critical film '
                f'{1e6 * factor * foot.critical_film:g} µm)'
                for factor, shares in dry.items()
            )
            + '. In the walks domes of 40 kPa fail because the measured line has them pressed '
            'flat.',
            tuple(np.ravel(list(dry.values())).tolist()),
            None,
        ),
        claim(
            'uneven liquid still adds',
            f'Walks leave it out. On ground that stays {1e3 * FILM:g} mm deep, at rest, it is at '
            f'most {100.0 * bound:.1f} % of the friction of a loaded foot on domes (pull of the '
            'liquid and pinned lines); where the liquid round the sole has thinned there is no '
            'such bound.',
            (bound,),
            None,
        ),
    )


def _few(values: object, form: str) -> str:
    words = [f'{value:{form}}' for value in np.ravel(np.asarray(values)).tolist()]
    return ' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)

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
from studies.thesis.explained import MINIMAL, Claim
from studies.thesis.sole import CELLS, FLAT, TENSION

PRESSURE = 75e3  # Pa gauge
FORCES = (0.08, 0.19, 0.285)  # N, as the program of the thesis presses
WALKED = (40e3, 60e3, 75e3)  # Pa gauge, thesis 5.2
LOAD, FILM = 2.5, 3e-4  # N and m, of the foot and the floor of those walks
_FREE, _PRESSED, _RING, _SOLE, _MATERIALS = (
    f'errata.md#{part}'
    for part in (
        'free-dome',
        'pressed-dome',
        'liquid-ring',
        'design-of-the-sole',
        'materials-of-the-pads',
    )
)


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
        Claim(
            0,
            'The energy of a stretched sheet is its tension times its area (3.24, 3.37).',
            f'As ∫T dS the same k gives a dome {1e3 * right:.2f} mm high at 75 kPa in place of '
            f'{1e3 * height:.2f} mm.',
            (right, height),
            bool(abs(right / height - 1.0) <= MINIMAL),
            '3.1.1',
            rule=f'Heights within {100 * MINIMAL:g} %. As printed it is the law of another sheet, '
            'to which k belongs.',
            see='derivation.md#1-the-energy',
        ),
        Claim(
            0,
            'Adhesion costs energy (3.43, minus in 3.53).',
            f'At 1 mN the contact radius is {100 * (text / program - 1):+.1f} % from that with '
            'the plus of the appendix.'.replace('-', '−'),
            (text, program),
            text > program,
            '3.1.1',
            rule='Right if the minus gave the wider contact, as attraction does.',
            see=_PRESSED,
        ),
        Claim(
            0,
            'Contact radius and depth are far below the sphere radius (3.50 to 3.52).',
            f'b/R = {_few(slender, ".2f")} at {_few(FORCES, "g")} N.',
            tuple(slender.tolist()),
            bool(np.all(slender <= MINIMAL)),
            '3.1.1',
            rule=f'At most {MINIMAL:g}. The result, p π b² = F, is exact on another ground.',
            see=_PRESSED,
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
        Claim(
            0,
            'A ring of liquid resists as its pressure times its section (3.68, 3.69).',
            'The other half of the ring pulls back: the sum is 0. What is left is the hysteresis '
            'of the contact angle, of which Fig. 21 has the bound.',
            (0.0,),
            False,
            '3.1.2',
            rule='By symmetry.',
            see=_RING,
        ),
        Claim(
            0,
            'Ring and arc curve in the same sense (3.70, 3.72).',
            f'That makes the force {_few(wrong, ".1f")} times as large (water, '
            f'{_few(FORCES, "g")} N).',
            tuple(wrong.tolist()),
            bool(np.all(np.abs(wrong - 1.0) <= MINIMAL)),
            '3.1.2',
            rule=f'Within {100 * MINIMAL:g} % of the force with opposite signs.',
            see='derivation.md#8-the-ring-of-liquid',
        ),
        Claim(
            0,
            'Contact and ring have nearly the same radius (3.79).',
            f'b/r = {_few(b / ring, ".2f")} for water at {_few(FORCES, "g")} N.',
            tuple((b / ring).tolist()),
            bool(np.all(b / ring >= 1.0 - MINIMAL)),
            '3.1.2',
            printed='1, approximately',
            rule=f'Within {100 * MINIMAL:g} %. Heights are at most 22.5 % too large by it.',
            see=_RING,
        ),
        Claim(
            0,
            'Height to which liquid climbs a dome (3.80).',
            f'{_few(off, ".1f")} times the exact meniscus of a wide bath (water, '
            f'{_few(FORCES, "g")} N).',
            tuple(off.tolist()),
            bool(np.all(np.abs(off - 1.0) <= MINIMAL)),
            '3.1.2',
            rule=f'Within {100 * MINIMAL:g} %.',
            see=_RING,
        ),
    )


def _domes() -> tuple[Claim, ...]:
    area = 1.5 * 2.0 * (1.5 + math.sqrt(1.25))  # of the dome with R = 1.5 r, over π r²
    r, k = LARGE_PAD.radius, LARGE_PAD.stiffness
    needed = TENSION['corrected'] * k / r
    end = largest_pressure(LARGE_PAD, 'flattening')
    widest = float(inflate(LARGE_PAD, end).sphere_radius) / r
    section = '3.1.3'
    return (
        Claim(
            0,
            'Area of a dome with R = 1.5 r₀, and stretch of its sheet.',
            f'{area:.2f} π r₀², {100 * (math.sqrt(area) - 1):.0f} %.',
            (area, math.sqrt(area) - 1.0),
            abs(area / 7.8 - 1.0) <= 0.01 and abs((math.sqrt(area) - 1.0) / 1.8 - 1.0) <= 0.01,
            section,
            printed='7.8 π r₀², 180 %',
            rule="Within 1 %. 845 %, at which the silicone tears, is its maker's and not checked.",
        ),
        Claim(
            0,
            'Domes work at R = 1.5 r₀.',
            f'That takes {1e-3 * needed:.0f} kPa; a pressed dome of this pad has one answer up to '
            f'{1e-3 * end:.1f} kPa, where R = {widest:.2f} r₀.',
            (needed, end),
            needed <= end,
            section,
            printed='1.5 r₀',
            rule='Within the model of the pressed dome.',
            see=_SOLE,
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
    section = '3.1.3'
    return (
        Claim(
            0,
            'Number of pads on an area (3.87).',
            f'{pads:.2f} times as many as fit: even flat ones overlap.',
            (pads,),
            abs(pads - 1.0) <= MINIMAL,
            section,
            printed='S/(2.78 r₀²)',
            rule=f'Within {100 * MINIMAL:g} %.',
            see='derivation.md#10-the-sole',
        ),
        Claim(
            0,
            'Pressure for R = 1.5 r₀ (3.89).',
            f'{TENSION["corrected"]:.4f} k/r₀.',
            (pressure,),
            abs(pressure - 1.0) <= 0.01,
            section,
            printed='4.3 k/r₀',
            rule='Within 1 %.',
        ),
        Claim(
            0,
            'Force that presses all pads of a foot flat (3.92).',
            f'{FLAT["corrected"]:.3f} k S/r₀, {force:.2f} times less.',
            (force,),
            abs(force - 1.0) <= MINIMAL,
            section,
            printed='4.86 k S/r₀',
            rule=f'Within {100 * MINIMAL:g} %.',
            see='derivation.md#10-the-sole',
        ),
        Claim(
            0,
            'Smaller pads carry more, so r₀ = 0.5 mm.',
            'Load over area at 75 kPa, pads of 0.5 and 1.5 mm of one sheet: '
            + '; '.join(
                f'{1e-3 * per_area[0][c]:.1f} and {1e-3 * per_area[1][c]:.1f} kPa by `{c}`'
                for c in _LIMITS
            )
            + '.',
            tuple(each[c] for each in per_area for c in _LIMITS),
            all(per_area[0][c] > per_area[1][c] for c in _LIMITS),
            section,
            printed='0.5 mm',
            rule='More by every criterion. True only if the pressure rises as 1/r₀.',
            see='model/force_limit.md#scaling',
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
        Claim(
            0,
            'Strain stays where rubber is linear, so k is constant.',
            f'Measured at 75 kPa the cap is 2.0 mm high, its mean stretch {stretch:.2f}.',
            (stretch,),
            stretch <= 1.1,
            '3.2.1',
            rule='Stretched up to 1.1 times.',
            see='model/hyperelastic.md#against-the-thesis',
        ),
        Claim(
            0,
            'Adhesion energy 2√(γ₁γ₂) of silicone and acrylic.',
            f'About {tensions:.2g} J/m², with 0.027 and 0.04 N/m. The contact at 0.08 N is '
            f'{100 * (wider - 1):.1f} % wider by it.',
            (tensions,),
            abs(tensions / 0.006 - 1.0) <= 1.0,
            '3.2.1',
            printed='0.006 J/m²',
            rule='Within a factor of two.',
            see=_PRESSED,
        ),
    )


# --- chapters 4 and 5 ----------------------------------------------------------------------------


def _layers() -> tuple[Claim, ...]:
    return (
        Claim(
            0,
            'The energy of a layer changes its sign at the wet layer (4.12).',
            'Its two losses, 4.7 and 4.10, are equal and have opposite signs in 4.12: Q = W stays '
            'above 0 at every layer, and the loop does not end.',
            (0.0,),
            False,
            '4.1.2, 4.2.1',
            rule='By algebra. Read with both as losses it is the balance of Fig. 26.',
            see='capillary.md#what-the-thesis-prints-otherwise',
        ),
    )


def _feet() -> tuple[Claim, ...]:
    small = Foot.load('small217')
    carried = small.pads * float(force_limit(small.pad, small.ceiling, small.limit))
    robot = 2.09 * 9.81 / 3.0
    return (
        _balloons('large', 1.5e-3, 0.4e-3, '5.1.1'),
        _balloons('small', 0.5e-3, 0.2e-3, '5.1.2'),
        Claim(
            0,
            'The small foot is the one optimized against slip.',
            f'{small.pads} pads of 0.5 mm, flat at {carried:.1f} N at {1e-3 * small.ceiling:.0f} '
            'kPa, '
            f'the most that they bear; a tripod of the hexapod puts {robot:.1f} N on each foot.',
            (carried, robot),
            None,
            '5.1',
            printed='no force',
            rule='The radius of 0.5 mm does not follow from Fig. 10 or 3.92.',
            missing='pressure, number of pads and tangential forces of the small foot',
            see=_MATERIALS,
        ),
        Claim(
            0,
            'At high pressure the whole sole of the small foot bulges into a dome.',
            'Soles are rigid here.',
            (),
            None,
            '5.1',
        ),
    )


def _balloons(name: str, radius: float, thickness: float, section: str) -> Claim:
    sheet = Material.load('ecoflex_00_20')
    assert sheet.factor_range is not None
    low, given, high = (
        1e-3 * largest_pressure(Pad.of(sheet.times(factor), radius, thickness), 'flattening')
        for factor in (sheet.factor_range[0], 1.0, sheet.factor_range[1])
    )
    least = 1e-3 * min(WALKED)
    return Claim(
        0,
        f'Pads of the {name} foot, Ecoflex 00-20, {1e3 * thickness:g} mm thick, walk at these '
        'pressures.',
        f'Such a membrane balloons at {given:.1f} kPa ({low:.1f} to {high:.1f}, by the doubts '
        'about the material, which was not tested).',
        (low, given, high),
        high >= least,
        section,
        printed=f'{_few([1e-3 * p for p in WALKED], "g")} kPa',
        rule=f'Stands at {least:g} kPa, with the stiffest that the material may be.',
        see=_MATERIALS,
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
        Claim(
            0,
            'Domes of low pressure trap liquid, those of enough pressure press it out.',
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
            '5.2',
            printed='order only',
            rule='2.5 N on 19 rigid discs for 0.5 s.',
            missing='roughness of pad and floor, load and time of a stance',
            see='model/foot.md#film',
        ),
        Claim(
            0,
            'Uneven liquid still adds capillary force, which helps the leg to walk.',
            f'Walks leave it out. On ground that stays {1e3 * FILM:g} mm deep, at rest, it is at '
            f'most {100.0 * bound:.1f} % of the friction of a loaded foot on domes (pull of the '
            'liquid and pinned lines); where the liquid round the sole has thinned there is no '
            'such bound.',
            (bound,),
            None,
            '5.2',
            see='model/meniscus.md#ring-of-liquid-round-a-pad',
        ),
    )


def _few(values: object, form: str) -> str:
    words = [f'{value:{form}}' for value in np.ravel(np.asarray(values)).tolist()]
    return ' and '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)

# SPDX-License-Identifier: Apache-2.0
"""Quantitative statements in the text of the thesis, chapters 3 to 5, that have no figure."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.optimize import brentq

from ros_pad.capillary import Wall, bath_meniscus
from ros_pad.contact.dome import inflate, press
from ros_pad.contact.film import Film
from ros_pad.contact.limits import force_limit, largest_pressure, resized
from ros_pad.contact.material import Material
from ros_pad.contact.meniscus import WATER, capillary_pull, hysteresis_force, meniscus
from ros_pad.contact.pad import LARGE_PAD, Pad
from ros_pad.contact.resistance import Foot
from ros_pad.making import build, plan
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
        claim('the energy of a', (right, height), abs(right / height - 1.0) <= MINIMAL,
              right=1e3 * right, height=1e3 * height),
        claim('adhesion costs energy 3', (text, program), text > program, off=text / program - 1),
        claim('contact radius and depth', slender, np.all(slender <= MINIMAL), slender=slender,
              forces=FORCES),
    )  # fmt: skip


def _ring() -> tuple[Claim, ...]:
    pressed = press(LARGE_PAD, PRESSURE, list(FORCES))
    b = np.asarray(pressed.contact_radius)
    right, printed = (meniscus(pressed, WATER, each) for each in ('corrected', 'thesis'))
    ring, height = np.asarray(right.ring_radius), np.asarray(right.height)
    wrong = (2.0 * ring + height) / (2.0 * ring - height)
    domes = zip(np.asarray(pressed.sphere_radius).tolist(), b.tolist(), strict=True)
    exact = np.array([bath_meniscus(Wall.dome(*dome), WATER).height for dome in domes])
    off, share = np.asarray(printed.height) / exact, b / np.asarray(printed.ring_radius)
    return (
        claim('a ring of liquid', 0.0, False),
        claim('ring and arc curve', wrong, np.all(np.abs(wrong - 1.0) <= MINIMAL), wrong=wrong,
              forces=FORCES),
        claim('contact and ring have', share, np.all(share >= 1.0 - MINIMAL), printed=share,
              share=b / ring, forces=FORCES),
        claim('height to which liquid', off, np.all(np.abs(off - 1.0) <= MINIMAL), off=off,
              forces=FORCES),
    )  # fmt: skip


def _domes() -> tuple[Claim, ...]:
    area = 1.5 * 2.0 * (1.5 + math.sqrt(1.25))  # of the dome with R = 1.5 r, over π r²
    stretch = math.sqrt(area) - 1.0
    r, k = LARGE_PAD.radius, LARGE_PAD.stiffness
    needed = TENSION['corrected'] * k / r
    walked = float(inflate(LARGE_PAD, WALKED[-1]).sphere_radius) / r
    return (
        claim('area of a dome', (area, stretch),
              abs(area / 7.8 - 1.0) <= 0.01 and abs(stretch / 1.8 - 1.0) <= 0.01,
              area=area, stretch=stretch),
        claim('domes work at r', needed, None, needed=1e-3 * needed, walked=walked),
    )  # fmt: skip


def _soles() -> tuple[Claim, ...]:
    pads = CELLS['corrected'] / CELLS['thesis']
    pressure, force = (each['thesis'] / each['corrected'] for each in (TENSION, FLAT))
    small = resized(dataclasses.replace(LARGE_PAD, thickness=None), 0.5e-3)
    both = dataclasses.replace(small, thickness=LARGE_PAD.thickness), LARGE_PAD
    per_area = {
        c: [float(force_limit(pad, PRESSURE, c)) / (math.pi * pad.radius**2) for pad in both]
        for c in ('thickness', 'flattening')
    }
    return (
        claim('number of pads on', pads, abs(pads - 1.0) <= MINIMAL, pads=pads),
        claim('pressure for r 1', pressure, abs(pressure - 1.0) <= 0.01,
              tension=TENSION['corrected']),
        claim('force that presses all', force, abs(force - 1.0) <= MINIMAL,
              flat=FLAT['corrected'], force=force),
        claim('smaller pads carry more', np.transpose([*per_area.values()]), True,
              **{c: 1e-3 * np.array(loads) for c, loads in per_area.items()}),
    )  # fmt: skip


def _pad() -> tuple[Claim, ...]:
    stretch = math.sqrt(1.0 + (2.0e-3 / LARGE_PAD.radius) ** 2)
    sticky, usual = (
        float(press(pad, PRESSURE, 0.08).contact_radius)
        for pad in (dataclasses.replace(LARGE_PAD, adhesion_energy=0.06), LARGE_PAD)
    )
    tensions = 2.0 * math.sqrt(WATER.solid_tension * 0.04)
    return (
        claim('strain stays where rubber', stretch, None, stretch=stretch),
        claim('adhesion energy 2 of', tensions, None, tensions=tensions,
              wider=sticky / usual - 1.0),
    )  # fmt: skip


# --- chapters 4 and 5 ----------------------------------------------------------------------------


def _layers() -> tuple[Claim, ...]:
    return (claim('the energy of a 2', 0.0, False),)


def _feet() -> tuple[Claim, ...]:
    small = Foot.load('small217')
    carried = small.pads * float(force_limit(small.pad, small.ceiling, small.limit))
    robot = 2.09 * 9.81 / 3.0
    body, bone = plan(small), plan(Foot.load('large37'))
    bulge = body.bulge(body.z['top'] - body.z['sheet'])
    bulges = [bulge * p / small.ceiling for p in WALKED]
    return (
        _balloons('pads of the large', 1.5e-3, 0.4e-3),
        _balloons('pads of the small', 0.5e-3, 0.2e-3),
        claim('the small foot is', (carried, robot), None, pads=small.pads, carried=carried,
              ceiling=1e-3 * small.ceiling, robot=robot),
        claim('at high pressure the', bulges, max(bulges) > 1e3 * small.pad.radius,
              bulges=bulges, walked=[1e-3 * p for p in WALKED],
              body=body.z['top'] - body.z['sheet']),
        claim('a printed bone with', (2.0 * bone.r['pad'], bone.z['sheet']),
              {'bone', 'cap', 'inner mould', 'ring', 'lid'} <= {*build(bone)},
              chamber=2.0 * bone.r['pad'], sheet=bone.z['sheet']),
        claim('a body with cylindrical', (2.0 * body.r['pad'], body.z['sheet']),
              (round(2.0 * body.r['pad'], 6), round(body.z['sheet'], 6)) == (1.0, 0.2),
              chamber=2.0 * body.r['pad'], sheet=body.z['sheet'], silicones=small.silicones),
        claim('drawings of the moulds', (), None),
    )  # fmt: skip


def _balloons(key: str, radius: float, thickness: float) -> Claim:
    sheet = Material.load('ecoflex_00_20')
    assert sheet.factor_range is not None
    low, given, high = (
        1e-3 * largest_pressure(Pad.of(sheet.times(factor), radius, thickness))
        for factor in (sheet.factor_range[0], 1.0, sheet.factor_range[1])
    )
    walked = [1e-3 * p for p in WALKED]
    return claim(key, (low, given, high), None, low=low, given=given, high=high, walked=walked)


def _walks() -> tuple[Claim, ...]:
    foot = Foot.load('large19')
    dry = {}
    for name, critical in (('half', 0.5), ('one', 1.0), ('two', 2.0)):
        own = dataclasses.replace(foot, critical_film=critical * foot.critical_film)
        film, shares = Film(own), []
        for pressure in WALKED:
            film.touch_down(FILM)
            under, _ = film.stand(LOAD, 0.0, pressure, 0.5)
            shares.append(math.exp(-((under / own.critical_film) ** own.film_exponent)))
        dry[name] = np.array(shares)
    radius, water = foot.pad.radius, WATER.surface_tension
    pinned = hysteresis_force(radius, water, math.pi, 0.0) / foot.friction
    bound = foot.pads * (capillary_pull(radius, FILM, WATER) + pinned) / LOAD
    return (
        claim('domes of low pressure', [*dry.values()], None,
              **{name: 100 * shares for name, shares in dry.items()},
              films=[factor * 1e6 * foot.critical_film for factor in (0.5, 1.0, 2.0)]),
        claim('uneven liquid still adds', bound, None, film=1e3 * FILM, bound=bound),
    )  # fmt: skip

# SPDX-License-Identifier: Apache-2.0
"""The step of a planar body on frictional feet, written on flat sequences of numbers.

What stands here is plain Python that also compiles: with lists it runs as it is, with arrays it is
the source of :mod:`ros_pad.simulation.compiled`. Both give the same numbers to the last bit, so
that a seed gives the same walk with and without a compiler. It therefore keeps to what both round
alike: sums, products and ``sqrt``, no ``hypot``; and it must stay in one file, for a compiled copy
on disk is made anew only when the file of its outermost function has changed.

Gait, film and resistance are those of :class:`ros_pad.simulation.gait.TripodGait`,
:class:`ros_pad.contact.film.Film` and :class:`ros_pad.contact.Foot`, which tests hold them to.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos
from math import exp
from math import inf
from math import pi
from math import sin
from math import sqrt
from typing import Any
from typing import NamedTuple

# A contact in a step: lever arm x, y, m; velocity x, y, m/s, and turning rate, rad/s, at which its
# pad would slide if the body stood still; turning radius, m; cap, N; gain up to the cap, N s/m.
Pushed = tuple[float, float, float, float, float, float, float, float]

# Rows of the table of feet; a column is a foot. World axes where not said otherwise.
FEET = 28
(
    PHASE,  # since touch-down, as a share of the cycle
    OFFSET_X, OFFSET_Y,  # from home, in the body, m
    LIFTED_X, LIFTED_Y,  # where it left the ground, likewise
    GROUND,  # height of what it stands on, m
    HEIGHT,  # above the ground, m
    FRESH, DOME_FILM, SOLE_FILM,  # 1/h² of the liquid met, under domes, under the sole, 1/m²
    DOME_AREA,  # touched by domes, m²
    LOAD, CAP,  # N
    SHEAR_X, SHEAR_Y, TWIST,  # of the pads, m and rad
    FORCE_X, FORCE_Y, MOMENT,  # of the ground on the foot, N and N m
    SLIP_SPEED,  # m/s
    SLIP_PATH,  # m
    OVERLOAD,  # time, s
    WET,  # 1 or 0
    MARKER_X, MARKER_Y,  # m
    STEP_X, STEP_Y, STEP_TURN,  # what the gait moved the foot in the body in this step, m and rad
) = range(FEET)  # fmt: skip

# Entries of the body.
BODY = 17
(
    STEPS, X, Y, HEADING, SPEED_X, SPEED_Y, TURN,
    PULL_X, PULL_Y,  # of the towed load on the body, N
    SLED_X, SLED_Y,  # shear of its line, m
    LOST,  # in slip, J
    TIPPED, TIPPED_AT,  # foot that would have to pull, from 1, or 0; s
    PUSH_X, PUSH_Y,  # force of all feet, N
    SLED_CAP,  # N
) = range(BODY)  # fmt: skip


class Setting(NamedTuple):
    """What does not change in a walk; SI units. Flat, for a compiler to take it."""

    period: float
    settle: float
    cycle: float
    stride: float
    duty: float
    lift: float
    reach: float
    heading_gain: float
    middle: tuple[float, ...]  # of a leg's push, share of the cycle
    home_x: tuple[float, ...]
    home_y: tuple[float, ...]
    soles_turn: bool
    hip_x: tuple[float, ...]
    hip_y: tuple[float, ...]
    mass: float
    inertia: float
    height: float
    weight: float  # on the floor: its part across the slope, N
    downhill: float  # acceleration along -x, m/s²
    leg_stiffness: float
    towed: float  # mass, kg
    tow_dry: float  # drag, N
    tow_wet: float
    tow_distance: float
    tow_height: float
    tow_stiffness: float
    friction: float
    shear_strength: float
    conforming_pressure: float
    boundary_friction: float
    capillary: float  # of the liquid round all domes, N
    critical_film: float
    film_exponent: float
    shear_stiffness: float
    turning_radius: float
    sole_area: float
    dome_drain: float
    sole_drain: float
    limit_cell: float
    limits: Any  # sequence of force limits, N, every limit_cell from 0 Pa
    puddle: float  # 1/h² of standing liquid, 1/m²
    wet: Any  # rows along y of booleans along x
    wet_cell: float
    wet_x: float
    wet_y: float
    heights: Any  # rows along y of heights along x, m
    height_cell: float
    height_x: float
    height_y: float


def walk(
    setting: Setting, body: Any, feet: Any, pressures: Sequence[float], count: int, upright: bool
) -> bool:
    """Make up to ``count`` steps with the same gauge pressures, Pa; False if one did not settle.

    ``upright`` ends the walk after the step in which the robot tips over.
    """
    for _ in range(count):
        if not step(setting, body, feet, pressures):
            return False
        if upright and body[TIPPED] > 0.0:
            break
    return True


def step(setting: Setting, body: Any, feet: Any, pressures: Sequence[float]) -> bool:
    """Advance by a period; False where the friction step did not settle."""
    dt = setting.period
    before = body[STEPS] * dt - setting.settle
    body[STEPS] += 1.0
    # The gait has its own clock, which starts when the robot has settled.
    time = body[STEPS] * dt - setting.settle
    before = before if before > 0.0 else 0.0
    time = time if time > 0.0 else 0.0
    move_feet(setting, body, feet, before, time)
    share_loads(setting, body, feet)
    # Lever arms and motions are turned into world axes with the heading half-way.
    middle = body[HEADING] + 0.5 * body[TURN] * dt
    cosine, sine = cos(middle), sin(middle)
    contacts = grip(setting, body, feet, pressures, cosine, sine)
    towed = setting.towed
    cap = 0.0
    if towed > 0.0:
        behind_x = body[X] - setting.tow_distance * cosine
        behind_y = body[Y] - setting.tow_distance * sine
        cap = setting.tow_wet if is_wet(setting, behind_x, behind_y) else setting.tow_dry
    body[SLED_CAP] = cap
    stiffness = setting.tow_stiffness
    if cap > 0.0:
        contacts.append((
            0.0, 0.0, body[SLED_X] / dt, body[SLED_Y] / dt, 0.0, 0.0, cap, stiffness * dt
        ))  # fmt: skip
    mass = setting.mass + towed
    last_x, last_y = body[SPEED_X], body[SPEED_Y]
    free_x = last_x - setting.downhill * dt
    vx, vy, turn, settled = newton(
        (free_x, last_y, body[TURN]), mass, setting.inertia, contacts, dt,
        (last_x, last_y, body[TURN]), 0.0,
    )  # fmt: skip
    if not settled:
        return False
    drag_x = drag_y = 0.0
    if cap > 0.0:
        drag_x, drag_y, _, _, _ = push(vx, vy, turn, contacts[-1], dt)
    body[SLED_X], body[SLED_Y] = -drag_x / stiffness, -drag_y / stiffness
    # What the line does to the body: the load's friction, its inertia and its weight downhill.
    body[PULL_X] = drag_x - towed * ((vx - last_x) / dt + setting.downhill)
    body[PULL_Y] = drag_y - towed * (vy - last_y) / dt
    body[SPEED_X], body[SPEED_Y], body[TURN] = vx, vy, turn
    body[X] += vx * dt
    body[Y] += vy * dt
    body[HEADING] += turn * dt
    report(setting, body, feet, pressures, contacts)
    return True


# --- gait -------------------------------------------------------------------------------------


def move_feet(setting: Setting, body: Any, feet: Any, before: float, time: float) -> None:
    """Move the feet in the body as the gait wants."""
    cycle, duty, reach = setting.cycle, setting.duty, setting.reach
    advance = body_advance(setting, time) - body_advance(setting, before)
    turn = -setting.heading_gain * body[HEADING] * setting.period
    phases, offset_x, offset_y = feet[PHASE], feet[OFFSET_X], feet[OFFSET_Y]
    lifted_x, lifted_y = feet[LIFTED_X], feet[LIFTED_Y]
    heights, step_x, step_y = feet[HEIGHT], feet[STEP_X], feet[STEP_Y]
    share = time / cycle
    for index in range(6):
        phase = (share - setting.middle[index] + duty / 2.0) % 1.0
        x, y = offset_x[index], offset_y[index]
        stood = phases[index] < duty
        phases[index] = phase
        if phase < duty:
            if not stood:
                touch_down(setting, body, feet, index)
            # Walking ahead and turning: the foot goes back and round the other way.
            heights[index] = 0.0
            step_x[index] = turn * (setting.home_y[index] + y) - advance
            step_y[index] = -turn * (setting.home_x[index] + x)
            offset_x[index] = x + step_x[index]
            offset_y[index] = y + step_y[index]
            if setting.soles_turn:
                # With the leg about its hip: the angle that the step is seen under from there.
                arm_x = setting.home_x[index] - setting.hip_x[index] + x + 0.5 * step_x[index]
                arm_y = setting.home_y[index] - setting.hip_y[index] + y + 0.5 * step_y[index]
                across = arm_x * step_y[index] - arm_y * step_x[index]
                feet[STEP_TURN][index] = across / (arm_x * arm_x + arm_y * arm_y)
        else:
            if stood:
                lifted_x[index], lifted_y[index] = x, y
            swing = (phase - duty) / (1.0 - duty)
            progress = 0.5 - 0.5 * cos(pi * swing)
            rise = sin(pi * swing)
            heights[index] = setting.lift * rise * rise
            offset_x[index] = lifted_x[index] + progress * (reach - lifted_x[index])
            offset_y[index] = lifted_y[index] * (1.0 - progress)


def body_advance(setting: Setting, time: float) -> float:
    """Intended advance of the body since time zero, m."""
    angle = 4.0 * pi * time / setting.cycle
    return setting.stride / setting.cycle * (time - setting.cycle / (4.0 * pi) * sin(angle))


def load_share(duty: float, phase: float) -> float:
    """How much of a full share of the body's weight a foot takes, 0 in swing to 1."""
    overlap = duty - 0.5
    if phase >= duty:
        return 0.0
    edge = phase if phase < duty - phase else duty - phase
    if edge >= overlap:
        return 1.0
    ramp = edge / overlap
    return ramp * ramp * (3.0 - 2.0 * ramp)


def touch_down(setting: Setting, body: Any, feet: Any, index: int) -> None:
    """Start a stance where the foot is: on its liquid, and on its height."""
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    home_x = setting.home_x[index] + feet[OFFSET_X][index]
    home_y = setting.home_y[index] + feet[OFFSET_Y][index]
    x = body[X] + cosine * home_x - sine * home_y
    y = body[Y] + sine * home_x + cosine * home_y
    fresh = setting.puddle if is_wet(setting, x, y) else inf
    feet[FRESH][index] = feet[DOME_FILM][index] = feet[SOLE_FILM][index] = fresh
    feet[DOME_AREA][index] = 0.0
    heights, cell = setting.heights, setting.height_cell
    row = heights[int((y - setting.height_y) // cell) % len(heights)]
    feet[GROUND][index] = row[int((x - setting.height_x) // cell) % len(row)]


def is_wet(setting: Setting, x: float, y: float) -> bool:
    """Whether there is liquid at a world position, m."""
    row = setting.wet[int((y - setting.wet_y) // setting.wet_cell) % len(setting.wet)]
    return row[int((x - setting.wet_x) // setting.wet_cell) % len(row)]


# --- loads ------------------------------------------------------------------------------------


def share_loads(setting: Setting, body: Any, feet: Any) -> None:
    """Share the weight: weighted least squares in balance, where no foot can pull.

    N_i = w_i max(0, λ0 + λ1 x_i + λ2 y_i + k z_i) with w_i the gait's share and z_i the height of
    what foot i stands on, such that ΣN = W, ΣN x = W x_p, ΣN y = W y_p; the pressure point
    (x_p, y_p) lags behind the centre of mass when the body speeds up. The horizontal forces are
    those of the step before. Feet that would pull are let go, and called back when they would
    press. Where no loads balance the weight, a foot would have to pull: the robot tips over.
    """
    duty = setting.duty
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    lift = setting.tow_height - setting.height
    lean_x = lift * body[PULL_X] - setting.height * body[PUSH_X]
    lean_y = lift * body[PULL_Y] - setting.height * body[PUSH_Y]
    wanted = setting.weight, cosine * lean_x + sine * lean_y, cosine * lean_y - sine * lean_x
    phases, offset_x, offset_y, ground = feet[PHASE], feet[OFFSET_X], feet[OFFSET_Y], feet[GROUND]
    loads = feet[LOAD]
    legs = []
    for index in range(6):
        loads[index] = 0.0
        share = load_share(duty, phases[index])
        if share > 0.0:
            x = setting.home_x[index] + offset_x[index]
            y = setting.home_y[index] + offset_y[index]
            legs.append((index, share, x, y, setting.leg_stiffness * ground[index]))
    presses = 63  # a bit for each foot
    pulling = 0
    # One foot after another is let go or called back, the worst first; it nearly always gets
    # there. Else every set of feet is tried.
    for attempt in range(12 + 64):
        if attempt >= 12:
            presses = attempt - 12
        wrong = balance(legs, presses, wanted, loads)
        if wrong == 0:
            return
        if pulling == 0:
            pulling = wrong
        if attempt < 12:
            presses ^= 1 << (wrong - 1)
    if body[TIPPED] == 0.0:
        body[TIPPED] = pulling
        body[TIPPED_AT] = body[STEPS] * setting.period


def balance(
    legs: Sequence[tuple[int, float, float, float, float]],
    presses: int,
    wanted: tuple[float, float, float],
    loads: Any,
) -> int:
    """Set the loads in balance of the feet that press; return the foot that most belies that.

    From 1, or 0 where each foot that presses does and no other would; 7 without a balance.
    """
    total, mx, my = wanted
    s = sx = sy = sxx = sxy = syy = 0.0
    for index, share, x, y, preload in legs:
        if presses >> index & 1:
            wx, wy = share * x, share * y
            s += share
            sx += wx
            sy += wy
            sxx += wx * x
            sxy += wx * y
            syy += wy * y
            total -= share * preload
            mx -= wx * preload
            my -= wy * preload
    if s <= 0.0:
        return 7
    # Gauss elimination of the symmetric 3 x 3 system.
    axx, axy, bx = sxx - sx * sx / s, sxy - sx * sy / s, mx - sx * total / s
    ayy, by = syy - sy * sy / s, my - sy * total / s
    determinant = axx * ayy - axy * axy
    if determinant <= 1e-12 * sxx * syy:
        return 7  # two feet, or feet in a line
    slope_x = (bx * ayy - by * axy) / determinant
    slope_y = (by * axx - bx * axy) / determinant
    level = (total - sx * slope_x - sy * slope_y) / s
    pulls = misses = 0
    pull = miss = 0.0
    for index, share, x, y, preload in legs:
        load = share * (level + slope_x * x + slope_y * y + preload)
        if presses >> index & 1:
            loads[index] = load if load > 0.0 else 0.0
            if load < pull:
                pulls, pull = index + 1, load
        else:
            loads[index] = 0.0
            if load > miss:
                misses, miss = index + 1, load
    return pulls if pulls else misses


# --- friction ---------------------------------------------------------------------------------


def grip(
    setting: Setting,
    body: Any,
    feet: Any,
    pressures: Sequence[float],
    cosine: float,
    sine: float,
) -> list[Pushed]:
    """Find what each loaded foot can hold now; return the contacts of the step, in their order."""
    dt = setting.period
    stiffness, radius = setting.shear_stiffness, setting.turning_radius
    contacts = []
    for index in range(6):
        load = feet[LOAD][index]
        if load <= 0.0:
            feet[CAP][index] = 0.0
            continue
        home_x = setting.home_x[index] + feet[OFFSET_X][index]
        home_y = setting.home_y[index] + feet[OFFSET_Y][index]
        x, y = cosine * home_x - sine * home_y, sine * home_x + cosine * home_y
        pressure = pressures[index]
        on_domes = dome_load(setting, load, pressure)
        dome_film = sole_film = 0.0
        feet[WET][index] = 0.0
        if is_wet(setting, body[X] + x, body[Y] + y):
            feet[WET][index] = 1.0
            drain(setting, feet, index, on_domes, load - on_domes, pressure)
            dome_film, sole_film = feet[DOME_FILM][index] ** -0.5, feet[SOLE_FILM][index] ** -0.5
        cap = resistance(setting, on_domes, load - on_domes, pressure, dome_film, sole_film)
        feet[CAP][index] = cap
        if pressure > 0.0 and on_domes < load:
            feet[OVERLOAD][index] += dt
        if cap > 0.0:
            step_x, step_y = feet[STEP_X][index], feet[STEP_Y][index]
            contacts.append((
                x, y,
                (cosine * step_x - sine * step_y + feet[SHEAR_X][index]) / dt,
                (sine * step_x + cosine * step_y + feet[SHEAR_Y][index]) / dt,
                (feet[STEP_TURN][index] + feet[TWIST][index]) / dt,
                radius, cap, stiffness * dt,
            ))  # fmt: skip
    return contacts


def dome_load(setting: Setting, load: float, pressure: float) -> float:
    """Part of the load, N, that the domes carry at a gauge pressure, Pa: up to their limit."""
    if pressure <= 0.0:
        return 0.0
    place = pressure / setting.limit_cell
    table = setting.limits
    last = len(table) - 1
    if place >= last:
        limit = table[last]
    else:
        index = int(place)
        limit = table[index] + (place - index) * (table[index + 1] - table[index])
    return load if load < limit else limit


def drain(
    setting: Setting, feet: Any, index: int, on_domes: float, on_sole: float, pressure: float
) -> None:
    """Squeeze the film under a foot for a period."""
    dt = setting.period
    if on_domes > 0.0:
        area = on_domes / pressure
        fresh = feet[FRESH][index]
        if area > feet[DOME_AREA][index] and fresh < inf:
            # What domes touch anew has not drained yet.
            old = feet[DOME_AREA][index] / area
            feet[DOME_FILM][index] = fresh + old * (feet[DOME_FILM][index] - fresh)
        feet[DOME_AREA][index] = area
        feet[DOME_FILM][index] += setting.dome_drain * pressure / area * dt
    else:
        feet[DOME_AREA][index] = 0.0
    if on_sole > 0.0:
        feet[SOLE_FILM][index] += setting.sole_drain * on_sole / setting.sole_area * dt


def resistance(
    setting: Setting,
    on_domes: float,
    on_sole: float,
    pressure: float,
    dome_film: float,
    sole_film: float,
) -> float:
    """Tangential force, N, that a foot can hold."""
    total = under_domes = 0.0
    conforming = setting.conforming_pressure
    if on_domes > 0.0:
        under_domes = on_domes / (pressure if pressure > conforming else conforming)
        dry = setting.friction * on_domes + setting.shear_strength * under_domes
        total += on_film(setting, dry, on_domes, dome_film)
        if dome_film > 0.0:
            total += setting.capillary
    if on_sole > 0.0:
        free, touched = setting.sole_area - under_domes, on_sole / conforming
        dry = setting.friction * on_sole + setting.shear_strength * (
            touched if touched < free else free
        )
        total += on_film(setting, dry, on_sole, sole_film)
    return total


def on_film(setting: Setting, dry: float, load: float, film: float) -> float:
    """Resistance, N, of what holds ``dry`` without a film."""
    if film <= 0.0:
        return dry
    touching = exp(-((film / setting.critical_film) ** setting.film_exponent))
    return touching * dry + (1.0 - touching) * setting.boundary_friction * load


def newton(
    free: tuple[float, float, float],
    mass: float,
    inertia: float,
    contacts: Sequence[Pushed],
    dt: float,
    start: tuple[float, float, float],
    creep: float,
) -> tuple[float, float, float, bool]:
    """Newton on the convex step, shortened where it overshoots: twist, and whether it settled.

    Contacts shear elastically up to their caps, or, where ``creep`` is above zero, creep at about
    that speed, m/s (pseudo-Huber).
    """
    bx, by, bw = free
    vx, vy, w = start
    # What the largest gains make of the rounding of a speed is no reason to go on.
    scale = mass
    for contact in contacts:
        scale += 0.01 * dt * contact[7]
    scale *= 1e-13 + 1e-12 * (abs(bx) + abs(by))
    step_x = step_y = step_w = slope = 0.0
    length = 1.0
    for _ in range(200):
        gx, gy, gw = mass * (vx - bx), mass * (vy - by), inertia * (w - bw)
        hxx = hyy = mass
        hww = inertia
        hxy = hxw = hyw = 0.0
        for rx, ry, ox, oy, ot, radius, cap, rate in contacts:
            zx = vx - w * ry + ox
            zy = vy + w * rx + oy
            zt = radius * (w + ot)
            square = zx * zx + zy * zy + zt * zt
            # Force over slip, and by how much its slope along the slip differs from it, over
            # the square of the slip.
            bend = 0.0
            if creep > 0.0:
                square += creep * creep
                gain = dt * cap / sqrt(square)
                bend = gain / square
            elif rate * rate * square <= cap * cap:
                gain = dt * rate
            else:
                gain = dt * cap / sqrt(square)
                bend = gain / square
            fx, fy = gain * zx, gain * zy
            gx += fx
            gy += fy
            gw += rx * fy - ry * fx
            if radius > 0.0:
                gw += radius * gain * zt
                kxt, kyt, ktt = -bend * zx * zt, -bend * zy * zt, gain - bend * zt * zt
            else:
                kxt = kyt = ktt = 0.0
            kxx, kxy, kyy = gain - bend * zx * zx, -bend * zx * zy, gain - bend * zy * zy
            kxw = rx * kxy - ry * kxx + radius * kxt
            kyw = rx * kyy - ry * kxy + radius * kyt
            hxx += kxx
            hxy += kxy
            hyy += kyy
            hxw += kxw
            hyw += kyw
            hww += rx * kyw - ry * kxw + radius * (rx * kyt - ry * kxt + radius * ktt)
        # The function is convex: its slope along the step has grown since. Where it has turned
        # to rise nearly as steeply as it fell, the step was too long: take half of it back.
        rise = -(gx * step_x + gy * step_y + gw * step_w)
        if rise > 0.9 * slope and length > 1e-9:
            length *= 0.5
            vx += length * step_x
            vy += length * step_y
            w += length * step_w
            continue
        if abs(gx) + abs(gy) + 10.0 * abs(gw) < scale:
            return vx, vy, w, True
        # Cholesky of the 3 x 3 Hessian, which the masses keep positive definite.
        lyx, lwx = hxy / hxx, hxw / hxx
        dy = hyy - lyx * hxy
        lower = hyw - lyx * hxw
        lwy = lower / dy
        yy = gy - lyx * gx
        step_w = (gw - lwx * gx - lwy * yy) / (hww - lwx * hxw - lwy * lower)
        step_y = yy / dy - lwy * step_w
        step_x = gx / hxx - lyx * step_y - lwx * step_w
        slope = gx * step_x + gy * step_y + gw * step_w
        length = 1.0
        vx -= step_x
        vy -= step_y
        w -= step_w
    return vx, vy, w, False


def push(
    vx: float, vy: float, turn: float, contact: Pushed, dt: float
) -> tuple[float, float, float, float, float]:
    """Force x, y and moment of an elastic contact on the body, way it slid, work it lost."""
    rx, ry, ox, oy, ot, radius, cap, rate = contact
    zx, zy, zt = vx - turn * ry + ox, vy + turn * rx + oy, radius * (turn + ot)
    along = zx * zx + zy * zy
    size = sqrt(along + zt * zt)
    if rate * size <= cap:
        return -rate * zx, -rate * zy, -rate * radius * zt, 0.0, 0.0
    gain = cap / size
    loose = (1.0 - gain / rate) * dt
    return -gain * zx, -gain * zy, -gain * radius * zt, loose * sqrt(along), loose * size * cap


def report(
    setting: Setting, body: Any, feet: Any, pressures: Sequence[float], contacts: list[Pushed]
) -> None:
    """Set forces and shear of the feet, and what they slid."""
    dt = setting.period
    stiffness, radius = setting.shear_stiffness, setting.turning_radius
    twisting = stiffness * radius * radius
    vx, vy, turn = body[SPEED_X], body[SPEED_Y], body[TURN]
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    total_x = total_y = 0.0
    place = 0
    for index in range(6):
        fx = fy = moment = slid = 0.0
        if feet[CAP][index] > 0.0:
            fx, fy, moment, slid, lost = push(vx, vy, turn, contacts[place], dt)
            place += 1
            total_x += fx
            total_y += fy
            body[LOST] += lost
            feet[SLIP_PATH][index] += slid
        feet[FORCE_X][index], feet[FORCE_Y][index], feet[MOMENT][index] = fx, fy, moment
        feet[SHEAR_X][index], feet[SHEAR_Y][index] = -fx / stiffness, -fy / stiffness
        feet[TWIST][index] = -moment / twisting if radius > 0.0 else 0.0
        feet[SLIP_SPEED][index] = slid / dt
        home_x = setting.home_x[index] + feet[OFFSET_X][index]
        home_y = setting.home_y[index] + feet[OFFSET_Y][index]
        feet[MARKER_X][index] = body[X] + cosine * home_x - sine * home_y
        feet[MARKER_Y][index] = body[Y] + sine * home_x + cosine * home_y
    body[PUSH_X], body[PUSH_Y] = total_x, total_y


# What `walk` calls, for a compiler.
PARTS = (
    step, move_feet, body_advance, load_share, touch_down, is_wet, share_loads, balance, grip,
    dome_load, drain, resistance, on_film, newton, push, report,
)  # fmt: skip

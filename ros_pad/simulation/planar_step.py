# SPDX-License-Identifier: Apache-2.0
"""One step of a planar body on frictional feet, written on flat sequences of numbers.

The same source runs as plain Python, on lists, and as machine code, on arrays (see
:mod:`ros_pad.simulation.compiled`). Plain and compiled code give the same numbers to the last bit,
so that a seed gives the same walk with and without a compiler. Therefore the code uses only
operations that plain and compiled code round in the same way (``sqrt``, but no ``hypot``).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin, sqrt
from typing import TYPE_CHECKING, Any

from ros_pad.contact import laws
from ros_pad.contact.laws import dome_load, drained, resistance

if TYPE_CHECKING:
    from ros_pad.simulation.planar_model import PlanarModel

# A contact in a step: lever arm x, y, m; velocity x, y, m/s, and yaw rate, rad/s, at which the
# contact would slide if the body stood still; turning radius, m; cap of its force, N; force over
# velocity up to the cap, N s/m.
Pushed = tuple[float, float, float, float, float, float, float, float]

Floats = Sequence[float]
Three = tuple[float, float, float]
Leg = tuple[int, float, float, float, float]  # index, share, x, y, preload

# Rows of the table of feet; a column is a foot. Values are in world axes unless noted.
FEET = 23
(
    PHASE,  # time since touch-down, as a share of the cycle
    OFFSET_X, OFFSET_Y,  # from home, in the body, m
    LIFTED_X, LIFTED_Y,  # place of the lift-off, from home, in the body, m
    GROUND, HEIGHT,  # height of the ground below the foot, and of the foot above it, m
    LOAD, CAP,  # load and tangential capacity, N
    SHEAR_X, SHEAR_Y, SHEAR_TURN,  # shear of the pads, m and rad
    FORCE_X, FORCE_Y, MOMENT,  # force of the ground on the foot, N, and yaw moment, N m
    SLIP_SPEED, SLIP_PATH,  # m/s, m
    OVERLOAD,  # time with a load above the force limit of the domes, s
    WET,  # 1 on wet ground, 0 on dry
    MARKER_X, MARKER_Y,  # position of the marker, m
    STEP_X, STEP_Y,  # motion of the foot in the body in this step, m
) = range(FEET)  # fmt: skip

# Entries of the body, in SI units.
BODY = 16
(
    STEPS, X, Y, HEADING, SPEED_X, SPEED_Y, YAW_RATE,
    PULL_X, PULL_Y,  # force of the towed load on the body, N
    SLED_X, SLED_Y,  # stretch of the line to the towed load, m
    LOST,  # work lost in slip, J
    TIPPED, TIPPED_AT,  # foot that would have to pull, one more than feet: no balance; time, s
    PUSH_X, PUSH_Y,  # force of all feet, N
) = range(BODY)  # fmt: skip


def step(model: PlanarModel, body: Any, feet: Any, films: Any, pressures: Floats) -> bool:
    """Advance by a period; return False if the friction step did not converge.

    ``films`` has a row for each foot, see :mod:`ros_pad.contact.laws`.
    """
    dt = model.period
    # The gait has its own clock, which starts when the robot has settled.
    before = max(0.0, body[STEPS] * dt - model.settle)
    body[STEPS] += 1.0
    time = max(0.0, body[STEPS] * dt - model.settle)
    move_feet(model, body, feet, films, before, time)
    share_loads(model, body, feet)
    # Lever arms and motions are turned into world axes with the heading in mid-step.
    middle = body[HEADING] + 0.5 * body[YAW_RATE] * dt
    cosine, sine = cos(middle), sin(middle)
    contacts = grip(model, body, feet, films, pressures, cosine, sine)
    towed = model.tow.mass
    cap = 0.0
    if towed > 0.0:
        behind_x = body[X] - model.tow.distance * cosine
        behind_y = body[Y] - model.tow.distance * sine
        cap = model.tow.wet if is_wet(model, behind_x, behind_y) else model.tow.dry
    stiffness = model.tow.stiffness
    if cap > 0.0:
        contacts.append((
            0.0, 0.0, body[SLED_X] / dt, body[SLED_Y] / dt, 0.0, 0.0, cap, stiffness * dt
        ))  # fmt: skip
    last_x, last_y = body[SPEED_X], body[SPEED_Y]
    free_x = last_x - model.trunk.downhill * dt
    vx, vy, yaw_rate, converged = newton(
        (free_x, last_y, body[YAW_RATE]),
        model.trunk.mass + towed, model.trunk.inertia, contacts, dt,
        (last_x, last_y, body[YAW_RATE]),
    )  # fmt: skip
    if not converged:
        return False
    drag_x = drag_y = 0.0
    if cap > 0.0:
        drag_x, drag_y, _, _, _ = push(vx, vy, yaw_rate, contacts[-1], dt)
    body[SLED_X], body[SLED_Y] = -drag_x / stiffness, -drag_y / stiffness
    # The line pulls the body by the load's friction, its inertia and its weight downhill.
    body[PULL_X] = drag_x - towed * ((vx - last_x) / dt + model.trunk.downhill)
    body[PULL_Y] = drag_y - towed * (vy - last_y) / dt
    body[SPEED_X], body[SPEED_Y], body[YAW_RATE] = vx, vy, yaw_rate
    body[X] += vx * dt
    body[Y] += vy * dt
    body[HEADING] += yaw_rate * dt
    report(model, body, feet, contacts)
    return True


# --- gait -------------------------------------------------------------------------------------


def move_feet(
    model: PlanarModel, body: Any, feet: Any, films: Any, before: float, time: float
) -> None:
    """Move the feet in the body as the gait prescribes, between two times of the gait, s."""
    gait, trunk = model.gait, model.trunk
    cycle, duty, reach = gait.cycle, gait.duty, gait.reach
    advance = body_advance(gait, time) - body_advance(gait, before)
    turn = -gait.heading_gain * body[HEADING] * model.period
    phases, offset_x, offset_y = feet[PHASE], feet[OFFSET_X], feet[OFFSET_Y]
    lifted_x, lifted_y = feet[LIFTED_X], feet[LIFTED_Y]
    heights, step_x, step_y = feet[HEIGHT], feet[STEP_X], feet[STEP_Y]
    share = time / cycle
    for index in range(len(gait.middles)):
        phase = (share - gait.middles[index] + duty / 2.0) % 1.0
        x, y = offset_x[index], offset_y[index]
        stood = phases[index] < duty
        phases[index] = phase
        if phase < duty:
            if not stood:
                touch_down(model, body, feet, films[index], index)
            # The foot moves in the body against the motion of the body.
            heights[index] = 0.0
            step_x[index] = turn * (trunk.home_y[index] + y) - advance
            step_y[index] = -turn * (trunk.home_x[index] + x)
            offset_x[index] = x + step_x[index]
            offset_y[index] = y + step_y[index]
        else:
            if stood:
                lifted_x[index], lifted_y[index] = x, y
            swing = (phase - duty) / (1.0 - duty)
            progress = 0.5 - 0.5 * cos(pi * swing)
            rise = sin(pi * swing)
            heights[index] = gait.lift * rise * rise
            offset_x[index] = lifted_x[index] + progress * (reach - lifted_x[index])
            offset_y[index] = lifted_y[index] * (1.0 - progress)


def body_advance(gait: Any, time: float) -> float:
    """Return the intended advance of the body since time zero, m, of either kind of gait."""
    speed = gait.stride / gait.cycle
    if gait.pushes:
        angle = 4.0 * pi * time / gait.cycle
        return speed * (time - gait.cycle / (4.0 * pi) * sin(angle))
    if time <= 0.0:  # feet are placed as if the gait had run before
        return speed * time
    if time >= gait.cycle:
        return speed * (time - 0.5 * gait.cycle)
    return 0.5 * speed * (time - gait.cycle / pi * sin(pi * time / gait.cycle))


def load_share(duty: float, overlap: float, phase: float) -> float:
    """Return the factor, 0 in swing to 1, with which a foot takes part in carrying the body."""
    if phase >= duty:
        return 0.0
    edge = phase if phase < duty - phase else duty - phase
    if edge >= overlap:
        return 1.0
    ramp = edge / overlap
    return ramp * ramp * (3.0 - 2.0 * ramp)


def touch_down(model: PlanarModel, body: Any, feet: Any, film: Any, index: int) -> None:
    """Start a stance: read the depth of the liquid and the height of the ground at the foot."""
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    home_x = model.trunk.home_x[index] + feet[OFFSET_X][index]
    home_y = model.trunk.home_y[index] + feet[OFFSET_Y][index]
    x = body[X] + cosine * home_x - sine * home_y
    y = body[Y] + sine * home_x + cosine * home_y
    laws.touch_down(film, model.floor.puddle if is_wet(model, x, y) else 0.0)
    heights, cell = model.floor.heights, model.floor.height_cell
    row = heights[int((y - model.floor.height_y) // cell) % len(heights)]
    feet[GROUND][index] = row[int((x - model.floor.height_x) // cell) % len(row)]


def is_wet(model: PlanarModel, x: float, y: float) -> bool:
    """Return whether there is liquid at a world position, m."""
    floor = model.floor
    row = floor.wet[int((y - floor.wet_y) // floor.wet_cell) % len(floor.wet)]
    return row[int((x - floor.wet_x) // floor.wet_cell) % len(row)]


# --- loads ------------------------------------------------------------------------------------


def share_loads(model: PlanarModel, body: Any, feet: Any) -> None:
    """Set the normal loads: weighted least squares in balance, in which no foot can pull.

    N_i = w_i max(0, λ0 + λ1 x_i + λ2 y_i + k z_i), with w_i the factor from :func:`load_share` and
    z_i the height of the ground below foot i, such that ΣN = W, ΣN x = W x_p, ΣN y = W y_p. The
    centre of pressure (x_p, y_p) lags behind the centre of mass when the body speeds up. The
    horizontal forces are those of the step before. Feet that would pull are left out, and included
    again when they would press. If no loads balance the weight, the robot tips over.

    A gait in which only two feet stand, such as a trot, is in balance on average only. There
    ``rocks`` lets the line between them carry the weight, without the moment about that line.
    """
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    lift = model.tow.height - model.trunk.height
    lean_x = lift * body[PULL_X] - model.trunk.height * body[PUSH_X]
    lean_y = lift * body[PULL_Y] - model.trunk.height * body[PUSH_Y]
    wanted = (
        model.trunk.weight,
        cosine * lean_x + sine * lean_y + model.trunk.weight * model.trunk.centre_x,
        cosine * lean_y - sine * lean_x + model.trunk.weight * model.trunk.centre_y,
    )
    phases, offset_x, offset_y, ground = feet[PHASE], feet[OFFSET_X], feet[OFFSET_Y], feet[GROUND]
    loads = feet[LOAD]
    legs = []
    for index in range(len(model.gait.middles)):
        loads[index] = 0.0
        share = load_share(model.gait.duty, model.gait.overlap, phases[index])
        if share > 0.0:
            x = model.trunk.home_x[index] + offset_x[index]
            y = model.trunk.home_y[index] + offset_y[index]
            legs.append((index, share, x, y, model.trunk.leg_stiffness * ground[index]))
    count = len(model.gait.middles)
    sets = 1 << count
    presses = sets - 1  # set of feet that press, with a bit for each foot
    pulling = 0
    # Feet are removed or added one after another, the worst first, which nearly always ends in
    # balance. If not, every set of feet is tried.
    for attempt in range(2 * count + sets):
        if attempt >= 2 * count:
            presses = attempt - 2 * count
        wrong = balance(legs, presses, wanted, model.trunk.rocks, loads)
        if wrong == 0:
            return
        if pulling == 0:
            pulling = wrong
        if attempt < 2 * count:
            presses ^= 1 << (wrong - 1)
    if body[TIPPED] == 0.0:
        body[TIPPED] = pulling
        body[TIPPED_AT] = body[STEPS] * model.period


def balance(legs: Sequence[Leg], presses: int, wanted: Three, rocks: float, loads: Any) -> int:
    """Set the loads with which the feet in the set ``presses`` balance the robot, 0 for others.

    Returns
    -------
    int
        Number, from 1, of the foot in the set that pulls most. If none pulls, number of the foot
        outside the set that would press most; 0 if there is none. One more than there are feet if
        the set has no balance.
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
        return len(loads) + 1
    # Gauss elimination of the symmetric 3 x 3 system.
    axx, axy, bx = sxx - sx * sx / s + rocks, sxy - sx * sy / s, mx - sx * total / s
    ayy, by = syy - sy * sy / s + rocks, my - sy * total / s
    determinant = axx * ayy - axy * axy
    if determinant <= 1e-12 * sxx * syy:
        return len(loads) + 1  # two feet, or feet in a line
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
    model: PlanarModel,
    body: Any,
    feet: Any,
    films: Any,
    pressures: Floats,
    cosine: float,
    sine: float,
) -> list[Pushed]:
    """Set the tangential capacity of each foot, N; return the contacts of feet that have one.

    The contacts are in the order of the feet.
    """
    dt = model.period
    stiffness, radius = model.foot.shear_stiffness, model.foot.turning_radius
    contacts = []
    for index in range(len(model.gait.middles)):
        load = feet[LOAD][index]
        if load <= 0.0:
            feet[CAP][index] = 0.0
            continue
        home_x = model.trunk.home_x[index] + feet[OFFSET_X][index]
        home_y = model.trunk.home_y[index] + feet[OFFSET_Y][index]
        x, y = cosine * home_x - sine * home_y, sine * home_x + cosine * home_y
        pressure = pressures[index]
        on_domes = dome_load(model.foot, load, pressure)
        dome_film = sole_film = 0.0
        feet[WET][index] = 0.0
        if is_wet(model, body[X] + x, body[Y] + y):
            feet[WET][index] = 1.0
            dome_film, sole_film = drained(
                model.foot,
                films[index],
                on_domes,
                load - on_domes,
                pressure,
                dt,
                feet[SLIP_SPEED][index],
            )
        cap = resistance(model.foot, on_domes, load - on_domes, pressure, dome_film, sole_film)
        feet[CAP][index] = cap
        if pressure > 0.0 and on_domes < load:
            feet[OVERLOAD][index] += dt
        if cap > 0.0:
            step_x, step_y = feet[STEP_X][index], feet[STEP_Y][index]
            contacts.append((
                x, y,
                (cosine * step_x - sine * step_y + feet[SHEAR_X][index]) / dt,
                (sine * step_x + cosine * step_y + feet[SHEAR_Y][index]) / dt,
                feet[SHEAR_TURN][index] / dt,
                radius, cap, stiffness * dt,
            ))  # fmt: skip
    return contacts


def newton(
    free: Three,
    mass: float,
    inertia: float,
    contacts: Sequence[Pushed],
    dt: float,
    start: Three,
) -> tuple[float, float, float, bool]:
    """Minimise the convex energy of a step by Newton's method, with a line search by halving.

    Contacts shear elastically up to their caps.

    Returns
    -------
    tuple
        Velocity x, y, m/s, yaw rate, rad/s, and whether the method converged.
    """
    vx, vy, w = start
    # Stop where the gradient is within its rounding error: that of a speed times largest gains.
    scale = mass
    for contact in contacts:
        scale += 0.01 * dt * contact[7]
    scale *= 1e-13 + 1e-12 * (abs(free[0]) + abs(free[1]))
    step_x = step_y = step_w = slope = 0.0
    length = 1.0
    for _ in range(200):
        gx, gy, gw, hxx, hxy, hyy, hxw, hyw, hww = derivatives(
            (vx, vy, w), free, mass, inertia, contacts, dt
        )
        # The slope of a convex function grows along the step. If it rises at the end nearly as
        # steeply as it fell at the start, the step was too long and is halved.
        rise = -(gx * step_x + gy * step_y + gw * step_w)
        if rise > 0.9 * slope and length > 1e-9:
            length *= 0.5
            vx += length * step_x
            vy += length * step_y
            w += length * step_w
            continue
        if abs(gx) + abs(gy) + 10.0 * abs(gw) < scale:
            return vx, vy, w, True
        # Cholesky decomposition of the 3 x 3 Hessian, which is positive definite because of the
        # masses.
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


def derivatives(
    velocity: Three,
    free: Three,
    mass: float,
    inertia: float,
    contacts: Sequence[Pushed],
    dt: float,
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return gradient x, y, w and Hessian xx, xy, yy, xw, yw, ww of the energy of a step."""
    vx, vy, w = velocity
    bx, by, bw = free
    gx, gy, gw = mass * (vx - bx), mass * (vy - by), inertia * (w - bw)
    hxx = hyy = mass
    hww = inertia
    hxy = hxw = hyw = 0.0
    for rx, ry, ox, oy, ot, radius, cap, rate in contacts:
        zx = vx - w * ry + ox
        zy = vy + w * rx + oy
        zt = radius * (w + ot)
        square = zx * zx + zy * zy + zt * zt
        # gain: impulse over slip velocity; bend: fall of the gain along the slip, over the square
        # of the slip velocity
        if rate * rate * square <= cap * cap:
            gain, bend = dt * rate, 0.0
        else:
            gain = dt * cap / sqrt(square)
            bend = gain / square
        fx, fy = gain * zx, gain * zy
        gx += fx
        gy += fy
        gw += rx * fy - ry * fx
        gw += radius * gain * zt
        kxt, kyt, ktt = -bend * zx * zt, -bend * zy * zt, gain - bend * zt * zt
        kxx, kxy, kyy = gain - bend * zx * zx, -bend * zx * zy, gain - bend * zy * zy
        kxw = rx * kxy - ry * kxx + radius * kxt
        kyw = rx * kyy - ry * kxy + radius * kyt
        hxx += kxx
        hxy += kxy
        hyy += kyy
        hxw += kxw
        hyw += kyw
        hww += rx * kyw - ry * kxw + radius * (rx * kyt - ry * kxt + radius * ktt)
    return gx, gy, gw, hxx, hxy, hyy, hxw, hyw, hww


def push(
    vx: float, vy: float, yaw_rate: float, contact: Pushed, dt: float
) -> tuple[float, float, float, float, float]:
    """Return force x and y, N, yaw moment, N m, slip, m, and lost work, J, of a contact."""
    rx, ry, ox, oy, ot, radius, cap, rate = contact
    zx, zy = vx - yaw_rate * ry + ox, vy + yaw_rate * rx + oy
    zt = radius * (yaw_rate + ot)
    along = zx * zx + zy * zy
    size = sqrt(along + zt * zt)
    if rate * size <= cap:
        return -rate * zx, -rate * zy, -rate * radius * zt, 0.0, 0.0
    gain = cap / size
    loose = (1.0 - gain / rate) * dt
    return -gain * zx, -gain * zy, -gain * radius * zt, loose * sqrt(along), loose * size * cap


def report(model: PlanarModel, body: Any, feet: Any, contacts: list[Pushed]) -> None:
    """Set forces, shear, slip and markers of the feet, and add the work lost in slip."""
    dt = model.period
    stiffness, radius = model.foot.shear_stiffness, model.foot.turning_radius
    torsional = stiffness * radius * radius
    vx, vy, yaw_rate = body[SPEED_X], body[SPEED_Y], body[YAW_RATE]
    cosine, sine = cos(body[HEADING]), sin(body[HEADING])
    body[PUSH_X] = body[PUSH_Y] = 0.0
    place = 0
    for index in range(len(model.gait.middles)):
        fx = fy = moment = slid = 0.0
        if feet[CAP][index] > 0.0:
            fx, fy, moment, slid, lost = push(vx, vy, yaw_rate, contacts[place], dt)
            place += 1
            body[PUSH_X] += fx
            body[PUSH_Y] += fy
            body[LOST] += lost
            feet[SLIP_PATH][index] += slid
        feet[FORCE_X][index], feet[FORCE_Y][index], feet[MOMENT][index] = fx, fy, moment
        feet[SHEAR_X][index], feet[SHEAR_Y][index] = -fx / stiffness, -fy / stiffness
        feet[SHEAR_TURN][index] = -moment / torsional if radius > 0.0 else 0.0
        feet[SLIP_SPEED][index] = slid / dt
        home_x = model.trunk.home_x[index] + feet[OFFSET_X][index]
        home_y = model.trunk.home_y[index] + feet[OFFSET_Y][index]
        feet[MARKER_X][index] = body[X] + cosine * home_x - sine * home_y
        feet[MARKER_Y][index] = body[Y] + sine * home_x + cosine * home_y

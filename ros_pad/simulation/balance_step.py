# SPDX-License-Identifier: Apache-2.0
"""One step of a gait with balance, written on sequences of numbers.

The legs hold the body as springs and dampers would (virtual model control, Pratt and others,
2001). The wrench that this needs is shared over the standing feet such that the acceleration of
the body is nearest to the wanted one in the norm of its inertia (Gauss' principle of least
constraint), with each force within its cone of friction. Feet in swing are accelerated towards
their next place: half a stance ahead (Raibert, 1986), and further, to the capture point, where the
body is too fast (Pratt and others, 2006).

As in :mod:`ros_pad.simulation.planar_step`, the same source runs as plain Python, on lists, and as
machine code, on arrays, with the same numbers to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

Floats = Sequence[float]

AHEAD = 0.8  # share of a swing after which its end stays: a foot that still moves scuffs
TOP = 0.4  # share of a swing at which the foot is highest
TRUST = 0.8  # share of the friction of a slip that the next force may use
SLOW = 3.0  # cycles in which the feet come to stand round another point
USUAL_GRIP = 0.6  # friction that a foot is taken to have before it slips
LEAST_GRIP = 0.02  # friction below which no foot is taken to be
LOADED = 0.01  # share of the weight from which a foot stands
UNLOADED = 0.02  # s without load after which a standing foot has lost the ground
DAMPING = 0.01  # weight of forces that do not move the body; in 1/mass
STIFFNESS = 0.3  # of the forces to their cones, over the mean of the problem's
ROUNDS = 20  # between least squares and cones
GRAVITY = 9.81

# Rows of the table of feet; a column is a foot. Places are in the world.
FEET = 19
(
    STANDS,  # 1 while the foot carries
    PHASE,  # time since the touch-down of the gait, as a share of the cycle
    UNLOADED_FOR,  # s
    GRIP,  # coefficient of friction that it is taken to have
    FROM_X, FROM_Y, FROM_Z,  # place of the lift-off, m
    TO_X, TO_Y,  # place where the swing ends, m
    AIM_X, AIM_Y, AIM_Z,  # where the swinging foot should be, m
    RATE_X, RATE_Y, RATE_Z,  # its velocity there, m/s
    PULL_X, PULL_Y, PULL_Z,  # and its acceleration, m/s2
    FORCE,  # first of three: the force of the ground, N
) = range(FEET)  # fmt: skip
ROWS = FEET + 2

# Entries of the goal of the body, in SI units.
GOAL = 11
(
    TIME,  # of the gait; below 0 all feet stand
    X, Y, SPEED_X, SPEED_Y, GAIN_X, GAIN_Y,  # where it should be, how fast, and its acceleration
    CENTRE_X, CENTRE_Y,  # from the base to the point that the feet stand round, m
    GROUND,  # mean height of the standing feet, m
    FRICTION,  # mean of what the feet are taken to have
) = range(GOAL)  # fmt: skip


class Plan(NamedTuple):
    """What stays during a walk."""

    legs: int
    joints: int  # of a leg
    period: float  # s
    cycle: float  # s
    duty: float
    lift: float  # m
    middles: Any  # of stances, as shares of the cycle
    homes: Any  # of the feet from their mean, fore and left, leg by leg, m
    speeds: Any  # largest of each joint, rad/s
    height: float  # of the base above the ground, m
    mass: float  # kg
    pendulum: float  # how fast the body falls over a foot, rad/s


class State(NamedTuple):
    """What the robot knows of itself, and what it does; arrays or lists of the same shapes."""

    q: Any  # (3 …): place of the base, m
    v: Any  # (6 + joints): its velocity in the world, m/s, its own rates, rad/s; of the joints
    turn: Any  # (9,): rotation from the base to the world, row by row
    mass: Any  # (6 + joints, 6 + joints): inertia, in the order of v
    bias: Any  # (6 + joints): forces of gravity and inertia, in the order of v
    places: Any  # (legs, 3): places of the feet, m
    anchors: Any  # (joints, 3): places of the joints, m
    axes: Any  # (joints, 3): their axes
    contacts: Any  # (legs, 6): first the load of a foot, N, then two tangential forces, N
    torques: Any  # (joints,): the result, N m


def step(plan: Plan, goal: Any, feet: Any, state: State) -> bool:
    """Set the torques of all joints for the next period.

    Parameters
    ----------
    plan : Plan
        What stays.
    goal : array (GOAL,)
        Goal of the body; changed in its last entries.
    feet : array (ROWS, legs)
        State of the feet; changed.
    state : State
        Place and motion of the robot; its torques are changed.
    """
    legs, count = plan.legs, plan.legs * plan.joints
    v, mass, bias, places = state.v, state.mass, state.bias, state.places
    anchors, axes, contacts = state.anchors, state.axes, state.contacts
    jacobians = [0.0] * (3 * count)
    for leg in range(legs):
        x, y, z = places[leg][0], places[leg][1], places[leg][2]
        for i in range(leg * plan.joints, (leg + 1) * plan.joints):
            a, b, c = axes[i][0], axes[i][1], axes[i][2]
            x_i, y_i, z_i = x - anchors[i][0], y - anchors[i][1], z - anchors[i][2]
            jacobians[3 * i] = b * z_i - c * y_i
            jacobians[3 * i + 1] = c * x_i - a * z_i
            jacobians[3 * i + 2] = a * y_i - b * x_i
    pulls = [0.0] * count  # accelerations of the joints of swinging legs
    speed = [0.0] * 3
    for leg in range(legs):
        of_foot(plan, leg, state, jacobians, speed)
        load = contacts[leg][0]
        find_ground(plan, leg, goal, feet, load > LOADED * plan.mass * GRAVITY, places[leg])
        find_grip(plan, leg, feet, speed, contacts[leg])
        if feet[STANDS][leg] < 0.5:
            aim(plan, leg, goal, feet, state)
            swing(plan, leg, feet, places[leg], speed, jacobians, pulls)
    wanted = [0.0] * 6
    wish(plan, goal, feet, state, wanted)
    wrench = [0.0] * 6
    for row in range(6):
        total = bias[row]
        for column in range(6):
            total += mass[row][column] * wanted[column]
        for i in range(count):  # the recoil of swinging legs
            total += mass[row][6 + i] * pulls[i]
        wrench[row] = total
    stand_round(plan, goal, state, wrench)
    share_out(plan, feet, state, wrench)
    for leg in range(legs):
        for i in range(leg * plan.joints, (leg + 1) * plan.joints):
            total = bias[6 + i]
            for j in range(leg * plan.joints, (leg + 1) * plan.joints):
                total += mass[6 + i][6 + j] * pulls[j]
            for axis in range(3):
                total -= jacobians[3 * i + axis] * feet[FORCE + axis][leg]
            fast = v[6 + i] * total > 0.0 and abs(v[6 + i]) > plan.speeds[i]
            state.torques[i] = 0.0 if fast else total
    return True


def of_foot(plan: Plan, leg: int, state: State, jacobians: Floats, speed: Any) -> None:
    """Set the velocity of a foot in the world, m/s."""
    q, v, turn, places = state.q, state.v, state.turn, state.places
    x, y, z = places[leg][0] - q[0], places[leg][1] - q[1], places[leg][2] - q[2]
    a = turn[0] * v[3] + turn[1] * v[4] + turn[2] * v[5]
    b = turn[3] * v[3] + turn[4] * v[4] + turn[5] * v[5]
    c = turn[6] * v[3] + turn[7] * v[4] + turn[8] * v[5]
    speed[0], speed[1], speed[2] = v[0] + b * z - c * y, v[1] + c * x - a * z, v[2] + a * y - b * x
    for i in range(leg * plan.joints, (leg + 1) * plan.joints):
        for axis in range(3):
            speed[axis] += jacobians[3 * i + axis] * v[6 + i]


def find_ground(plan: Plan, leg: int, goal: Any, feet: Any, loaded: bool, place: Floats) -> None:
    """Let a foot stand or swing: lift-off by the clock, touch-down by load."""
    phase = 0.5 * plan.duty
    if goal[TIME] >= 0.0:
        phase = (goal[TIME] / plan.cycle - plan.middles[leg] + 0.5 * plan.duty) % 1.0
    feet[PHASE][leg] = phase
    swung = (phase - plan.duty) / (1.0 - plan.duty)  # below 0 in stance
    if feet[STANDS][leg] > 0.5:
        waited = 0.0 if loaded else feet[UNLOADED_FOR][leg] + plan.period
        feet[UNLOADED_FOR][leg] = waited
        lifts = 0.0 <= swung < 0.5
        if lifts or (swung < 0.0 and waited > UNLOADED):
            feet[STANDS][leg] = 0.0
            for axis in range(3):
                feet[FROM_X + axis][leg] = feet[AIM_X + axis][leg] = place[axis]
                feet[RATE_X + axis][leg] = 0.0
    elif loaded and (swung < 0.0 or swung > 0.5):
        feet[STANDS][leg] = 1.0
        feet[UNLOADED_FOR][leg] = 0.0


def find_grip(plan: Plan, leg: int, feet: Any, speed: Floats, contact: Floats) -> None:
    """Remember the friction of a foot that slips, for a while."""
    grip = feet[GRIP][leg]
    grip += plan.period / (2.0 * plan.cycle) * (USUAL_GRIP - grip)
    slip = 0.05 * GRAVITY / plan.pendulum
    slips = speed[0] * speed[0] + speed[1] * speed[1] > slip * slip
    if slips and feet[STANDS][leg] > 0.5 and contact[0] > LOADED * plan.mass * GRAVITY:
        side = sqrt(contact[1] * contact[1] + contact[2] * contact[2])
        grip = max(LEAST_GRIP, min(grip, TRUST * side / contact[0]))
    feet[GRIP][leg] = grip


def aim(plan: Plan, leg: int, goal: Any, feet: Any, state: State) -> None:
    """Set where a foot without ground should be: on its swing, or on its fall after that."""
    q, v, turn = state.q, state.v, state.turn
    share = (feet[PHASE][leg] - plan.duty) / (1.0 - plan.duty)
    if share < 0.0:
        # A foot that finds no ground in time falls.
        for axis in range(3):
            feet[PULL_X + axis][leg] = 0.0
        feet[RATE_X][leg] = feet[RATE_Y][leg] = 0.0
        feet[RATE_Z][leg] = min(feet[RATE_Z][leg], 0.0) - GRAVITY * plan.period
        feet[AIM_Z][leg] += feet[RATE_Z][leg] * plan.period
        return
    time = (1.0 - plan.duty) * plan.cycle
    if share < AHEAD:
        x, y = plan.homes[2 * leg], plan.homes[2 * leg + 1]
        c, s = turn[0], turn[3]
        size = sqrt(c * c + s * s)
        home = (c * x - s * y) / size, (s * x + c * y) / size
        left, half = (1.0 - share) * time, 0.5 * plan.duty * plan.cycle
        # A foot so far off accelerates the body by g/height, which friction has to carry.
        most = 0.5 * goal[FRICTION] * plan.height
        for axis in range(2):
            ahead = (v[axis] - goal[SPEED_X + axis]) / plan.pendulum
            feet[TO_X + axis][leg] = (
                q[axis] + goal[CENTRE_X + axis] + home[axis] + v[axis] * left
                + goal[SPEED_X + axis] * half + max(-most, min(most, ahead))
            )  # fmt: skip
    for axis in range(2):
        start = feet[FROM_X + axis][leg]
        way = feet[TO_X + axis][leg] - start
        there, rate, pull = blend(share / AHEAD, AHEAD * time)
        feet[AIM_X + axis][leg] = start + there * way
        feet[RATE_X + axis][leg] = rate * way
        feet[PULL_X + axis][leg] = pull * way
    # A foot rises above the higher of its two grounds.
    top = plan.lift + max(goal[GROUND], feet[FROM_Z][leg])
    if share < TOP:
        start = feet[FROM_Z][leg]
        there, rate, pull = blend(share / TOP, TOP * time)
    else:
        start = goal[GROUND]
        there, rate, pull = blend((1.0 - share) / (1.0 - TOP), (1.0 - TOP) * time)
        rate = -rate
    way = top - start
    feet[AIM_Z][leg] = start + there * way
    feet[RATE_Z][leg] = rate * way
    feet[PULL_Z][leg] = pull * way


def blend(share: float, time: float) -> tuple[float, float, float]:
    """Return a motion of least jerk: from 0 to 1, its rate, 1/s, and its acceleration, 1/s²."""
    if share >= 1.0:
        return 1.0, 0.0, 0.0
    rest = 1.0 - share
    return (
        share * share * share * (10.0 - 15.0 * share + 6.0 * share * share),
        30.0 * share * share * rest * rest / time,
        60.0 * share * rest * (1.0 - 2.0 * share) / (time * time),
    )


def swing(
    plan: Plan, leg: int, feet: Any, place: Floats, speed: Floats, jacobians: Floats, pulls: Any
) -> None:
    """Set the accelerations of joints, rad/s², that bring a foot to its aim."""
    pull, square, fast = [0.0] * 3, [0.0] * 9, 14.0 * plan.pendulum
    for axis in range(3):
        away = feet[AIM_X + axis][leg] - place[axis]
        late = feet[RATE_X + axis][leg] - speed[axis]
        pull[axis] = fast * (fast * away + 2.0 * late) + feet[PULL_X + axis][leg]
        for other in range(3):
            total = 0.0
            for i in range(leg * plan.joints, (leg + 1) * plan.joints):
                total += jacobians[3 * i + axis] * jacobians[3 * i + other]
            square[3 * axis + other] = total
    # A stretched leg has no acceleration along itself: damping keeps it finite.
    damping = 1e-4 * (square[0] + square[4] + square[8])
    for axis in range(3):
        square[4 * axis] += damping
    factorise(square, 3)
    forward(square, 3, pull, 0)
    backward(square, 3, pull)
    for i in range(leg * plan.joints, (leg + 1) * plan.joints):
        total = 0.0
        for axis in range(3):
            total += jacobians[3 * i + axis] * pull[axis]
        pulls[i] = total


def wish(plan: Plan, goal: Any, feet: Any, state: State, wanted: Any) -> None:
    """Set the acceleration that the body should have: in the world, then about its own axes."""
    q, v, turn = state.q, state.v, state.turn
    # Frequencies of critically damped motions, rad/s.
    firm, slack = 2.0 * plan.pendulum, 0.5 * plan.pendulum
    standing, ground, friction = 0, 0.0, 0.0
    for leg in range(plan.legs):
        friction += feet[GRIP][leg] / plan.legs
        if feet[STANDS][leg] > 0.5:
            standing, ground = standing + 1, ground + state.places[leg][2]
    if standing:
        goal[GROUND] += plan.period / (SLOW * plan.cycle) * (ground / standing - goal[GROUND])
    goal[FRICTION] = friction
    most = friction * GRAVITY / (slack * slack)
    for axis in range(2):
        # The goal waits for a body that friction cannot bring there.
        goal[X + axis] = max(q[axis] - most, min(q[axis] + most, goal[X + axis]))
        wanted[axis] = goal[GAIN_X + axis] + slack * (
            slack * (goal[X + axis] - q[axis]) + 2.0 * (goal[SPEED_X + axis] - v[axis])
        )
    wanted[2] = firm * (firm * (plan.height + goal[GROUND] - q[2]) - 2.0 * v[2])
    # The small rotation, about its own axes, that would make the base level with heading 0.
    off = 0.5 * (turn[5] - turn[7]), 0.5 * (turn[6] - turn[2]), 0.5 * (turn[1] - turn[3])
    for axis in range(3):
        wanted[3 + axis] = firm * (firm * off[axis] - 2.0 * v[3 + axis])


def stand_round(plan: Plan, goal: Any, state: State, wrench: Floats) -> None:
    """Let the feet stand round the point of the ground about which the wrench has no moment."""
    turn = state.turn
    about_x = turn[0] * wrench[3] + turn[1] * wrench[4] + turn[2] * wrench[5]
    about_y = turn[3] * wrench[3] + turn[4] * wrench[4] + turn[5] * wrench[5]
    waits = goal[TIME] < 0.0
    share = plan.period / (0.2 if waits else SLOW * plan.cycle)
    x = -(about_y + plan.height * wrench[0]) / wrench[2]
    y = (about_x - plan.height * wrench[1]) / wrench[2]
    goal[CENTRE_X] += share * (x - goal[CENTRE_X])
    goal[CENTRE_Y] += share * (y - goal[CENTRE_Y])
    if waits:  # the feet stand, so the body moves
        for axis in range(2):
            total = 0.0
            for leg in range(plan.legs):
                total += state.places[leg][axis]
            goal[X + axis] = total / plan.legs - goal[CENTRE_X + axis]


def share_out(plan: Plan, feet: Any, state: State, wrench: Any) -> None:
    """Set the forces of the standing feet, N, whose wrench is nearest; the wrench is used up."""
    q, turn, mass, places = state.q, state.turn, state.mass, state.places
    legs = plan.legs
    low = [0.0] * 36  # Cholesky factor of the body's inertia
    for i in range(6):
        for j in range(i + 1):
            low[6 * i + j] = mass[i][j]
    factorise(low, 6)
    forward(low, 6, wrench, 0)
    columns = [0.0] * (18 * legs)  # acceleration, in the norm of inertia, of each unit force
    trace = 0.0
    for leg in range(legs):
        if feet[STANDS][leg] > 0.5:
            x, y, z = places[leg][0] - q[0], places[leg][1] - q[1], places[leg][2] - q[2]
            arms = (0.0, z, -y, -z, 0.0, x, y, -x, 0.0)  # moments of the three unit forces
            for axis in range(3):
                at = 18 * leg + 6 * axis
                columns[at + axis] = 1.0
                for i in range(3):
                    columns[at + 3 + i] = (
                        turn[i] * arms[3 * axis]
                        + turn[3 + i] * arms[3 * axis + 1]
                        + turn[6 + i] * arms[3 * axis + 2]
                    )
                forward(low, 6, columns, at)
                for i in range(6):
                    trace += columns[at + i] * columns[at + i]
    push = [0.0] * (3 * legs)
    for i in range(3 * legs):
        for k in range(6):
            push[i] += columns[6 * i + k] * wrench[k]
    force = [0.0] * (3 * legs)
    fit(plan, feet, columns, trace / (3.0 * legs), push, force)
    for leg in range(legs):
        for axis in range(3):
            stands = feet[STANDS][leg] > 0.5
            feet[FORCE + axis][leg] = force[3 * leg + axis] if stands else 0.0


def fit(plan: Plan, feet: Any, columns: Floats, mean: float, push: Floats, force: Any) -> None:
    """Find the forces within the cones of friction, by alternating directions."""
    size, damping, stiff = 3 * plan.legs, DAMPING / plan.mass, STIFFNESS * mean
    factor = [0.0] * 36
    debt, near, pull = [0.0] * size, [0.0] * size, [0.0] * size
    least_squares(columns, damping, push, factor, force, True)
    for rounds in range(ROUNDS):
        free = rounds == 0
        for i in range(size):
            near[i] = force[i] + debt[i]
        for leg in range(plan.legs):
            free = onto_cone(near, 3 * leg, feet[GRIP][leg]) and free
        if free:
            return
        for i in range(size):
            debt[i] += force[i] - near[i]
            pull[i] = push[i] + stiff * (near[i] - debt[i])
        least_squares(columns, damping + stiff, pull, factor, force, rounds == 0)
    for i in range(size):
        force[i] = near[i]


def onto_cone(force: Any, at: int, friction: float) -> bool:
    """Move a force to the nearest one in its cone of friction; return whether it was there."""
    x, y, z = force[at], force[at + 1], force[at + 2]
    side = sqrt(x * x + y * y)
    if side <= friction * z:
        return True
    up = max(0.0, (friction * side + z) / (1.0 + friction * friction))
    share = friction * up / side if side > 0.0 else 0.0
    force[at], force[at + 1], force[at + 2] = share * x, share * y, up
    return False


def least_squares(
    columns: Floats, weight: float, push: Floats, factor: Any, force: Any, renew: bool
) -> None:
    """Solve (CᵀC + weight) force = push by a system of six equations; C has the columns."""
    size = len(force)
    if renew:
        for i in range(6):
            for j in range(i + 1):
                total = weight if i == j else 0.0
                for k in range(size):
                    total += columns[6 * k + i] * columns[6 * k + j]
                factor[6 * i + j] = total
        factorise(factor, 6)
    part = [0.0] * 6
    for k in range(size):
        for i in range(6):
            part[i] += columns[6 * k + i] * push[k]
    forward(factor, 6, part, 0)
    backward(factor, 6, part)
    for k in range(size):
        total = push[k]
        for i in range(6):
            total -= columns[6 * k + i] * part[i]
        force[k] = total / weight


def factorise(matrix: Any, size: int) -> None:
    """Replace the lower half of a positive definite matrix by its Cholesky factor."""
    for i in range(size):
        for j in range(i + 1):
            total = matrix[size * i + j]
            for k in range(j):
                total -= matrix[size * i + k] * matrix[size * j + k]
            matrix[size * i + j] = sqrt(total) if i == j else total / matrix[(size + 1) * j]


def forward(factor: Floats, size: int, vector: Any, at: int) -> None:
    """Solve with a lower triangular factor in place, from an entry of the vector on."""
    for i in range(size):
        for k in range(i):
            vector[at + i] -= factor[size * i + k] * vector[at + k]
        vector[at + i] /= factor[(size + 1) * i]


def backward(factor: Floats, size: int, vector: Any) -> None:
    """Solve with the transpose of a lower triangular factor in place."""
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            vector[i] -= factor[size * k + i] * vector[k]
        vector[i] /= factor[(size + 1) * i]

# SPDX-License-Identifier: Apache-2.0
"""Posture and gait of a robot whose file gives none, from its legs and their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ros_pad.robots.chains import Chains, Joint
from ros_pad.robots.gait import Gait
from ros_pad.robots.rotation import Array

FROUDE = 0.03
"""Froude number v²/(g h) of a trot whose scene gives no stride: a slow walk."""

_TRIES = 4000  # postures of a leg
_WIDEST = 0.75 * math.pi  # rad from zero, for joints with wider limits


def crouch(legs: Sequence[Sequence[Joint]], feet: Array) -> Array:
    """Return joint positions in which a robot stands with bent legs, (legs, joints), rad.

    The first joint of a leg is as near to zero as its limits allow. The others are where the foot
    moves best in its worst direction, for little torque under load, with the knee to the rear if
    nothing else decides. All feet are then brought to one height.

    Parameters
    ----------
    legs : sequence of sequence of Joint
        The joints of each leg, from the base to the foot.
    feet : array (legs, 4, 4)
        Transforms from the last joint of each leg to its foot, m.
    """
    home = np.array([_bent(leg, foot) for leg, foot in zip(legs, feet, strict=True)])
    chains = Chains(legs, feet)
    for _ in range(20):
        now = chains.solve(home)
        heights = now.positions[:, 2]
        rise = np.zeros((len(legs), 3, 1))
        rise[:, 2, 0] = heights.mean() - heights
        home = home + (np.linalg.pinv(now.jacobians) @ rise)[..., 0]
    return home


def _bent(leg: Sequence[Joint], foot: Array) -> Array:
    chains = Chains([leg], foot[None])
    limits = np.array([joint.limits for joint in leg])
    low, high = np.clip(limits.T, -_WIDEST, _WIDEST)
    count = max(3, round(_TRIES ** (1.0 / max(len(leg) - 1, 1))))
    grids = [np.clip([0.0], low[0], high[0])]
    grids += [np.linspace(*ends, count) for ends in zip(low[1:], high[1:], strict=True)]
    tries = np.stack(np.meshgrid(*grids, indexing='ij'), -1).reshape(-1, 1, len(leg))
    found = chains.solve(tries)
    jacobians, joints = found.jacobians[:, 0], found.frames[:, :, 0, :3, 3]
    links = [joint.at[:3, 3] for joint in leg[1:]] + [foot[:3, 3]]
    length = sum(math.sqrt(link @ link) for link in links)
    moves = np.linalg.svd(jacobians, compute_uv=False)[:, -1]  # m/rad, in the worst direction
    torque = np.abs(jacobians[:, 2]).sum(1)  # N m for a load of 1 N
    score = moves - 0.5 * torque - 1e-3 * joints[..., 0].sum(1)
    below = joints[..., 2].min(1) - found.positions[:, 0, 2]
    score[below < 0.1 * length] = -math.inf  # the foot is to be the lowest part
    room = 0.15 * np.diff(limits[1:])  # to lift the foot
    near = (tries[:, 0, 1:, None] - limits[1:]) * (1.0, -1.0) < room
    score[near.any((1, 2)) & (score > -math.inf)] -= 10.0 * length
    return np.asarray(tries[int(score.argmax()), 0])


def usual_gait(hips: Array, height: float) -> Gait:
    """Return a gait for legs at these hips, m, that carry a body at a height, m.

    A trot of four legs and a tripod of six or eight, else one leg after another. A cycle of the
    first two takes half as long as the swing of a pendulum from that height; legs swing as long
    in the others.
    """
    kind = {4: 'trot', 6: 'tripod', 8: 'tripod'}.get(len(hips), 'wave')
    duty = 0.6 if kind != 'wave' else max(0.75, 1.0 - 1.0 / len(hips))
    # Sizes that no robot has are refused elsewhere.
    height = min(max(height, 0.01), 5.0)
    cycle = 0.4 / (1.0 - duty) * math.pi * math.sqrt(height / 9.81)
    return Gait.named(kind, hips, cycle, duty, lift=0.16 * height)

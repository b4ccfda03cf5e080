# SPDX-License-Identifier: Apache-2.0
"""Legs as chains of joints: positions, rotations and Jacobians of all feet at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.robots.rotation import Array, cross, skew


@dataclass(frozen=True)
class Joint:
    """One joint of a leg, with the link that it moves.

    Attributes
    ----------
    name : str
    at : array (4, 4)
        Transform from the link before, in which the joint sits, to the joint at zero; m.
    axis : array (3,)
        Unit vector of the axis in the frame of the joint.
    slides : bool
        Whether the joint is prismatic: its position is then in m.
    mass : float
        Mass of the link and of what is fixed to it, kg.
    centre : array (3,)
        Centre of that mass in the frame of the joint, m.
    limits : tuple of float
        Lowest and highest position, rad or m; infinite without limits.
    torque, speed : float
        Largest torque of its motor, N m, and largest speed, rad/s; infinite if not known.
    rotor_inertia : float
        Inertia of the motor as seen from the joint, behind its gears, kg m²; 0 if not known.
    """

    name: str
    at: Array
    axis: Array
    slides: bool
    mass: float
    centre: Array
    limits: tuple[float, float] = (-math.inf, math.inf)
    torque: float = math.inf
    speed: float = math.inf
    rotor_inertia: float = 0.0


class Kinematics(NamedTuple):
    """Feet for given joint positions, in the axes of a frame on the base.

    Attributes
    ----------
    positions : array (legs, 3)
        Places of the feet, m.
    rotations : array (legs, 3, 3)
        Rotations from the feet to the frame, dimensionless.
    jacobians : array (legs, 3, joints)
        Velocity of a foot for each joint velocity, m/rad (or 1).
    angular : array (legs, 3, joints)
        Angular velocity of a foot for each joint velocity, no unit (rad/m where a joint slides).
    frames : array (joints, legs, 4, 4)
        Transforms from the joints to the frame, m.
    """

    positions: Array
    rotations: Array
    jacobians: Array
    angular: Array
    frames: Array


class Chains:
    """Chains of joints from the base to the feet, one for each leg, all of the same length.

    Parameters
    ----------
    legs : sequence of sequence of Joint
        The joints of each leg, from the base to the foot.
    feet : array (legs, 4, 4)
        Transforms from the last joint of each leg to the centre of its foot, m.

    Attributes
    ----------
    legs : tuple of tuple of Joint
        As the parameter.
    feet : array (legs, 4, 4)
        As for the parameter, m.
    """

    def __init__(self, legs: Sequence[Sequence[Joint]], feet: Array) -> None:
        self.legs = tuple(map(tuple, legs))
        self.feet = np.asarray(feet, dtype=float)
        self.count, self.length = len(legs), len(legs[0])
        order = list(zip(*legs, strict=True))  # joint by joint, because chains are followed so
        at = np.array([[joint.at for joint in row] for row in order])
        axes = np.array([[joint.axis for joint in row] for row in order])
        slides = np.array([[joint.slides for joint in row] for row in order])
        along = axes[..., :, None] * axes[..., None, :]
        # A transform is constant + cos q · even + sin q · odd + q · slide.
        even, odd, slide = np.zeros((3, *at.shape))
        turns = ~slides
        even[turns, :3, :3] = np.eye(3) - along[turns]
        odd[turns, :3, :3] = skew(axes[turns])
        constant = np.tile(np.eye(4), (*at.shape[:2], 1, 1))
        constant[turns, :3, :3] = along[turns]
        slide[slides, :3, 3] = axes[slides]
        self._constant, self._even, self._odd = at @ constant, at @ even, at @ odd
        self._slide = at @ slide if slides.any() else None
        self._turns = turns[..., None].astype(float)
        self._axes = axes[..., None]
        self._slides = slides
        self._masses = np.array([[joint.mass for joint in row] for row in order])
        centres = np.array([[joint.centre for joint in row] for row in order])
        self._centres = np.concatenate([centres, np.ones((*centres.shape[:2], 1))], -1)[..., None]

    def solve(self, positions: Array, frame: Array | None = None) -> Kinematics:
        """Return the kinematics of all feet.

        Parameters
        ----------
        positions : array (..., legs, joints)
            Joint positions, rad or m; the results have the same leading axes.
        frame : array (4, 4), optional
            Transform from the base to the frame of the results, m; the base itself by default.

        Returns
        -------
        Kinematics
            Positions, m, rotations and Jacobians of all feet.
        """
        q = positions.swapaxes(-1, -2)[..., None, None]
        steps = self._constant + np.cos(q) * self._even + np.sin(q) * self._odd
        if self._slide is not None:
            steps += q * self._slide
        if frame is not None:
            steps[..., 0, :, :, :] = frame @ steps[..., 0, :, :, :]
        for joint in range(1, self.length):
            steps[..., joint, :, :, :] = (
                steps[..., joint - 1, :, :, :] @ steps[..., joint, :, :, :]
            )
        feet = steps[..., -1, :, :, :] @ self.feet
        places = feet[..., :3, 3]
        angular = (steps[..., :3, :3] @ self._axes)[..., 0]
        moving = cross(angular, places[..., None, :, :] - steps[..., :3, 3])
        if self._slide is not None:
            moving = np.where(self._slides[..., None], angular, moving)
            angular = angular * self._turns
        # From (joints, legs, 3) to (legs, 3, joints).
        moving, angular = (each.swapaxes(-3, -2).swapaxes(-2, -1) for each in (moving, angular))
        return Kinematics(places, feet[..., :3, :3], moving, angular, steps)

    def gravity_torques(self, kinematics: Kinematics, gravity: Array) -> Array:
        """Return the joint torques that hold the links of the legs up.

        Parameters
        ----------
        kinematics : Kinematics
            Result of :meth:`solve`, also for several positions.
        gravity : array (3,)
            Acceleration of gravity in the axes of the kinematics, m/s².

        Returns
        -------
        array (..., legs, joints)
            Torques, N m (forces, N, where joints slide).
        """
        frames = kinematics.frames
        axes = (frames[..., :3, :3] @ self._axes)[..., 0]
        centres = (frames @ self._centres)[..., :3, 0]
        torques = np.empty(axes.shape[:-1])
        for joint in range(self.length):
            # Weight of all links from this joint on, and its moment about the joint.
            masses = self._masses[joint:]
            arms = centres[..., joint:, :, :] - frames[..., joint, None, :, :3, 3]
            arms = (arms * masses[..., None]).sum(-3)
            pull = np.where(
                self._slides[joint, :, None],
                masses.sum(0)[:, None] * gravity,
                cross(arms, gravity),
            )
            torques[..., joint, :] = -(axes[..., joint, :, :] * pull).sum(-1)
        return torques.swapaxes(-1, -2)

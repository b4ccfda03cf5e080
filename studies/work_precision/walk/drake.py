# SPDX-License-Identifier: Apache-2.0
"""The robot of L2 in Drake, an engine that shares no code with MuJoCo or with ros_pad's solvers.

Links, masses, servos, gait, floor, films and the laws of spring, damper and resistance of the pads
are the same; rigid-body dynamics and contact are Drake's, with the stiffness and the dissipation
(Hunt and Crossley) of the pads. Drake's own friction is that of a point and has no yaw moment, so
along the ground feet are force elements: a foot shears elastically up to its cap, which sliding
and turning share, as on L1 and L2.
"""

from __future__ import annotations

import importlib
import logging
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.contact import laws
from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.resistance import DOMED
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots.inverse import FeetSolver
from ros_pad.robots.rotation import Array
from ros_pad.simulation.full_robot import TIPPED
from ros_pad.simulation.gait import FootPath
from ros_pad.simulation.mujoco_model import POINT, ROLL_SHARE
from ros_pad.simulation.robot import FootState, Vector
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.servos import LOST
from ros_pad.simulation.soles import CLEAR, LIGHT, LOSS, SLIP_LOAD, SLIP_SPEED
from ros_pad.simulation.terrain import Floor

_SHALLOW = 5e-3  # m above the ground: below it the height of the ground under a foot stays
_THIN = 0.02  # inertia of a rod about its own axis, over that across it, as on L2
STIFFNESS, DAMPING = 1e5, 200.0
"""Of the ground below a towed load, and of feet in shear, N/m and N s/m."""


def _drake(module: str) -> Any:
    try:
        return importlib.import_module(f'pydrake.{module}')
    except ImportError as error:
        raise ConfigError(f'this walk needs Drake ({error}): pip install drake') from error


class DrakeRobot:
    """A robot on a floor, towing a load, as :class:`ros_pad.simulation.full_robot.FullRobot`.

    Parameters
    ----------
    scene : Scene
        A scene with a legged robot that has servos.
    floor : Floor
    period : float
        Time between set-points, s.
    step : float
        Step of Drake, s; a period is a whole number of steps.
    pressure : float
        Gauge pressure of all pads, Pa.

    Raises
    ------
    ConfigError
        When Drake is missing.
    """

    def __init__(
        self, scene: Scene, floor: Floor, period: float, step: float, pressure: float
    ) -> None:
        body: Any = scene.body
        self._body = body
        self.legs, self.period, self.time = scene.legs, period, 0.0
        self.verdict: str | None = None
        self.feet = [FootState() for _ in self.legs]
        self._scene, self._floor = scene, floor
        self._robot, self._servo = body.robot, body.robot.servo
        self._substeps = round(period / step)
        self._dt = period / self._substeps
        self._steps = 0
        self._foot = scene.foot.on_rough(scene.floor.roughness)
        self._lever, self._pressure = self._foot.turning_radius, pressure
        place = DOMED * self._foot.ceiling / self._foot.limit_cell
        inertial = scene.expected_load * GRAVITY
        self._loss = LOSS * math.sqrt(laws.between(self._foot.stiffnesses, place) / inertial)
        self._films = [Film(self._foot, scene.floor.viscosity) for _ in self.legs]
        self._solver = FeetSolver(body.robot)
        gait: Any = scene.gait
        self._path = FootPath(gait, [(x, y, body.ground) for x, y in body.homes])
        self._tools()
        self._build()
        self._place()

    def _tools(self) -> None:
        self._math, self._tree = _drake('math'), _drake('multibody.tree')
        self._plants = _drake('multibody.plant')
        self._framework, self._geometry = _drake('systems.framework'), _drake('geometry')
        logging.getLogger('drake').setLevel(logging.ERROR)  # half-spaces do not deform: as wanted

    # --- model --------------------------------------------------------------------------------

    def _build(self) -> None:
        scene, tree = self._scene, self._tree
        builder = self._framework.DiagramBuilder()
        self._plant, graph = self._plants.AddMultibodyPlantSceneGraph(builder, self._dt)
        plant, slope = self._plant, scene.floor.slope
        plant.set_contact_model(self._plants.ContactModel.kPoint)
        plant.set_discrete_contact_approximation(self._plants.DiscreteContactApproximation.kLagged)
        plant.mutable_gravity_field().set_gravity_vector(
            [-GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope)]
        )
        self._trunk = plant.AddRigidBody(
            'trunk', tree.SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1)
        )
        self._joints: list[Any] = []
        self._blocks: list[Any] = []  # joints on which the ground below a foot moves up and down
        self._grounds: list[list[Any]] = []  # shapes that may touch each other
        if self._floor.heights is None:
            self._add_ground(plant.world_body())
        self._tips = [self._add_leg(leg) for leg in range(len(self.legs))]
        if scene.tow.weight:
            self._add_sled()
        plant.Finalize()
        rules, some = self._geometry.CollisionFilterDeclaration(), self._geometry.GeometrySet
        for number, ground in enumerate(self._grounds):
            for other in self._grounds[:number]:  # a foot touches its own ground only
                rules.ExcludeBetween(some(ground), some(other))
        graph.collision_filter_manager().Apply(rules)
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self._context = plant.GetMyMutableContextFromRoot(self._root)
        self._places = np.array([joint.position_start() for joint in self._joints])
        self._speeds = np.array([joint.velocity_start() for joint in self._joints])
        self._weigh_trunk()

    def _transform(self, frame: Array) -> Any:
        turn = self._math.RotationMatrix.ProjectToRotationMatrix(frame[:3, :3])
        return self._math.RigidTransform(turn, frame[:3, 3])

    def _add_leg(self, leg: int) -> Any:
        """Add links, joints and motors of a leg; return the frame of its foot."""
        plant, tree, robot, servo = self._plant, self._tree, self._robot, self._servo
        joints, tip = robot.chains.legs[leg], robot.chains.feet[leg]
        scale, parent = self._body.mass / robot.mass, self._trunk
        for place, joint in enumerate(joints):
            end = joints[place + 1].at[:3, 3] if place + 1 < len(joints) else tip[:3, 3]
            length = float(np.linalg.norm(end))
            mass = scale * joint.mass
            inertia = mass * length**2 / 12.0 * _rod(end / length, tree)
            rod = tree.SpatialInertia.MakeFromCentralInertia(mass, joint.centre, inertia)
            link = plant.AddRigidBody(f'{joint.name}_body', rod)
            base = tree.FixedOffsetFrame(f'{joint.name}_base', parent, self._transform(joint.at))
            kind = tree.PrismaticJoint if joint.slides else tree.RevoluteJoint
            added = plant.AddJoint(
                kind(
                    joint.name, plant.AddFrame(base), link.body_frame(), joint.axis,
                    damping=servo.damping,
                )
            )  # fmt: skip
            motor = plant.AddJointActuator(f'{joint.name}_motor', added)
            motor.set_default_rotor_inertia(joint.rotor_inertia)
            motor.set_default_gear_ratio(1.0)
            self._joints.append(added)
            parent = link
        self._add_point(leg, parent, tip)
        return plant.AddFrame(tree.FixedOffsetFrame(f'foot_{leg}', parent, self._transform(tip)))

    def _add_point(self, leg: int, link: Any, tip: Array) -> None:
        """Add the point of a foot, and on uneven floors the ground below it.

        The point is rigid: the ground has all of the compliance.
        """
        plant, tree, shape = self._plant, self._tree, self._geometry.Sphere(POINT)
        if self._floor.heights is not None:
            cube = tree.SpatialInertia.SolidBoxWithMass(1.0, 1.0, 1.0, 1.0)
            block = plant.AddRigidBody(f'block_{leg}', cube)
            frames = plant.world_frame(), block.body_frame()
            joint = tree.PrismaticJoint(f'block_{leg}', *frames, np.eye(3)[2])
            self._blocks.append(plant.AddJoint(joint))
            self._add_ground(block)
        point = plant.RegisterCollisionGeometry(
            link, self._transform(tip), shape, f'point_{leg}', self._material(1e12)
        )
        self._grounds[-1].append(point)

    def _material(self, stiffness: float) -> Any:
        """Return what Drake's contact has to know of a surface; its own friction is off."""
        material, none = self._geometry.ProximityProperties(), self._plants.CoulombFriction()
        self._geometry.AddContactMaterial(material, self._loss, stiffness, none)
        return material

    def _add_ground(self, body: Any) -> None:
        """Add the ground: from its surface on as stiff as the pads, deeper down as the sole."""
        foot, sole, self._grounds = self._foot, self._foot.sole_stiffness, [*self._grounds, []]
        stiffness = laws.spring(foot, 0.0, self._pressure)[1]
        layers = [(0.0, stiffness)]
        if stiffness < sole:
            down = foot.dome_load(math.inf, self._pressure) / stiffness
            layers.append((down, sole - stiffness))
        for depth, more in layers:
            pose = self._math.RigidTransform([0.0, 0.0, -depth - POINT])
            given = self._geometry.HalfSpace(), f'{body.name()}, {depth:g} m', self._material(more)
            self._grounds[-1].append(self._plant.RegisterCollisionGeometry(body, pose, *given))

    def _add_sled(self) -> None:
        """Add the towed load: a point that does not turn."""
        tow, tree, parent = self._scene.tow, self._tree, self._plant.world_body()
        for axis, mass in ((0, 0.0), (1, 0.0), (2, tow.weight / GRAVITY)):
            cube = tree.SpatialInertia.SolidBoxWithMass(mass, 0.05, 0.05, 0.05) if mass else None
            link = self._plant.AddRigidBody(f'sled_{axis}', cube or tree.SpatialInertia.Zero())
            frames = parent.body_frame(), link.body_frame()
            self._plant.AddJoint(tree.PrismaticJoint(f'sled_{axis}', *frames, np.eye(3)[axis]))
            parent = link
        self._sled = parent

    def _weigh_trunk(self) -> None:
        """Give the trunk what the scene's robot has more than the legs: mass, place, inertia."""
        plant, context, tree, body = self._plant, self._context, self._tree, self._body
        self._set_joints(self._robot.home.ravel())
        plant.SetFreeBodyPose(context, self._trunk, self._math.RigidTransform())
        links = [joint.child_body().index() for joint in self._joints]
        frame = plant.world_frame()
        legs = plant.CalcSpatialInertia(context, frame, links)
        centre = np.array([*self._robot.centre, body.height + body.ground])
        mass = body.mass - legs.get_mass()
        at = (body.mass * centre - legs.get_mass() * legs.get_com()) / mass
        about = legs.Shift(centre).CalcRotationalInertia().get_moments()[2]
        away = at - centre
        yaw = body.inertia - about - mass * float(away[:2] @ away[:2])
        moments = tree.RotationalInertia(ROLL_SHARE * yaw, ROLL_SHARE * yaw, yaw)
        trunk = tree.SpatialInertia.MakeFromCentralInertia(mass, at, moments)
        self._trunk.SetSpatialInertiaInBodyFrame(context, trunk)

    # --- state --------------------------------------------------------------------------------

    def _set_joints(self, angles: Array) -> None:
        positions = self._plant.GetPositions(self._context)
        positions[self._places] = angles
        self._plant.SetPositions(self._context, positions)

    def _place(self) -> None:
        """Place the robot at rest on its planned feet, and the load behind it."""
        plant, context, scene = self._plant, self._context, self._scene
        low = self._body.ground
        feet = self._path.feet
        self._targets = np.array(self._solver.angles([(x, y, low) for x, y, _ in feet]))
        self._ground = np.array([self._floor.height(x, y) for x, y, _ in feet])
        for block, height in zip(self._blocks, self._ground.tolist(), strict=False):
            block.set_translation(context, height)
            block.Lock(context)
        plant.SetFreeBodyPose(
            context, self._trunk, self._math.RigidTransform([0.0, 0.0, self._ground.max() - low])
        )
        self._set_joints(self._targets)
        count = len(feet) + bool(scene.tow.weight)
        self._shear = np.zeros((count, 3))
        self._loads = np.zeros(count)
        self._ratios = np.zeros(count)  # coefficients of friction
        if scene.tow.weight:
            plant.GetJointByName('sled_0').set_translation(context, -scene.tow.distance)
        for film, state, (x, y, _) in zip(self._films, self.feet, feet, strict=True):
            film.touch_down(self._floor.depth(x, y))
            state.wet = self._floor.wet(x, y)
        self._motors = plant.get_actuation_input_port().FixValue(
            context, np.zeros(len(self._targets))
        )
        self._forces = plant.get_applied_generalized_force_input_port().FixValue(
            context, np.zeros(plant.num_velocities())
        )
        self._simulator = _drake('systems.analysis').Simulator(self._diagram, self._root)
        self._simulator.Initialize()
        self._last = self._tip_places() - self._shear[: len(feet), :2]

    def _tip_places(self) -> Array:
        places = [tip.CalcPoseInWorld(self._context).translation() for tip in self._tips]
        self._heights = np.array([place[2] for place in places])
        return np.array(places)[:, :2]

    @property
    def body(self) -> Vector:
        """Position x, y, m, and heading, rad, of the body in the world."""
        pose = self._trunk.EvalPoseInWorld(self._context)
        turn = pose.rotation().matrix()
        x, y, _ = pose.translation()
        return float(x), float(y), math.atan2(turn[1, 0], turn[0, 0])

    # --- step ---------------------------------------------------------------------------------

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by ``period`` with these gauge pressures, Pa, one for each leg."""
        self._steps += 1
        self.time = self._steps * self.period
        self._limits = [self._foot.dome_load(math.inf, each) for each in pressures]
        self._pressures = pressures
        self._aim()
        context, plant, servo = self._context, self._plant, self._servo
        start = (self._steps - 1) * self.period
        for number in range(1, self._substeps + 1):
            angles = plant.GetPositions(context)[self._places]
            torque = servo.stiffness * (self._targets - angles)
            most = self._robot.chains.legs[0][0].torque
            self._motors.GetMutableData().get_mutable_value().SetFromVector(
                np.clip(torque, -most, most)
            )
            self._push()
            self._simulator.AdvanceTo(start + number * self._dt)
        self._update_feet()

    def _aim(self) -> None:
        scene = self._scene
        turn = -scene.heading_gain * self.body[2] * self.period
        self._path.move(max(0.0, self.time - scene.settle), turn)
        try:
            self._targets = np.array(self._solver.angles(self._path.feet))
        except InvalidInput as error:
            self._end(str(error))

    def _coefficient(self, index: int, load: float, drained: float) -> float:
        """Return the coefficient of a foot whose film has drained for a time, s."""
        load, limit, pressure = max(load, LIGHT), self._limits[index], self._pressures[index]
        on_domes = min(load, limit)
        films = (0.0, 0.0)
        if self.feet[index].wet:
            films = self._films[index].drain(on_domes, load - on_domes, pressure, drained)
        return laws.resistance(self._foot, on_domes, load - on_domes, pressure, *films) / load

    def _push(self) -> None:
        """Set the forces of line and bristles for the next step."""
        force = np.zeros(self._plant.num_velocities())
        if self._scene.tow.weight:
            self._pull(force)
        self._press(force)
        self._forces.GetMutableData().get_mutable_value().SetFromVector(force)

    def _jacobian(self, frame: Any, at: Vector = (0.0, 0.0, 0.0)) -> Array:
        world = self._plant.world_frame()
        return np.asarray(
            self._plant.CalcJacobianSpatialVelocity(
                self._context, self._tree.JacobianWrtVariable.kV, frame, at, world, world
            )
        )

    def _pull(self, force: Array) -> None:
        """Add the force of the line, which only pulls."""
        tow, plant, context = self._scene.tow, self._plant, self._context
        hook = (0.0, 0.0, tow.height + self._body.ground)
        ends = (self._trunk.body_frame(), hook), (self._sled.body_frame(), (0.0, 0.0, tow.height))
        world = plant.world_frame()
        a, b = (plant.CalcPointsPositions(context, frame, at, world)[:, 0] for frame, at in ends)
        length = float(np.linalg.norm(b - a))
        if length > tow.distance:
            pull = tow.stiffness * (length - tow.distance) / length * (b - a)
            force += self._jacobian(*ends[0])[3:].T @ pull - self._jacobian(*ends[1])[3:].T @ pull

    def _sled_friction(self, place: Array) -> float:
        tow = self._scene.tow
        return tow.friction_wet if self._floor.wet(place[0], place[1]) else tow.friction_dry

    def _press(self, force: Array) -> None:
        """Add the forces of bristles up to the cap, and what presses the sled."""
        plant, context, count = self._plant, self._context, len(self._tips)
        frames = [*self._tips, *([self._sled.body_frame()] if len(self._loads) > count else [])]
        jacobians = np.array([self._jacobian(frame)[2:] for frame in frames])  # yaw, x, y, z
        speeds = jacobians @ plant.GetVelocities(context)
        places = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
        loads = -STIFFNESS * places[:, 2] - DAMPING * speeds[:, 3]  # of the sled
        loads = np.where(places[:, 2] < 0.0, np.maximum(loads, 0.0), 0.0)
        for index, depth in enumerate((self._ground - places[:count, 2]).tolist()):
            spring, _ = laws.spring(self._foot, max(0.0, depth), self._pressure)
            loads[index] = spring * max(0.0, 1.0 - self._loss * speeds[index, 3])
        levers = np.full(len(frames), self._lever)
        levers[count:] = 0.0
        slides = np.column_stack([speeds[:, 1:3], levers * speeds[:, 0]])
        self._shear += self._dt * slides
        push = -STIFFNESS * self._shear - DAMPING * slides
        for index in np.flatnonzero(loads).tolist():
            self._ratios[index] = (
                self._coefficient(index, loads[index], self._dt)
                if index < count
                else self._sled_friction(places[index])
            )
        caps = self._ratios * loads
        size = np.linalg.norm(push, axis=1)
        slips = size > caps
        push[slips] *= (caps[slips] / np.maximum(size[slips], 1e-30))[:, None]
        self._shear[slips] = -push[slips] / STIFFNESS
        wrench = np.column_stack([levers * push[:, 2], push[:, :2], loads])
        wrench[:count, 3] = 0.0  # Drake's contact presses the feet
        force += np.einsum('ijk,ij->k', jacobians, wrench)
        self._loads = loads

    def _update_feet(self) -> None:
        """Count slip as L2 does, and prepare film and ground below feet in the air."""
        count = len(self._tips)
        places = self._tip_places() - self._shear[:count, :2]  # bristles lag behind the foot
        moved = np.linalg.norm(places - self._last, axis=1)
        self._last = places
        for index, state in enumerate(self.feet):
            x, y = places[index]
            state.wet = self._floor.wet(x, y)
            above = self._heights[index] - self._ground[index]
            if self._loads[index] <= LIGHT:
                if above > _SHALLOW and self._ground[index] != self._floor.height(x, y):
                    self._ground[index] = self._floor.height(x, y)
                    self._blocks[index].set_translation(self._context, self._ground[index])
                if above > CLEAR:
                    self._films[index].touch_down(self._floor.depth(x, y))
            elif self._loads[index] > SLIP_LOAD and moved[index] > SLIP_SPEED * self.period:
                state.slip_path += float(moved[index])
        angles = self._plant.GetPositions(self._context)[self._places]
        up = self._trunk.EvalPoseInWorld(self._context).rotation().matrix()[2, 2]
        if not up > math.cos(TIPPED):
            self._end('tip-over')
        elif np.abs(self._targets - angles).max() > LOST:
            self._end('a servo is far off its set-point')

    def _end(self, why: str) -> None:
        if self.verdict is None:
            self.verdict = f'{why}, at {self.time:.3f} s'


def _rod(along: Array, tree: Any) -> Any:
    """Return the inertia of a rod along a unit vector, over that across it."""
    about = np.eye(3) - (1.0 - _THIN) * np.outer(along, along)
    a, b, c, d, e, f = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return tree.RotationalInertia(a, b, c, d, e, f)

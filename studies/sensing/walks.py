# SPDX-License-Identifier: Apache-2.0
"""Logs of simulated walks: what IMU, joints and feet measure, and the truth beside it."""

from __future__ import annotations

import pathlib
import re
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from ros_pad.robots import Gait, Robot
from ros_pad.robots.rotation import Array, from_rpy, matrix, quaternion
from ros_pad.simulation.mujoco_model import at_frame, words

RATE = 250.0  # samples a second, where a course has no other
SUBSTEPS = 4  # steps of MuJoCo in each of them
REST = 2.0  # s at rest before the walk
GRAVITY = np.array((0.0, 0.0, -9.81))  # m/s²
SETTLE = 1.0  # s before the log, in which the robot comes to rest on its feet
RAMP = 1.0  # s until the full stride
PATCH = 0.4  # m, edge of the squares of a floor
START_FRICTION = 0.7  # of the ground at rest
POINT = 1e-4  # m, radius of the ball that stands for a foot that does not roll


class Noise(NamedTuple):
    """Standard deviations of the sensors, and the bias of gyro and accelerometer, SI units."""

    gyro: float = 0.005
    accelerometer: float = 0.05
    encoder: float = 5e-4
    velocity: float = 0.03
    force: float = 0.3
    effort: float = 0.05
    gyro_bias: float = 0.01
    accelerometer_bias: float = 0.05


class Drive(NamedTuple):
    """Speed of a walk, m/s, and servos: stiffness, damping, largest torque, rotor inertia."""

    speed: float
    stiffness: float
    damping: float
    torque: float
    armature: float


HEAVY = Noise(gyro=0.02, accelerometer=0.3, accelerometer_bias=0.2)
"""Noise of a cheap IMU."""

DRIVES = {
    'go2': Drive(0.3, 80.0, 3.0, 40.0, 0.01),
    'ch3r': Drive(0.13, 18.8, 0.18, 0.94, 2e-3),
    'go2_sim': Drive(0.3, 80.0, 3.0, 45.0, 0.01),
}
REFERENCE = pathlib.Path(__file__).resolve().parents[2] / 'test' / 'reference'
RECORDED = 'independent walk'
REFERENCE_LEGS = ('FL', 'FR', 'RL', 'RR')


@dataclass(frozen=True)
class Course:
    """What is walked, where, and how it is measured.

    Attributes
    ----------
    robot : str
        ``go2`` or ``ch3r``, or ``go2_sim``: the model of the independent walk in test/reference.
    floor : str
        ``dry``, ``patches`` or ``ice``; ``recorded`` for the independent walk itself, 20 s.
    push : float
        Length of a push of the trunk, s.
    rate : float
        Samples a second, Hz.
    noise : Noise
    """

    robot: str = 'go2'
    floor: str = 'dry'
    push: float = 0.1
    rate: float = RATE
    noise: Noise = field(default_factory=Noise)


@dataclass
class Log:
    """Samples of a walk, one row each. Base axes but for ``gyro`` and ``accelerometer`` (IMU).

    The truth is in axes with z up and x along the first heading: ``position``, ``orientation``
    (x y z w), ``velocity`` of the base, ``feet`` (centres of the spheres), ``slip`` (velocity of
    the contact points, x and y), ``load`` (normal forces).
    """

    time: Array
    gyro: Array
    accelerometer: Array
    joint_positions: Array
    joint_velocities: Array
    foot_forces: Array
    efforts: Array
    position: Array
    orientation: Array
    velocity: Array
    feet: Array
    slip: Array
    load: Array


def robot_of(name: str) -> Robot:
    """Return the robot of a course."""
    if name != 'go2_sim':
        return Robot.load(name)
    feet = [f'{leg}_foot' for leg in REFERENCE_LEGS]
    robot = Robot.load(REFERENCE / 'go2_sim.urdf', feet, 'imu', 0.022)
    ours = Robot.load('go2')
    return replace(robot, gait=ours.gait, home=ours.home)


def foreign(robot: Robot, drive: Drive) -> str:
    """Return the model of others in test/reference, with position servos for its motors."""
    servos = ''.join(
        f'<position joint="{name}" kp="{drive.stiffness}" kv="{drive.damping}"'
        f' forcerange="{-drive.torque} {drive.torque}"/>'
        for name in robot.joint_names
    )
    text = (REFERENCE / 'go2_sim.xml').read_text()
    for index, leg in enumerate(REFERENCE_LEGS):
        text = text.replace(f'geom name="{leg}"', f'geom name="foot_{index}"')
    return re.sub('<actuator>.*</actuator>', f'<actuator>{servos}</actuator>', text)


def recorded() -> Log:
    """Return the independent walk in test/reference, whose first heading is x."""
    data = np.load(REFERENCE / 'quad_dry.npz')
    w, x, y, z = data['truth_base_quat_wxyz'].T
    orientation = np.stack([x, y, z, w], axis=1)
    turns = np.array([matrix(each) for each in orientation])

    def of(name: str) -> Array:
        return np.asarray(data[name], dtype=float)

    return Log(
        time=of('time'),
        gyro=of('imu_gyro'),
        accelerometer=of('imu_acc'),
        joint_positions=of('joint_pos'),
        joint_velocities=of('joint_vel'),
        foot_forces=of('foot_force_world') @ turns,
        efforts=np.full_like(of('joint_pos'), np.nan),
        position=of('truth_base_pos'),
        orientation=orientation,
        velocity=of('truth_base_vel_world'),
        feet=of('truth_foot_pos'),
        slip=of('truth_contact_vel')[..., :2],
        load=of('truth_force_world')[..., 2],
    )


def model_of(robot: Robot, course: Course) -> str:
    """Return a robot on a floor, one plane for each foot, in MuJoCo's XML."""
    drive = DRIVES[course.robot]
    if course.robot == 'go2_sim':
        return foreign(robot, drive)
    trees, pairs, servos = [], [], []
    carried = 0.0
    for index, joints in enumerate(robot.chains.legs):
        tree, ends = '', ''
        for joint in joints:
            carried += joint.mass
            # Links are taken for rods of 0.2 m in every direction: enough for test data.
            inertia = max(joint.mass * 0.2**2 / 12.0, 1e-6)
            tree += (
                f'<body {at_frame(joint.at)}><joint name="{joint.name}" axis="{words(joint.axis)}"'
                f' damping="{0.1 * drive.damping}" armature="{drive.armature}"/>'
                f'<inertial mass="{max(joint.mass, 1e-6)!r}" pos="{words(joint.centre)}"'
                f' diaginertia="{inertia} {inertia} {inertia}"/>'
            )
            ends += '</body>'
            servos.append(
                f'<position joint="{joint.name}" kp="{drive.stiffness}" kv="{drive.damping}"'
                f' forcerange="{-drive.torque} {drive.torque}"/>'
            )
        place = words(robot.chains.feet[index, :3, 3])
        size = robot.foot_radius or POINT
        trees.append(f'{tree}<geom name="foot_{index}" size="{size}" pos="{place}"/>{ends}')
        pairs.append(
            f'<pair name="foot_{index}" geom1="floor_{index}" geom2="foot_{index}" condim="3"/>'
        )
    trunk = robot.mass - carried
    span = np.ptp(robot.hips, axis=0)[:2]
    roll, pitch = trunk / 12.0 * (span[::-1] ** 2 + 0.1**2)
    yaw = trunk / 12.0 * float(span @ span)
    planes = ''.join(
        f'<geom name="floor_{index}" type="plane" size="0 0 1"/>' for index in range(len(trees))
    )
    return f"""
<mujoco>
  <option timestep="{1.0 / course.rate / SUBSTEPS}" integrator="implicitfast" cone="elliptic"
          impratio="100" gravity="{words(GRAVITY)}"/>
  <default><geom contype="0" conaffinity="0"/><pair solref="0.02 1"/></default>
  <worldbody>{planes}
    <body name="base"><freejoint/>
      <inertial mass="{trunk!r}" pos="0 0 0" diaginertia="{roll} {pitch} {yaw}"/>
      <site name="imu" {at_frame(robot.imu)}/>{''.join(trees)}
    </body>
  </worldbody>
  <contact>{''.join(pairs)}</contact>
  <actuator>{''.join(servos)}</actuator>
  <sensor><gyro site="imu"/></sensor>
</mujoco>
"""


class Floor:
    """Friction of a floor in squares: dry 0.6 to 0.8, slippery 0.08 to 0.2; all of ice 0.08."""

    def __init__(self, kind: str, generator: np.random.Generator) -> None:
        count = 200
        dry, wet = (
            generator.uniform(0.6, 0.8, (count, count)),
            generator.uniform(0.08, 0.2, (count, count)),
        )
        share = {'dry': 0.0, 'patches': 0.4, 'ice': 1.0}[kind]
        self._values = np.where(generator.random((count, count)) < share, wet, dry).tolist()
        self._count = count

    def friction(self, x: float, y: float) -> float:
        """Return the coefficient at a place, m."""
        row, column = int(x // PATCH) % self._count, int(y // PATCH) % self._count
        return float(self._values[row][column])


def foot_targets(gait: Gait, home: Array, velocity: Array, time: float, size: float) -> Array:
    """Return places of the feet in the base, (legs, 3), m, at a time of the gait, s.

    ``velocity`` is that of the body over each foot, (legs, 2), m/s, ``size`` a factor on motion.
    """
    phase = gait.phase(time)
    rest = np.maximum(phase - gait.duty, 0.0) / (1.0 - gait.duty)
    ahead = np.where(phase < gait.duty, 0.5 - phase / gait.duty, -0.5 * np.cos(np.pi * rest))
    feet = home.copy()
    feet[:, :2] += (size * gait.duty * gait.cycle * ahead)[:, None] * velocity
    feet[:, 2] += size * gait.lift * np.sin(np.pi * rest) ** 2
    return feet


class _Pushes:
    """Pushes of the trunk in any direction, with pauses between them."""

    def __init__(self, length: float, weight: float, generator: np.random.Generator) -> None:
        self._length, self._weight, self._generator = length, weight, generator
        self._next, self._end, self._force = 0.0, 0.0, np.zeros(2)

    def force(self, time: float) -> Array:
        """Return the force at a time, (2,), N."""
        draw = self._generator.uniform
        if time > self._next:
            self._next = time + max(draw(0.4, 1.0), 1.5 * self._length)
            size, angle = draw(0.06, 0.12) * self._weight, draw(0.0, 2.0 * np.pi)
            self._force = size * np.array((np.cos(angle), np.sin(angle)))
            self._end = time + self._length
        return self._force if time < self._end else np.zeros(2)


def walk(course: Course, seed: int, duration: float) -> Log:
    """Simulate a walk of a robot with pushes of the trunk, or read the independent one.

    Parameters
    ----------
    course : Course
        What is walked, where, and how it is measured.
    seed : int
        Of floor, pushes and noise.
    duration : float
        Length of the log, s, with :data:`REST` s at rest first.
    """
    import mujoco

    if course.floor == 'recorded':
        return recorded()
    robot, drive = robot_of(course.robot), DRIVES[course.robot]
    gait = robot.gait
    assert gait is not None
    generator = np.random.default_rng(seed)
    ground = Floor(course.floor, generator)
    model: Any = mujoco.MjModel.from_xml_string(model_of(robot, course))
    data: Any = mujoco.MjData(model)
    home = robot.foot_positions(robot.home)
    q = robot.joint_positions(home)
    # Feet that stand on the ground go backwards under the body.
    velocity = np.tile((drive.speed, 0.0), (len(home), 1))
    aim = q.ravel()
    data.qpos[2] = -home[:, 2].mean() + (robot.foot_radius or POINT)
    data.qpos[7:] = data.ctrl[:] = aim
    feet = [model.geom(f'foot_{index}').id for index in range(len(robot.legs))]
    rows: dict[str, list[Any]] = {each.name: [] for each in fields(Log)}
    pushes = _Pushes(course.push, robot.mass * 9.81, generator)
    for _ in range(round(SETTLE * course.rate * SUBSTEPS)):
        mujoco.mj_step(model, data)
    speed = _imu_velocity(robot, data)
    for tick in range(round(duration * course.rate)):
        time = tick / course.rate
        if time > REST:
            size = min(1.0, (time - REST) / RAMP)
            goal = foot_targets(gait, home, velocity, time - REST, size)
            before, q = q, robot.joint_positions(goal, near=q)
            # Set-points lead by what servos need for their damping and for the robot's weight.
            stands = gait.stands(time - REST)
            share = np.where(stands, robot.mass * 9.81 / max(stands.sum(), 1), 0.0)
            torque = -share[:, None] * robot.kinematics(q).jacobians[:, 2]
            torque += 1.1 * drive.damping * (q - before) * course.rate
            aim = (q + torque / drive.stiffness).ravel()
            data.xfrc_applied[1, :2] = pushes.force(time)
        # Servos follow a line between set-points: steps in time with the samples would alias.
        change = (aim - data.ctrl) / SUBSTEPS
        for _ in range(SUBSTEPS):
            data.ctrl += change
            for index, geom in enumerate(feet):
                x, y, _ = data.geom_xpos[geom].tolist()
                grip = ground.friction(x, y) if time > REST else START_FRICTION
                if model.npair:
                    model.pair_friction[index, :2] = grip
                else:
                    model.geom_friction[geom, 0] = grip
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)  # all readings are of this moment
        _read(mujoco, model, data, feet, rows)
        # Accelerometers average. MuJoCo's own is of an explicit step, not of this implicit one.
        speed, last = _imu_velocity(robot, data), speed
        acceleration = (speed - last) * course.rate
        rows['accelerometer'].append(_specific_force(robot, model, rows, acceleration))
        rows['time'].append(time)
    log = Log(**{key: np.array(value) for key, value in rows.items()})
    return _noisy(_levelled(log), generator, course.noise)


def _levelled(log: Log) -> Log:
    """Return a log whose truth is in axes with x along the first heading."""
    first = matrix(log.orientation[0])
    level = from_rpy((0.0, 0.0, -np.arctan2(first[1, 0], first[0, 0])))
    for name in ('position', 'velocity', 'feet'):
        setattr(log, name, getattr(log, name) @ level.T)
    log.slip = log.slip @ level[:2, :2].T
    log.orientation = np.array([quaternion(level @ matrix(turn)) for turn in log.orientation])
    return log


def _imu_velocity(robot: Robot, data: Any) -> Array:
    """Return the velocity of the IMU in the world, m/s."""
    turn = matrix(data.qpos[[4, 5, 6, 3]])
    return data.qvel[:3] + turn @ np.cross(data.qvel[3:6], robot.imu[:3, 3])


def _specific_force(
    robot: Robot, model: Any, rows: dict[str, list[Any]], acceleration: Array
) -> Array:
    """Return what an accelerometer shows for an acceleration, m/s²."""
    x, y, z, w = rows['orientation'][-1]
    felt = acceleration - model.opt.gravity
    return np.asarray(felt @ matrix((x, y, z, w)) @ robot.imu[:3, :3])


def _read(mujoco: Any, model: Any, data: Any, feet: list[int], rows: dict[str, list[Any]]) -> None:
    """Append the state of the simulation to the rows of a log, without noise."""
    turn = data.xmat[1].reshape(3, 3)
    forces = np.zeros((len(feet), 3))
    found = np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        mujoco.mj_contactForce(model, data, index, found)
        forces[feet.index(contact.geom2)] += contact.frame.reshape(3, 3).T @ found[:3]
    slips = []
    for geom in feet:
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, found, 0)
        # MuJoCo's contact point is in the middle of the penetration, from which feet roll.
        radius, height = model.geom_size[geom, 0], data.geom_xpos[geom, 2]
        lever = np.array((0.0, 0.0, -min(radius, 0.5 * (radius + height))))
        slips.append((found[3:] + np.cross(found[:3], lever))[:2])
    w, x, y, z = data.qpos[3:7]
    rows['gyro'].append(data.sensordata[:3].copy())
    rows['joint_positions'].append(data.qpos[7:].copy())
    rows['joint_velocities'].append(data.qvel[6:].copy())
    rows['foot_forces'].append(forces @ turn)
    rows['efforts'].append(data.qfrc_actuator[6:].copy())
    rows['position'].append(data.qpos[:3].copy())
    rows['orientation'].append(np.array((x, y, z, w)))
    rows['velocity'].append(data.qvel[:3].copy())
    rows['feet'].append(data.geom_xpos[feet].copy())
    rows['slip'].append(np.array(slips))
    rows['load'].append(forces[:, 2])


def _noisy(log: Log, generator: np.random.Generator, noise: Noise) -> Log:
    """Return a log with noise and bias on what sensors measure."""

    def white(values: Array, deviation: float) -> Array:
        return values + deviation * generator.standard_normal(values.shape)

    def biased(values: Array, deviation: float, bias: float) -> Array:
        line = generator.standard_normal(3)
        return white(values, deviation) + bias * line / np.linalg.norm(line)

    log.gyro = biased(log.gyro, noise.gyro, noise.gyro_bias)
    log.accelerometer = biased(log.accelerometer, noise.accelerometer, noise.accelerometer_bias)
    log.joint_positions = white(log.joint_positions, noise.encoder)
    log.joint_velocities = white(log.joint_velocities, noise.velocity)
    log.foot_forces = white(log.foot_forces, noise.force)
    log.efforts = white(log.efforts, noise.effort)
    return log


COURSES = {
    'dry': Course(),
    'patches': Course(floor='patches'),
    'ice': Course(floor='ice'),
    'hexapod': Course('ch3r', 'patches'),
    'long pushes, ice': Course(floor='ice', push=0.6),
    RECORDED: Course('go2_sim', 'recorded'),
    'model of others, dry': Course('go2_sim'),
    'model of others, patches': Course('go2_sim', 'patches'),
    'model of others, ice': Course('go2_sim', 'ice'),
    'cheap IMU': Course(floor='patches', noise=HEAVY),
}
"""The walks of the study; constants of the estimator were chosen on seeds below 114."""

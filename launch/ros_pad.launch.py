# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of ros_pad, each in a separate process, in real time.

``ros2 launch ros_pad ros_pad.launch.py --show-args`` lists the arguments. Everything else is set
in ``params_file``: backend and ceiling of the regulators, foot, load, policy.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch.utilities.type_utils import perform_typed_substitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from ros_pad.configuration import shared_folder
from ros_pad.simulation.scene import Scene

ARGUMENTS = {
    'namespace': ('', 'Namespace of every node and topic, such as robot_1; empty: none. [text]'),
    'params_file': (
        '',
        'File with the parameters of the nodes in SI units, a copy of config/params.yaml; empty:'
        ' config/params.yaml itself. [path]',
    ),
    'simulate': ('true', 'Start a simulator; false for a real robot. [true, false]'),
    'scene': (
        '',
        'Scene of the simulator, whose hose and faults simulated regulators have too; its legs,'
        ' foot and load are those of the other nodes; empty: the scenes in params_file.'
        ' [name or path]',
    ),
    'sensing': (
        'markers',
        'What slip is estimated from: markers, or joints, IMU and forces in the axes of the feet,'
        ' for which a body estimator is started. [markers, joints]',
    ),
    'merge': (
        '',
        'Join what drivers publish by leg (leg_i/wrench, leg_i/position, leg_i/pressure) into'
        ' records; empty: where nothing is simulated. [true, false]',
    ),
    'views': (
        'false',
        'Publish single legs of records (leg_i/wetness, leg_i/pressure_setpoint and others) and'
        ' markers of the feet, for people and for drivers. [true, false]',
    ),
    'record': ('true', 'Record every topic into a bag. [true, false]'),
    'folder': (
        '',
        'Folder of the bag, which must not exist; empty: the folder in params_file or, if that is'
        ' empty too, a new one where launch was called, named after the time. [path]',
    ),
    'use_sim_time': (
        'false',
        'Use the time of /clock, which the simulator then publishes. With other backends than'
        ' simulated, the regulator node refuses it. [true, false]',
    ),
}
"""Default and description of each launch argument."""


VIEWS_BESIDE_DRIVERS = (
    'contact_velocity, pressure_setpoint, slip, slipping, wetness, friction, friction_margin,'
    ' contact_load, doubt, morphology'
)
"""Topics of the node views where drivers publish wrench, position and pressure of each leg."""


def generate_launch_description() -> LaunchDescription:
    """Return the launch description."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes that the arguments select."""

    def text(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def flag(name: str) -> bool:
        return perform_typed_substitution(context, [LaunchConfiguration(name)], bool)

    def node(executable: str, **parameters: object) -> Node:
        return Node(
            package='ros_pad',
            executable=executable,
            namespace=text('namespace'),
            # Later values replace earlier ones; an empty argument keeps the value of the file.
            parameters=[
                text('params_file') or str(shared_folder() / 'params.yaml'),
                {
                    # '1' stays text
                    name: value
                    if isinstance(value, list)
                    else ParameterValue(value, value_type=type(value))
                    for name, value in parameters.items()
                    if value != ''
                },
            ],
            output='screen',
        )

    use_sim_time, simulate = flag('use_sim_time'), flag('simulate')
    scene, sensing = text('scene'), text('sensing')
    joints = sensing == 'joints'
    # The parameters of the file stay in force where sensing is markers, the default.
    estimator = {'source': sensing} if joints else {}
    simulator = {'sensing': sensing} if joints else {}
    if joints and simulate:
        estimator['pads_shear'] = False  # joints of simulated robots are those of rigid feet
    # The other nodes take the robot of a scene that is named here.
    walked = Scene.load(scene) if simulate and scene else None
    legs = {'legs': list(walked.legs)} if walked else {}
    foot = {'foot': walked.foot.source, 'expected_load': walked.expected_load} if walked else {}
    robot = {'robot': walked.body.robot.source, 'foot_radius': 0.0} if walked and joints else {}
    if robot.get('robot', '').endswith('.urdf'):
        robot['feet'] = ','.join(walked.body.robot.legs)
    # The recorder first and the simulator last: a walk is recorded from its first step on.
    chosen = []
    if flag('record'):
        folder = text('folder')
        chosen.append(node('recorder_node', use_sim_time=use_sim_time, folder=folder, **legs))
    chosen.append(node('regulator_node', use_sim_time=use_sim_time, scene=scene, **legs))
    if joints:
        chosen.append(node('body_estimator_node', use_sim_time=use_sim_time, **legs, **robot))
    shared = {'use_sim_time': use_sim_time, **legs, **foot}
    chosen.append(node('estimator_node', **shared, **estimator))
    chosen.append(node('controller_node', **shared))
    merges = flag('merge') if text('merge') else not simulate
    if merges:
        chosen.append(node('merge_node', use_sim_time=use_sim_time, source=sensing, **legs))
    if flag('views'):
        own = {'frame': 'odom'} if joints else {}
        # What drivers publish themselves is theirs.
        theirs = {'topics': VIEWS_BESIDE_DRIVERS} if merges else {}
        chosen.append(node('views_node', use_sim_time=use_sim_time, **legs, **own, **theirs))
    if simulate:
        chosen.append(node('simulator_node', publish_clock=use_sim_time, scene=scene, **simulator))
    return chosen

"""Launch the node: `ros2 launch rso_lidar_ros lidar.launch.py scenario:=/path/to/scenario.toml python:=/path/to/python`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Parameters of the node: kind, default and meaning.
PARAMETERS = {
    "python": (str, "python3", "interpreter with rso_lidar and rosbags"),
    "step_s": (float, "0.02", "step of the simulation [s]"),
    "real_time_factor": (float, "1.0", "simulated time over wall time"),
    "truth": (bool, "true", "whether /tf and /labels are published"),
    "trust_code": (bool, "false", "whether the Python code runs that the scenario names"),
}


def generate_launch_description():
    """Return the arguments of the launch and the node."""
    arguments = [DeclareLaunchArgument("scenario", description="path of the scenario (TOML)")]
    arguments += [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (_, default, meaning) in PARAMETERS.items()
    ]
    node = Node(
        package="rso_lidar_ros",
        executable="node",
        name="rso_lidar",
        output="screen",
        arguments=[LaunchConfiguration("scenario")],
        parameters=[
            {
                name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                for name, (kind, _, _) in PARAMETERS.items()
            }
        ],
    )
    return LaunchDescription([*arguments, node])

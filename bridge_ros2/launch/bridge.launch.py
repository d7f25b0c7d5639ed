"""Starts the bridge: `ros2 launch mjplug_bridge_ros2 bridge.launch.py params_file:=my.yaml`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

PACKAGE = "mjplug_bridge_ros2"


def generate_launch_description():
    """Returns the launch description; its only argument is the parameter file."""
    default = PathJoinSubstitution([FindPackageShare(PACKAGE), "config", "bridge.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", default_value=default, description="Parameters of the bridge."),
            Node(
                package=PACKAGE,
                executable="bridge",
                name="mjplug_bridge",
                output="screen",
                parameters=[LaunchConfiguration("params_file")],
            ),
        ]
    )

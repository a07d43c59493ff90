"""Start the driver: ``port`` names the board's port, ``parameters`` a file for everything else."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NAME = "vrscan_driver"


def generate_launch_description() -> LaunchDescription:
    """Return what ``ros2 launch`` does."""
    shipped = PathJoinSubstitution([FindPackageShare(NAME), "config", "vrscan.yaml"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("port", default_value="/dev/ttyUSB0"),
            DeclareLaunchArgument("parameters", default_value=shipped),
            Node(
                package=NAME,
                executable=NAME,
                name="vrscan",
                output="screen",
                parameters=[
                    LaunchConfiguration("parameters"),
                    {"port": LaunchConfiguration("port")},
                ],
            ),
        ]
    )

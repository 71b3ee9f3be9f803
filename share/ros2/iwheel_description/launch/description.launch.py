# SPDX-License-Identifier: MIT
"""Starts robot_state_publisher with the machine's measures, and with `rviz:=true` RViz."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "namespace": ("", "[ros] namespace of ros2.conf; empty: none"),
    "radius": ("0.192", "m, [wheels] radius_mm of gateway.conf"),
    "track": ("0.540", "m, [wheels] track_mm of gateway.conf"),
    "prefix": ("", "prefix of all frames, as in [odometry] base_frame of ros2.conf, such as w1/"),
    "rviz": ("false", "start RViz"),
}


def generate_launch_description():
    share = FindPackageShare("iwheel_description")
    model = PathJoinSubstitution([share, "urdf", "iwheel.urdf.xacro"])
    measures = [part for name in ("radius", "track", "prefix") for part in (f" {name}:=", LaunchConfiguration(name))]
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value, description=what) for name, (value, what) in ARGUMENTS.items()),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=LaunchConfiguration("namespace"),
                parameters=[{"robot_description": ParameterValue(Command(["xacro ", model, *measures]), value_type=str)}],
            ),
            Node(
                package="rviz2",
                executable="rviz2",
                arguments=["-d", PathJoinSubstitution([share, "rviz", "iwheel.rviz"])],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )

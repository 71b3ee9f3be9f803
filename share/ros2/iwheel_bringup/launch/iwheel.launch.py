# SPDX-License-Identifier: MIT
"""Starts the description of the machine, and with `joystick:=true` a gamepad. systemd starts iwheel-ros2 as a service; this file does not."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    namespace, joystick = LaunchConfiguration("namespace"), LaunchConfiguration("joystick")
    config = PathJoinSubstitution([FindPackageShare("iwheel_bringup"), "config", "joystick.yaml"])
    description = PathJoinSubstitution([FindPackageShare("iwheel_description"), "launch", "description.launch.py"])
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="[ros] namespace of ros2.conf; empty: none"),
            DeclareLaunchArgument("joystick", default_value="false", description="start joy_node and the deadman node"),
            IncludeLaunchDescription(PythonLaunchDescriptionSource(description), launch_arguments={"namespace": namespace}.items()),
            Node(package="joy", executable="joy_node", namespace=namespace, parameters=[config], condition=IfCondition(joystick)),
            Node(
                package="iwheel_bringup",
                executable="joystick",
                name="iwheel_joystick",
                namespace=namespace,
                parameters=[config],
                condition=IfCondition(joystick),
            ),
        ]
    )

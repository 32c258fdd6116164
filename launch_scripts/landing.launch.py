# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The three nodes on board: ``ros2 launch peace_ros landing.launch.py mavlink:=URL``.

``--show-args`` lists the arguments. Nothing moves before
``ros2 service call /landing/engage std_srvs/srv/Trigger``.
"""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'peace_ros'
ARGUMENTS = (
    ('preset', 'peace_cs', 'One of dd_cs, d_cs, peace_cs, dd_fs, d_fs, peace_fs'),
    ('image', 'image', 'Topic of the nadir camera (sensor_msgs/Image)'),
    ('interface', 'mavlink', 'mavlink, or twist for simulators without MAVLink'),
    ('mavlink', 'udpin:127.0.0.1:14550', 'Where the autopilot is'),
    ('pose_source', 'topic', 'With interface twist: topic (the one below) or tf'),
    ('pose', 'pose', 'With interface twist: topic of the pose (geometry_msgs/PoseStamped)'),
    ('tf_parent', 'map', 'With pose_source tf: the local frame'),
    ('tf_child', 'base_link', 'With pose_source tf: the frame of the vehicle'),
    ('cmd_vel', 'cmd_vel', 'With interface twist: topic of the velocity (geometry_msgs/Twist)'),
    ('use_sim_time', 'false', 'Take the time from /clock'),
)


def _text(name: str) -> ParameterValue:
    return ParameterValue(LaunchConfiguration(name), value_type=str)


def generate_launch_description() -> LaunchDescription:
    """Return the three nodes with the parameters of the preset."""
    preset = PathJoinSubstitution(
        [FindPackageShare(PACKAGE), 'config', 'presets', [LaunchConfiguration('preset'), '.yaml']]
    )
    clock = {'use_sim_time': ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)}
    names = ('interface', 'mavlink', 'pose_source', 'tf_parent', 'tf_child')
    vehicle = {name: _text(name) for name in names}
    image = ('image', LaunchConfiguration('image'))
    topics = [(name, LaunchConfiguration(name)) for name in ('pose', 'cmd_vel')]
    nodes = (
        ('prompt_generator', [preset, clock], [image]),
        ('segmentation', [preset, clock], [image]),
        ('landing', [preset, clock, vehicle], [image, *topics]),
    )
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, default, meaning in ARGUMENTS
            ),
            *(
                Node(
                    package=PACKAGE,
                    executable=name,
                    name=name,
                    output='screen',
                    parameters=parameters,
                    remappings=remappings,
                )
                for name, parameters, remappings in nodes
            ),
        ]
    )

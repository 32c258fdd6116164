# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes on board: ``ros2 launch peace_ros landing.launch.py mavlink:=URL``.

``--show-args`` lists the arguments. Nothing moves before
``ros2 service call /landing/engage std_srvs/srv/Trigger``.
"""

from __future__ import annotations

import os
import sys
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import EnvironmentVariable
from launch_ros.actions import Node

from peace_ros.core.resources import config_dir

PACKAGE = 'peace_ros'
PRESETS = sorted(path.stem for path in (config_dir() / 'presets').glob('*.yaml'))
DISCOVERY = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
COMPOSED, SEPARATE = 'perception', ('prompt_generator', 'segmentation')
RECORDER = 'recorder'
FAST_DDS = 'FASTRTPS_DEFAULT_PROFILES_FILE'
RESPAWN_DELAY_S = 2.0
BOOLEANS = ['true', 'false', 'True', 'False']  # both are in use for launch files

OF_ALL_NODES = ('use_sim_time', 'autostart')
"""Arguments that are parameters of the nodes, apart from the recorder."""
OF_PERCEPTION = ('image_transport',)
OF_RECORDER = ('use_sim_time', 'recordings', *OF_PERCEPTION)
OF_LANDING = (
    'interface',
    'mavlink',
    'dialect',
    'pose_source',
    'tf_parent',
    'tf_child',
    *OF_PERCEPTION,
)
TOPICS = ('image', 'depth', 'pose', 'cmd_vel')

_UNSET = '; empty: as in params_file, or the default of the node'
ARGUMENTS: tuple[tuple[str, Any, str, list[str] | None], ...] = (
    ('namespace', '', 'Namespace of the nodes, such as drone_1', None),
    ('preset', 'peace_cs', 'Prompt and model', PRESETS),
    ('params_file', '', 'ROS parameter file; its values go before those of the preset', None),
    ('use_sim_time', 'false', 'Take the time from /clock', BOOLEANS),
    (
        'log_level',
        'info',
        'Least severity that is logged',
        ['debug', 'info', 'warn', 'error', 'fatal'],
    ),
    ('autostart', 'true', 'Configure and activate the nodes; else a lifecycle manager', BOOLEANS),
    ('use_composition', 'false', 'Prompt generator and segmentation in one process', BOOLEANS),
    ('use_respawn', 'false', 'Start a perception node again when it has ended', BOOLEANS),
    ('record', 'true', 'Record what a replay needs, in a process of its own', BOOLEANS),
    ('recordings', '', f'Folder of the recordings{_UNSET}', None),
    (
        'discovery_range',
        EnvironmentVariable(DISCOVERY, default_value='LOCALHOST'),
        'Who on the network finds the nodes; by default this machine only',
        ['LOCALHOST', 'SUBNET', 'OFF', 'SYSTEM_DEFAULT'],
    ),
    ('image', 'image', 'Topic of the nadir camera (sensor_msgs/Image)', None),
    ('image_transport', '', f'raw or compressed (JPEG, PNG on image/compressed){_UNSET}', None),
    ('camera_info', '', 'Topic of its calibration; empty: the camera_info beside the image', None),
    ('depth', 'depth', 'Topic of depth images (sensor_msgs/Image), where there are any', None),
    ('interface', '', f'mavlink, or twist for simulators without MAVLink{_UNSET}', None),
    ('mavlink', '', f'Where the autopilot is, such as udpin:0.0.0.0:14550{_UNSET}', None),
    ('dialect', '', f'Kind of autopilot: auto, ardupilot or px4{_UNSET}', None),
    ('pose_source', '', f'With interface twist: topic (the one below) or tf{_UNSET}', None),
    ('pose', 'pose', 'With interface twist: topic of the pose (geometry_msgs/PoseStamped)', None),
    ('tf_parent', '', f'With pose_source tf: the local frame{_UNSET}', None),
    ('tf_child', '', f'With pose_source tf: the frame of the vehicle{_UNSET}', None),
    ('cmd_vel', 'cmd_vel', 'With interface twist: topic of the velocity (Twist)', None),
)


def _refuse_unknown(context: LaunchContext) -> None:
    """Refuse a misspelt argument; a launch file that includes this one may have others."""
    names = [name for name, *_ in ARGUMENTS]
    is_included = Path(__file__).name not in {Path(each).name for each in sys.argv}
    for argument in context.argv:
        name, _, _ = argument.partition(':=')
        near = get_close_matches(name, names, n=1)
        if name not in names and (near or not is_included):
            remedy = f'did you mean {near[0]}?' if near else '--show-args lists them'
            raise RuntimeError(f'launch argument {name} is unknown: {remedy}')


def _create_nodes(context: LaunchContext) -> list[Node]:
    _refuse_unknown(context)
    given: dict[str, str] = context.launch_configurations
    is_true = {
        name: given[name].lower() == 'true'
        for name, *_, choices in ARGUMENTS
        if choices is BOOLEANS
    }
    files = [str(config_dir() / 'presets' / f'{given["preset"]}.yaml')]
    if given['params_file']:
        if not Path(given['params_file']).is_file():
            raise RuntimeError(
                f'params_file {given["params_file"]} does not exist: give a ROS parameter file'
            )
        files.append(given['params_file'])

    # The nodes ask for the topic beside the image, as image_transport has it.
    beside = f'{given["image"].rpartition("/")[0]}/camera_info'
    if '/' not in given['image']:
        beside = 'camera_info'
    calibration = [(beside, given['camera_info'])] if given['camera_info'] else []

    def create(name: str, arguments: tuple[str, ...], *, respawn: bool) -> Node:
        chosen = {each: is_true.get(each, given[each]) for each in arguments if given[each]}
        return Node(
            package=PACKAGE,
            executable=name,
            # One name would rename both nodes of a composed process.
            name=None if name == COMPOSED else name,
            namespace=given['namespace'],
            output='screen',
            parameters=[*files, chosen],
            remappings=[
                *((topic, given[topic]) for topic in TOPICS),
                ('image/compressed', f'{given["image"]}/compressed'),
                *calibration,
            ],
            ros_arguments=['--log-level', given['log_level']],
            respawn=respawn,
            respawn_delay=RESPAWN_DELAY_S,
            additional_env={
                DISCOVERY: given['discovery_range'],
                FAST_DDS: os.environ.get(FAST_DDS) or str(config_dir() / 'fastdds.xml'),
            },
        )

    respawn = is_true['use_respawn']
    return [
        *(
            create(name, (*OF_ALL_NODES, *OF_PERCEPTION), respawn=respawn)
            for name in ((COMPOSED,) if is_true['use_composition'] else SEPARATE)
        ),
        # Never again by itself: where it engages automatically, it would after a takeover, too.
        create('landing', (*OF_ALL_NODES, *OF_LANDING), respawn=False),
        *([create(RECORDER, OF_RECORDER, respawn=respawn)] if is_true['record'] else []),
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the nodes with the parameters of the preset."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name, default_value=default, description=meaning, choices=choices
                )
                for name, default, meaning, choices in ARGUMENTS
            ),
            OpaqueFunction(function=_create_nodes),
        ]
    )

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which node has which parameters: the one table that nodes and readers of parameter files use.

Here too are the options of the nodes, which no part of the core needs for itself.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from peace_ros.core.domain import Camera, ConfigurationError, Mount
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.core.domain.parameters import ParameterInfo, ParameterSet, describe, parameter

Group = tuple[str, type[Any]]
"""Prefix of the ROS names (empty for none) and the dataclass behind them."""

FLYING_NODES = ('prompt_generator', 'segmentation', 'landing')
RECORDER = 'recorder'
"""The node beside those that fly; it decides nothing."""
OTHER_NODES = ('satellite_view', 'autopilot_sim', 'watch')
"""Their parameters are declared where they are, and checked when they start."""

_TRANSPORTS = ('raw', 'compressed')


@dataclass(frozen=True)
class LifecycleOptions(ParameterSet):
    """Options of every node that flies."""

    autostart: bool = parameter(
        True,
        'Configure and activate the node when it starts; off: a lifecycle manager or '
        'ros2 lifecycle does it',
    )


@dataclass(frozen=True)
class PromptGeneratorOptions(ParameterSet):
    """Options of the prompt_generator node."""

    image_transport: str = parameter(
        'raw', 'Take image (raw) or image/compressed (JPEG, PNG)', choices=_TRANSPORTS
    )


@dataclass(frozen=True)
class SegmentationOptions(ParameterSet):
    """Options of the segmentation node."""

    image_transport: str = parameter(
        'raw', 'Take image (raw) or image/compressed (JPEG, PNG)', choices=_TRANSPORTS
    )
    template: str = parameter(
        'PEACE',
        'That of the prompt generator; a static one (DD, D, a sentence with {term} only) is used '
        'as it is, without prompts from a topic',
        live=True,
    )
    prompt_timeout: float = parameter(
        0.3,
        'A frame waits this long for the prompt made from it, then takes the newest one; after '
        'a timeout no frame waits until a prompt is in time again',
        unit='s',
        low=0.0,
        high=10.0,
        live=True,
    )
    overlay_threshold: float = parameter(
        0.5, 'Score from which the overlay shows a pixel as safe', low=0.0, high=1.0, live=True
    )
    overlay_quality: int = parameter(80, 'JPEG quality of the overlay', low=1, high=100, live=True)


@dataclass(frozen=True)
class CameraOptions(ParameterSet):
    """The camera, as both its simulation and the landing see it.

    Its size and field of view are those of its simulation, and of frames without ``camera_info``.
    """

    camera_width: int = parameter(352, 'Width of the image', unit='px', low=16, high=8192)
    camera_height: int = parameter(352, 'Height of the image', unit='px', low=16, high=8192)
    camera_fov: float = parameter(
        73.0, 'Full horizontal field of view; pixels are square', unit='deg', low=5.0, high=150.0
    )
    mount_roll: float = parameter(
        0.0,
        'Mount, turned about the forward axis of the vehicle: above 0 the camera looks to the left',
        unit='deg',
        low=-80.0,
        high=80.0,
    )
    mount_pitch: float = parameter(
        0.0,
        'Mount, turned about the right axis: above 0 the camera looks ahead of the vehicle',
        unit='deg',
        low=-80.0,
        high=80.0,
    )
    mount_yaw: float = parameter(
        0.0,
        'Mount, turned about the down axis: where the top of the image points; 0 is the nose, 90 '
        'the right side of the vehicle, 180 its tail',
        unit='deg',
        low=-360.0,
        high=360.0,
    )
    mount_x: float = parameter(
        0.0, 'Place of the camera on the vehicle: forward', unit='m', low=-5.0, high=5.0
    )
    mount_y: float = parameter(0.0, 'The same, to the right', unit='m', low=-5.0, high=5.0)
    mount_z: float = parameter(0.0, 'The same, down', unit='m', low=-5.0, high=5.0)

    @property
    def camera(self) -> Camera:
        """The camera that the options describe."""
        return Camera.from_degrees(self.camera_width, self.camera_height, self.camera_fov)

    @property
    def mount(self) -> Mount:
        """How the options say that it is mounted."""
        return mount_from_degrees(
            (self.mount_roll, self.mount_pitch, self.mount_yaw),
            (self.mount_x, self.mount_y, self.mount_z),
        )


@dataclass(frozen=True)
class LandingOptions(ParameterSet):
    """Options of the landing node."""

    interface: str = parameter(
        'mavlink',
        'mavlink commands an autopilot; twist commands the topic cmd_vel and takes the pose from '
        'a topic, for simulators',
        choices=('mavlink', 'twist'),
    )
    mavlink: str = parameter(
        'udpin:127.0.0.1:14550',
        'Where the autopilot is: udpin:HOST:PORT (listen), udpout:HOST:PORT (call), '
        'tcp:HOST:PORT or /dev/NAME:BAUD',
    )
    dialect: str = parameter(
        'auto', 'What kind of autopilot it is: auto, ardupilot, px4, or one that was registered'
    )
    rate: float = parameter(
        25.0, 'Rate of decisions, on the steady clock', unit='Hz', low=20.0, high=400.0
    )
    auto_engage: bool = parameter(
        False, 'Engage once, as soon as nothing prevents it; otherwise ~/engage is called'
    )
    registration: bool = parameter(
        True,
        'Compare camera images (subscribes to image): their scale checks the altitude, and while '
        'the autopilot knows attitude and altitude but no position they carry the map on',
    )
    image_transport: str = parameter(
        'raw',
        'With registration: take image (raw) or image/compressed (JPEG, PNG)',
        choices=_TRANSPORTS,
    )
    pose_source: str = parameter(
        'topic',
        'With interface twist: pose from the topic pose (PoseStamped), or from tf by the chain '
        'from tf_parent to tf_child (REP-105: map, odom, base_link; needs tf2_ros)',
        choices=('topic', 'tf'),
    )
    tf_parent: str = parameter('map', 'Local frame (ENU) of the pose in tf')
    tf_child: str = parameter('base_link', 'Frame of the vehicle in tf')
    publish_tf: bool = parameter(
        False,
        'Publish tf_parent -> tf_child, and with mount_source parameters tf_child -> the frame of '
        'the images, where nothing else does (needs tf2_msgs)',
    )
    mount_source: str = parameter(
        'parameters',
        'How the camera is mounted: by the parameters mount_*, or by tf from tf_child to the '
        'optical frame (REP-103) that the images name in their header (needs tf2_ros)',
        choices=('parameters', 'tf'),
    )

    @property
    def tf_frames(self) -> tuple[str, str]:
        """Local frame and frame of the vehicle."""
        return self.tf_parent, self.tf_child

    @property
    def takes_pose_topic(self) -> bool:
        """Whether the pose of the vehicle comes over the topic ``pose``."""
        return self.interface == 'twist' and self.pose_source == 'topic'


@dataclass(frozen=True)
class RecorderParameters(ParameterSet):
    """What the recorder node writes, and where."""

    recordings: str = parameter(
        '', 'Folder of the recordings; empty: peace_ros in ROS_HOME, or else in ~/.ros'
    )
    image_transport: str = parameter(
        'raw', 'Take image (raw) or image/compressed (JPEG, PNG)', choices=_TRANSPORTS
    )
    image_rate: float = parameter(
        5.0,
        'Most frames and heatmaps per second during a landing; otherwise one in 5 s',
        unit='Hz',
        low=0.1,
        high=60.0,
    )
    image_quality: int = parameter(90, 'JPEG quality of raw images', low=30, high=100)
    file_mb: int = parameter(1000, 'A new file begins at this size', unit='MB', low=1, high=100_000)
    total_mb: int = parameter(
        8000,
        'Bound of all files together: the oldest are removed',
        unit='MB',
        low=2,
        high=10_000_000,
    )
    least_free_mb: int = parameter(
        500, 'Nothing is recorded while less than this is free on the disk', unit='MB', low=0
    )

    def __post_init__(self) -> None:
        """Refuse a bound in which no file has room."""
        super().__post_init__()
        if self.total_mb < 2 * self.file_mb:
            raise ConfigurationError(
                f'parameter total_mb = {self.total_mb}: give at least twice file_mb '
                f'({self.file_mb}), or a smaller file_mb'
            )


def groups_of(node: str) -> tuple[Group, ...]:
    """Return the groups of parameters of one of :data:`FLYING_NODES`, or of the recorder.

    Imports are made here: a node shall not load the libraries of the others.
    """
    if node == 'prompt_generator':
        from peace_ros.core.prompting import PromptingParameters

        return ('', PromptingParameters), ('', PromptGeneratorOptions), ('', LifecycleOptions)
    if node == 'segmentation':
        from peace_ros.core.segmentation import FAMILIES, SegmentationParameters

        families = [('', family.parameters) for family in FAMILIES.values()]
        return (
            ('', SegmentationParameters),
            *families,
            ('', SegmentationOptions),
            ('', LifecycleOptions),
        )
    if node == 'landing':
        from peace_ros.core.landing import LandingParameters
        from peace_ros.core.mapping import MapParameters
        from peace_ros.core.vehicle import SenderParameters, VehicleParameters

        return (
            ('', LifecycleOptions),
            ('', LandingOptions),
            ('', CameraOptions),
            ('', LandingParameters),
            ('', MapParameters),
            ('vehicle', VehicleParameters),
            ('sender', SenderParameters),
        )
    if node == RECORDER:
        return (('', RecorderParameters),)
    raise ConfigurationError(f'node {node!r} is unknown: choose one of {", ".join(FLYING_NODES)}')


def named(groups: Sequence[Group]) -> dict[str, ParameterInfo]:
    """Return ROS name -> description of all parameters of a node, in order."""
    return {
        ros_name(prefix, info): info
        for prefix, parameters in groups
        for info in describe(parameters)
    }


def ros_name(prefix: str, info: ParameterInfo) -> str:
    """Return the ROS name of a parameter of a group."""
    return f'{prefix}.{info.name}' if prefix else info.name


def is_of_ros(name: str) -> bool:
    """Tell whether every node has this parameter, without our doing."""
    return name in {'use_sim_time', 'start_type_description_service'} or name.startswith(
        'qos_overrides.'
    )


def unknown_name(name: str, node: str, known: Collection[str]) -> ConfigurationError:
    """Return the error of a name that a node does not have, with the nearest that it has."""
    near = get_close_matches(name, known, n=1)
    remedy = f'did you mean {near[0]}?' if near else 'see docs/parameters.md'
    return ConfigurationError(f'parameter {name} of {node} is unknown: {remedy}')


def refuse_misspelt(name: str, section: str, known: Collection[str]) -> None:
    """Refuse a name in a section for all nodes when it is a misspelt parameter of one of ours.

    Other names may belong to nodes of other packages.

    Raises:
        ConfigurationError: it nearly is one of the known names.

    """
    near = get_close_matches(name, known, n=1, cutoff=_MISSPELT)
    if near and name not in known:
        raise unknown_name(name, f'section {section}', near)


def converted(name: str, info: ParameterInfo, value: Any) -> Any:
    """Return a value that was given, in the type of the default; integers serve as floats.

    Raises:
        ConfigurationError: it is of another type.

    """
    expected = type(info.default)
    if expected is float and type(value) is int:
        return float(value)
    if expected is tuple and isinstance(value, Sequence) and not isinstance(value, str | bytes):
        element = type(info.default[0]) if info.default else str
        if all(type(each) is element for each in value):
            return tuple(value)
    if type(value) is expected:
        return value
    raise ConfigurationError(
        f'parameter {name} = {value!r}: give {_TYPE_NAMES[expected]}, such as {info.default!r}'
    )


_MISSPELT = 0.8
"""Similarity (difflib, 0 to 1) from which a name counts as another one misspelt."""
_TYPE_NAMES = {
    bool: 'true or false',
    int: 'an integer',
    float: 'a number',
    str: 'a text',
    tuple: 'a list',
}

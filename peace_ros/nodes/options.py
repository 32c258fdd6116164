# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each node can be told besides the parameters of the core that it runs."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import Camera
from peace_ros.core.domain.parameters import check, parameter

_TRANSPORTS = ('raw', 'compressed')


@dataclass(frozen=True)
class PromptGeneratorOptions:
    """Options of the prompt_generator node."""

    image_transport: str = parameter(
        'raw', 'Take image (raw) or image/compressed (JPEG, PNG)', choices=_TRANSPORTS
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class SegmentationOptions:
    """Options of the segmentation node."""

    image_transport: str = parameter(
        'raw', 'Take image (raw) or image/compressed (JPEG, PNG)', choices=_TRANSPORTS
    )
    template: str = parameter(
        'PEACE',
        'That of the prompt generator; a static one (DD, D, a sentence with {term} only) is used '
        'as it is, without prompts from a topic',
    )
    prompt_timeout: float = parameter(
        0.3,
        'A frame waits this long for the prompt made from it, then takes the newest one; after '
        'a frame in vain none waits until a prompt is in time again',
        unit='s',
        low=0.0,
        high=10.0,
    )
    overlay_threshold: float = parameter(
        0.5, 'Score from which the overlay shows a pixel as safe', low=0.0, high=1.0
    )
    overlay_quality: int = parameter(80, 'JPEG quality of the overlay', low=1, high=100)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class CameraOptions:
    """The nadir camera, as both its simulation and the landing see it."""

    camera_width: int = parameter(352, 'Width of the image', unit='px', low=16, high=8192)
    camera_height: int = parameter(352, 'Height of the image', unit='px', low=16, high=8192)
    camera_fov: float = parameter(
        73.0, 'Full horizontal field of view; pixels are square', unit='deg', low=5.0, high=150.0
    )

    def __post_init__(self) -> None:
        check(self)

    @property
    def camera(self) -> Camera:
        """The camera that the options describe."""
        return Camera.from_degrees(self.camera_width, self.camera_height, self.camera_fov)


@dataclass(frozen=True)
class LandingOptions:
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
        False, 'Engage as soon as nothing speaks against it, once; otherwise ~/engage is called'
    )
    registration: bool = parameter(
        False,
        'While the autopilot knows attitude and altitude but no position, carry the map on by '
        'comparing camera images (subscribes to image)',
    )
    image_transport: str = parameter(
        'raw',
        'With registration: take image (raw) or image/compressed (JPEG, PNG)',
        choices=_TRANSPORTS,
    )
    pose_source: str = parameter(
        'topic',
        'With interface twist: pose from the topic pose (PoseStamped) or from tf',
        choices=('topic', 'tf'),
    )
    tf_parent: str = parameter('map', 'Local frame (ENU) of the pose in tf')
    tf_child: str = parameter('base_link', 'Frame of the vehicle in tf')

    def __post_init__(self) -> None:
        check(self)

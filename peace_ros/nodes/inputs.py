# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the landing node hears: callbacks only store."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import ConfigurationError, PeaceError, Pose
from peace_ros.core.landing import LandingCore
from peace_ros.core.messages import (
    depth_from_image,
    frame_from_message,
    heatmap_from_image,
    stamp_ns_of,
)
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.core.vehicle import VehicleParameters
from peace_ros.nodes.images import FRAME_INFO, ImageMessage, subscribe_images
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import IMAGE_IN, RESULT
from peace_ros.nodes.sources import Sources
from peace_ros.nodes.tf import TfMounts

_WAITING = 4
"""Messages that are kept until the next step; older ones are dropped."""
_FRAME_INFOS = 64
"""They may come before their heatmap, which is larger."""


class LandingInputs:
    """Heatmaps, and where they are given depth images and pictures: callbacks only store.

    A heatmap does not show which camera took its frame: it waits for the ``heatmap/frame_info``
    of its stamp, and is of no use without.

    Args:
        node: Subscribes, and says what is refused.
        options: Whether pictures are asked for.
    """

    def __init__(self, node: PeaceNode, options: LandingOptions) -> None:
        self._node = node
        self.sources = Sources(node, poses=options.takes_pose_topic)
        """Whose data arrive: none is used while a topic has several publishers."""
        self._heatmaps: deque[Image] = deque(maxlen=_WAITING)
        self._frame_infos: deque[CameraInfo] = deque(maxlen=_FRAME_INFOS)
        self._depths: deque[Image] = deque(maxlen=_WAITING)
        self._images: deque[ImageMessage] = deque(maxlen=_WAITING)
        self._heatmap_arrived = node.diagnostics.watch('heatmap')
        node.create_subscription(Image, 'heatmap', self._on_heatmap, IMAGE_IN)
        self._frame_info_arrived = node.diagnostics.watch(FRAME_INFO)
        node.create_subscription(CameraInfo, FRAME_INFO, self._on_frame_info, RESULT)
        node.create_subscription(Image, 'depth', self._on_depth, IMAGE_IN)
        self.camera_frame = ''
        """The frame_id of the newest frame that has a heatmap, empty before."""
        self._mounts: TfMounts | None = None
        if options.mount_source == 'tf':
            if node.filled(VehicleParameters).follow_gimbal:
                raise ConfigurationError(
                    'mount_source tf and vehicle.follow_gimbal both say how the camera is turned: '
                    'choose one of them'
                )
            self._mounts = TfMounts(node, options.tf_child)
        if options.registration:
            subscribe_images(node, options.image_transport, self._on_image)

    def _on_heatmap(self, message: Image) -> None:
        self._heatmap_arrived(stamp_ns_of(message))
        self._heatmaps.append(message)

    def _on_frame_info(self, message: CameraInfo) -> None:
        self._frame_info_arrived(stamp_ns_of(message))
        self._frame_infos.append(message)

    def _on_depth(self, message: Image) -> None:
        self._depths.append(message)

    def _on_image(self, message: ImageMessage) -> None:
        self._images.append(message)

    def feed(self, core: LandingCore, poses: Sequence[Pose]) -> None:
        """Hand on what has come since the last call; what cannot be read is said and dropped.

        Args:
            core: Gets it.
            poses: Of the vehicle, since the last call.
        """
        if self._mounts is None:
            core.distrust(self.sources.problem)
            for pose in poses:
                core.add_pose(pose)
        else:
            mounted = list(self._mounts.of(poses))
            core.distrust(self.sources.problem or self._mounts.problem)
            for pose, mount in mounted:
                core.add_pose(pose, mount)
        inputs: tuple[tuple[str, deque[Any], Callable[[Any], None]], ...] = (
            ('image', self._images, lambda each: core.add_view(frame_from_message(each))),
            ('depth', self._depths, lambda each: core.add_depth(depth_from_image(each))),
        )
        for name, waiting, hand_on in inputs:
            while waiting:
                self._hand_on(name, waiting.popleft(), hand_on)
        while self._heatmaps:
            info = self._frame_info_of(self._heatmaps[0])
            if info is None and len(self._heatmaps) == 1:
                return  # it may still come
            self._hand_on('heatmap', self._heatmaps.popleft(), partial(self._add, core, info))

    def _add(self, core: LandingCore, info: CameraInfo | None, message: Image) -> None:
        if info is None:
            core.reject_heatmap(f'no {FRAME_INFO} of its stamp says what took its frame')
            return
        self.camera_frame = info.header.frame_id
        if self._mounts is not None:
            self._mounts.see(self.camera_frame)
        core.add_heatmap(heatmap_from_image(message, info))

    def _frame_info_of(self, heatmap: Image) -> CameraInfo | None:
        stamp = heatmap.header.stamp
        return next((each for each in self._frame_infos if each.header.stamp == stamp), None)

    def _hand_on(self, name: str, message: Any, hand_on: Callable[[Any], None]) -> None:
        try:
            hand_on(message)
        except PeaceError as error:
            self._node.say(name, f'{name} refused: {error}')

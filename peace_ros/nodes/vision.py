# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``image`` and the vehicle -> motion for the position filter of the autopilot, in a thread."""

from __future__ import annotations

import threading
from collections import deque

from peace_ros.core.domain import ConfigurationError, Health, Level, PeaceError, Pose
from peace_ros.core.node_parameters import CameraOptions, LandingOptions
from peace_ros.core.odometry import OdometryParameters
from peace_ros.core.threads import GuardedThread
from peace_ros.core.vehicle import MavlinkLink, VehicleLink, VehicleParameters
from peace_ros.core.vision_feed import VisionFeed
from peace_ros.nodes.images import CalibratedImages, ImageMessage
from peace_ros.nodes.node import PeaceNode

_PERIOD_S = 0.02
"""Body rates come a few hundredths of a second after their picture."""
_JOIN_S = 2.0
_WAITING = 4
_POSES = 256


class VisionOutput:
    """Feeds the autopilot where ``vision_position`` asks for it; otherwise it does nothing.

    The work is done beside the decisions, so that a picture never delays one.
    """

    def __init__(self, node: PeaceNode, options: LandingOptions) -> None:
        """Subscribe, and begin.

        Raises:
            ConfigurationError: the interface has no position filter, or the mount is not known.

        """
        self._node = node
        self._images: deque[ImageMessage] = deque(maxlen=_WAITING)
        self._poses: deque[Pose] = deque(maxlen=_POSES)
        self._feed: VisionFeed | None = None
        self._link: VehicleLink | None = None
        self._stop = threading.Event()
        self._thread: GuardedThread | None = None
        if not options.vision_position:
            return
        if options.interface != 'mavlink' or options.mount_source != 'parameters':
            raise ConfigurationError(
                f'parameter vision_position with interface {options.interface} and mount_source '
                f'{options.mount_source}: it needs mavlink and parameters'
            )
        if node.filled(VehicleParameters).follow_gimbal:
            raise ConfigurationError(
                'parameter vision_position with vehicle.follow_gimbal: the camera must not move '
                'against the vehicle; set one of them to false'
            )
        self._calibrated = CalibratedImages(node, options.image_transport, self._on_image)
        node.diagnostics.add('vision', self._health)
        self._thread = GuardedThread(self._run, 'vision', node.fail)
        self._thread.start()

    def _on_image(self, message: ImageMessage) -> None:
        self._images.append(message)

    def poses(self, link: VehicleLink | None) -> list[Pose]:
        """Take the poses of the link, which others need too, and return them."""
        poses = [] if link is None else link.take_poses()
        if self._thread is not None:
            self._poses.extend(poses)
            self._link = link
        return poses

    def close(self) -> None:
        """End the thread; waits two seconds at most."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=_JOIN_S)

    def _run(self) -> None:
        while not self._stop.wait(_PERIOD_S):
            feed = self._feed_of(self._link)
            while feed is not None and self._poses:
                feed.add_pose(self._poses.popleft())
            while self._images:
                message = self._images.popleft()
                try:
                    frame = self._calibrated.frame(message)
                except PeaceError as error:
                    self._node.say('vision', f'image refused: {error}')
                    continue
                if feed is not None:
                    feed.add_frame(frame)
            if feed is not None:
                feed.step()

    def _feed_of(self, link: VehicleLink | None) -> VisionFeed | None:
        if self._feed is None and isinstance(link, MavlinkLink):
            camera, odometry = (
                self._node.filled(CameraOptions),
                self._node.filled(OdometryParameters),
            )
            self._feed = VisionFeed(link, camera.camera, camera.mount, odometry)
        return self._feed

    def _health(self) -> Health:
        feed = self._feed
        if feed is None:
            return Health(Level.WARN, 'the vehicle is not reached yet')
        off = 'unknown' if feed.off_m is None else f'{feed.off_m:.2f}'
        values = (('sent', str(feed.sent)), ('off_gnss_m', off))
        if feed.problem:
            return Health(Level.WARN, f'no motion is sent: {feed.problem}', values)
        return Health(Level.OK, 'the autopilot is told how the vehicle moves', values)

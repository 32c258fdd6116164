# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The satellite_view node: what a nadir camera sees over a world, wherever the vehicle is."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import PeaceError, Pose
from peace_ros.core.messages import CAMERA_FRAME
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.nodes.messages import camera_info, image_message
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import IMAGE_OUT, RESULT
from peace_ros.nodes.runtime import run
from peace_ros.nodes.worker import NewestWorker
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.nodes.options import SATELLITE_VIEW, SatelliteViewOptions
from peace_ros.simulation.nodes.pose_sources import (
    MavlinkSource,
    PoseSource,
    TopicSource,
    TwistSource,
)
from peace_ros.simulation.positions import SILENT_S
from peace_ros.simulation.world import World, draw_world, load_world

_LOOK_S = 0.5


def create_world(options: SatelliteViewOptions) -> World:
    """Load or draw the world, with the local origin of the vehicle where the options say.

    Raises:
        WorldError: it cannot be loaded or drawn.
    """
    if options.world:
        world = load_world(options.world, options.gsd or None, options.labels or None)
    else:
        world = draw_world(options.world_seed, options.world_size, options.world_gsd)
    return replace(world, centre_north_m=-options.start_y, centre_east_m=-options.start_x)


class SatelliteViewNode(PeaceNode):
    """Renders the newest pose at the camera's rate, stamped with that pose."""

    def __init__(self, **options: Any) -> None:
        """Load or draw the world and follow the vehicle.

        Raises:
            PeaceError: parameters or world cannot be used.
        """
        super().__init__('satellite_view', *SATELLITE_VIEW, **options)
        chosen = self.filled(SatelliteViewOptions)
        placed = self.filled(CameraOptions)
        self._camera = replace(placed.camera, distortion=chosen.lens)
        self._view = NadirCamera(create_world(chosen), self._camera, placed.mount)
        self._period_ns = round(1e9 / chosen.rate)
        self._due_ns: int | None = None
        self._said_mirrored = False
        self._image_out = self.create_publisher(Image, 'image', IMAGE_OUT)
        self._info_out = self.create_publisher(CameraInfo, 'camera_info', RESULT)
        self._worker = NewestWorker(self._render, self._complain, self.fail, 'satellite_view')
        self._seen_s = time.monotonic()
        self._source = self._create_source(chosen)
        self.create_timer(_LOOK_S, self._explain, clock=Clock(clock_type=ClockType.STEADY_TIME))
        east_m, north_m = self._view.world.size_m
        self.get_logger().info(
            f'ready: world {self._view.world.name} of {east_m:.0f} x {north_m:.0f} m, '
            f'{self._view.world.gsd_m:.3f} m/px'
        )

    def _create_source(self, options: SatelliteViewOptions) -> PoseSource:
        if options.pose_mavlink:
            return MavlinkSource(
                self, self._on_pose, options.pose_mavlink, options.pose_signing_key_file
            )
        if options.pose_source == 'twist':
            return TwistSource(self, self._on_pose, options.start_altitude, options.twist_timeout)
        return TopicSource(self, self._on_pose)

    def _on_pose(self, pose: Pose) -> None:
        """Keep the frame rate by the stamps, so that it holds on any clock."""
        self._seen_s = time.monotonic()
        due_ns, period_ns = self._due_ns, self._period_ns
        if due_ns is not None and due_ns - 2 * period_ns < pose.stamp_ns < due_ns:
            return
        late = due_ns is None or not due_ns <= pose.stamp_ns < due_ns + period_ns
        self._due_ns = (pose.stamp_ns if late or due_ns is None else due_ns) + period_ns
        self._worker.offer(pose)

    def _explain(self) -> None:
        """Say why nothing is seen, after a while without a pose."""
        if time.monotonic() - self._seen_s >= SILENT_S and self._source.problem:
            self.say('camera', f'waiting for the camera: {self._source.problem}')

    def _render(self, pose: Pose) -> None:
        view = self._view.view(pose)
        # Before the image, which it belongs to.
        size_px = self._camera.width_px, self._camera.height_px
        self._info_out.publish(camera_info(size_px, self._camera, pose.stamp_ns, CAMERA_FRAME))
        self._image_out.publish(image_message(view.image_rgb, 'rgb8', pose.stamp_ns))
        if view.mirrored and not self._said_mirrored:
            self._said_mirrored = True
            self.get_logger().warning(
                f'the view at {pose.altitude_agl_m:.0f} m reaches beyond the world, which is '
                'continued by mirroring: what is seen there does not exist'
            )

    def _complain(self, error: PeaceError) -> None:
        self.say(type(error).__name__, f'no image: {error}')

    def close(self) -> None:
        """Stop the worker and release the line."""
        self._source.close()
        self._worker.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(SatelliteViewNode, args)


if __name__ == '__main__':
    sys.exit(main())

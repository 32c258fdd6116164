# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The camera topic: rate, losses, age of the stamps, encoding and geometry."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan, degrees
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import PeaceError
from peace_ros.core.messages import frame_from_message, stamp_ns_of
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.lab.doctor.finding import Finding, Findings, fine, mend, not_checked, of_error
from peace_ros.nodes.qos import IMAGE_IN, RESULT

KINDS = {'sensor_msgs/msg/Image': Image, 'sensor_msgs/msg/CompressedImage': CompressedImage}
OUR_OWN = ('heatmap', 'depth', 'overlay')
"""Last words of topics with images that are not a camera's."""
DISCOVERY_S = 2.0
SILENCE_S = 3.0
"""After the discovery; a late subscriber may wait 2.5 s for its first message."""
COUNT_S = 2.5
LEAST_HZ = 2.0
MOST_LOST = 0.1
OLDEST_S = 1.0
AHEAD_S = 0.1
ASPECT_TOLERANCE = 0.01
"""As the segmentation allows it from frame to frame."""


@dataclass
class CameraHeard:
    """What came on the topic of a camera."""

    topic: str
    publishers: int = 0
    has_clock: bool = False
    """Somebody publishes /clock, so stamps need not be those of this computer."""
    stamps_ns: list[int] = field(default_factory=list)
    received_ns: list[int] = field(default_factory=list)
    """Clock of this computer."""
    newest: Any = None
    info: Any = None
    info_topic: str = ''

    @property
    def rate_hz(self) -> float:
        """Frames per second by their receipt."""
        if len(self.received_ns) < 2:
            return 0.0
        return (len(self.received_ns) - 1) / (self.received_ns[-1] - self.received_ns[0]) * 1e9

    @property
    def lost_share(self) -> float:
        """Frames that the stamps have and that did not come, of all; 0 to 1."""
        gaps_ns = np.diff(np.asarray(self.stamps_ns, np.int64))
        if gaps_ns.size < 3 or gaps_ns.min() <= 0:
            return 0.0
        # The shortest gaps are those between neighbours; the median would be two periods where
        # every other frame is lost.
        period_ns = float(np.quantile(gaps_ns, 0.1))
        expected = float(gaps_ns.sum()) / period_ns
        return max(0.0, 1.0 - gaps_ns.size / expected)


class CameraListener:
    """A node that listens to images for a few seconds."""

    def __init__(self) -> None:
        """Start a node in a context of its own."""
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node('peace_doctor', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def image_topics(self) -> list[str]:
        """Return the topics that may be a camera's; waits for the discovery."""
        self._spin_for(DISCOVERY_S)
        return sorted(
            name
            for name, kinds in self._node.get_topic_names_and_types()
            if KINDS.keys() & set(kinds)
            and not set(name.split('/')) & set(OUR_OWN)
            and self._node.count_publishers(name)
        )

    def listen(self, topic: str) -> CameraHeard:
        """Return what came, raw or compressed, whichever the topic has."""
        full = self._node.resolve_topic_name(topic)
        heard = CameraHeard(full, info_topic=f'{_base(full).rpartition("/")[0]}/camera_info')

        def take(message: Any) -> None:
            heard.stamps_ns.append(stamp_ns_of(message))
            heard.received_ns.append(time.time_ns())
            heard.newest = message

        def take_info(message: Any) -> None:
            heard.info = message

        self._node.create_subscription(self._kind_of(full), full, take, IMAGE_IN)
        self._node.create_subscription(CameraInfo, heard.info_topic, take_info, RESULT)
        deadline_s, is_counting = time.monotonic() + SILENCE_S, False
        while time.monotonic() < deadline_s:
            self._executor.spin_once(timeout_sec=0.05)
            if heard.stamps_ns and not is_counting:
                deadline_s, is_counting = time.monotonic() + COUNT_S, True
        heard.publishers = self._node.count_publishers(full)
        heard.has_clock = self._node.count_publishers('/clock') > 0
        return heard

    def _kind_of(self, topic: str) -> Any:
        """Return the type of a topic's images; an Image when nobody publishes any in time."""
        deadline_s = time.monotonic() + DISCOVERY_S
        while time.monotonic() < deadline_s:
            for name, kinds in self._node.get_topic_names_and_types():
                if name == topic and (known := KINDS.keys() & set(kinds)):
                    return KINDS[min(known)]
            self._spin_for(0.1)
        return Image

    def _spin_for(self, seconds: float) -> None:
        deadline_s = time.monotonic() + seconds
        while time.monotonic() < deadline_s:
            self._executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """End the node."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def _base(topic: str) -> str:
    return topic.removesuffix('/compressed')


def find_camera(listener: CameraListener, topic: str) -> CameraHeard | Finding:
    """Return what was heard of a camera, or why there is none.

    Args:
        listener: Listens.
        topic: Of the images; empty: the only one that there is.
    """
    if not topic:
        topics = listener.image_topics()
        # A driver publishes both forms of one camera.
        cameras = sorted({_base(each) for each in topics})
        if len(cameras) != 1:
            found = f'several: {", ".join(cameras)}' if cameras else 'none is published here'
            return not_checked(f'camera topic: {found}', 'give --image TOPIC')
        topic = cameras[0] if cameras[0] in topics else topics[0]
    heard = listener.listen(topic)
    if heard.newest is None:
        found = f'no image came on {heard.topic} within {SILENCE_S:g} s'
        if not heard.publishers:
            return mend(found, 'start the camera driver, or name its topic with --image')
        return mend(
            f'{found}, though {heard.publishers} publish it',
            'check that the camera works, that the images fit shared memory, and that both sides '
            'use the same middleware',
        )
    return heard


def judge_camera(heard: CameraHeard, options: CameraOptions) -> Findings:
    """Yield what is right and wrong with what was heard.

    Args:
        heard: Of the camera.
        options: As the parameters of the landing node describe it.
    """
    try:
        height, width = frame_from_message(heard.newest).image_rgb.shape[:2]
    except PeaceError as error:
        yield of_error(error)
        return
    encoding = getattr(heard.newest, 'encoding', '') or heard.newest.format
    found = f'{heard.topic}: {width} x {height} px, {encoding}, {heard.rate_hz:.1f} Hz'
    figures = {
        'topic': heard.topic,
        'rate_hz': round(heard.rate_hz, 2),
        'lost_share': round(heard.lost_share, 3),
        'width_px': width,
        'height_px': height,
    }
    if heard.rate_hz < LEAST_HZ:
        yield mend(found, f'let the camera give at least {LEAST_HZ:g} Hz', **figures)
    elif heard.lost_share > MOST_LOST:
        yield mend(
            f'{found}, {100 * heard.lost_share:.0f} % of the frames are lost by their stamps',
            'enlarge the shared-memory segment, see ROS and DDS below, or end other processes',
            **figures,
        )
    else:
        yield fine(found, **figures)
    if heard.publishers > 1:
        yield mend(
            f'{heard.publishers} publish {heard.topic}: which camera is below is not known',
            'end all but one',
        )
    yield from _judge_stamps(heard)
    yield from _judge_geometry(heard, options, width, height)


def _judge_stamps(heard: CameraHeard) -> Findings:
    if heard.has_clock:
        yield not_checked('age of the stamps: /clock is published, so the time is simulated')
        return
    ages_s = np.subtract(heard.received_ns, heard.stamps_ns) / 1e9
    age_s = float(np.median(ages_s))
    found = f'images are {age_s * 1000:.0f} ms old when they arrive'
    if -AHEAD_S <= age_s <= OLDEST_S:
        yield fine(found, image_age_s=round(age_s, 4))
        return
    yield mend(
        f'the stamps of the images are {abs(age_s):.1f} s '
        f'{"behind" if age_s > 0 else "ahead of"} the clock',
        f'let the driver stamp with the ROS clock at exposure; at most {OLDEST_S:g} s are useful',
        image_age_s=round(age_s, 4),
    )


def _judge_geometry(
    heard: CameraHeard, options: CameraOptions, width: int, height: int
) -> Findings:
    info = heard.info
    if info is not None and info.k[0] > 0.0 and info.width and info.height:
        hfov_deg = degrees(2.0 * atan(info.width / (2.0 * info.k[0])))
        model = info.distortion_model or 'no distortion'
        found = (
            f'{heard.info_topic}: {info.width} x {info.height} px, {hfov_deg:.1f} degrees '
            f'horizontally, {model}'
        )
        if not _same_aspect(width / height, info.width / info.height):
            yield mend(
                f'{found}, but the images are {width} x {height} px',
                'calibrate the camera at the size at which it is used',
            )
            return
        # The nodes project with the calibration; the parameters do not matter then.
        yield fine(found, hfov_deg=round(hfov_deg, 2))
        return
    yield fine(f'no calibration on {heard.info_topic}: the parameters count')
    yield from _compare(options, (width, height))


def _compare(options: CameraOptions, size_px: Sequence[int]) -> Findings:
    width, height = size_px
    told = f'camera_width {options.camera_width}, camera_height {options.camera_height}'
    if not _same_aspect(width / height, options.camera_width / options.camera_height):
        yield mend(
            f'the images are {width} x {height} px, the parameters of the landing node say {told}: '
            'the ground would be stretched',
            f'set camera_width: {width} and camera_height: {height} of the landing node',
        )
    else:
        yield fine(
            f'the parameters of the landing node fit: {told}, {options.camera_fov:.1f} degrees'
        )


def _same_aspect(one: float, other: float) -> bool:
    return abs(one / other - 1.0) <= ASPECT_TOLERANCE

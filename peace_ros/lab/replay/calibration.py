# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag says of the camera that took its images: calibration and mount."""

from __future__ import annotations

from typing import Any

from peace_ros.core.domain import NADIR, ConfigurationError, Mount, RecordingError
from peace_ros.core.messages import camera_info_topic, is_rectified
from peace_ros.core.transforms import StaticTransforms
from peace_ros.recording import BagReader

DEFAULT_FOV_DEG = 73.0
_CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'
_TF_STATIC, _TF_MESSAGE = '/tf_static', 'tf2_msgs/msg/TFMessage'
_VEHICLE_FRAME = 'base_link'


class RecordedCalibration:
    """The CameraInfo that belongs to the images of a bag, and the mount by /tf_static.

    Args:
        bag: The open bag.
        image_topic: Of the images; it has messages.
        is_wanted: False where the user gives the field of view.
        remarks: Is told what was assumed, and what was taken from /tf_static.

    Raises:
        RecordingError: it holds no calibration, or there are only those of other cameras.
    """

    def __init__(
        self, bag: BagReader, image_topic: str, *, is_wanted: bool, remarks: list[str]
    ) -> None:
        frame_id = _first(bag, image_topic).header.frame_id
        topic = _own_topic(bag, image_topic, frame_id) if is_wanted else None
        self.topics = () if topic is None else (topic,)
        """The topic of the calibration, none where there is none."""
        self.first: Any = None if topic is None else _first(bag, topic)
        """Its first message, which also counts for images before it."""
        self.mount = _recorded_mount(bag, frame_id)
        """Nadir where /tf_static says nothing of the camera."""
        if topic is not None:
            _refuse_uncalibrated(bag, topic, self.first, rectified=is_rectified(image_topic))
        elif is_wanted:
            remarks.append(
                f'no camera_info beside {image_topic}: a field of view of {DEFAULT_FOV_DEG:g} deg '
                'without distortion is assumed (--fov)'
            )
        if self.mount != NADIR:
            remarks.append(f'the mount of the camera is that of {_TF_STATIC}, unless it is given')


def _first(bag: BagReader, topic: str) -> Any:
    for _, _, message in bag.messages([topic]):
        return message
    raise RecordingError(f'topic {topic} of bag {bag.path} has 0 messages: choose another')


def _own_topic(bag: BagReader, image_topic: str, frame_id: str) -> str | None:
    """Return the topic beside the images, else the only one of their frame_id."""
    found = [topic for topic in bag.find([_CAMERA_INFO]) if bag.count(topic)]
    beside = camera_info_topic(image_topic)
    if beside in found or not found:
        return beside if found else None
    same = [each for each in found if _first(bag, each).header.frame_id == frame_id]
    if len(same) == 1:
        return same[0]
    raise RecordingError(
        f'bag {bag.path}: none of {", ".join(found)} is beside {image_topic}, and {len(same)} of '
        f'them have its frame_id {frame_id!r}: give --fov'
    )


def _refuse_uncalibrated(bag: BagReader, topic: str, info: Any, *, rectified: bool) -> None:
    focal_px = float((info.p if rectified else info.k)[0])
    if not focal_px > 0.0:
        raise RecordingError(
            f'{topic} of bag {bag.path} with focal length {focal_px} px is not calibrated: '
            'give --fov'
        )


def _recorded_mount(bag: BagReader, frame_id: str) -> Mount:
    transforms = StaticTransforms()
    if bag.topics.get(_TF_STATIC) == _TF_MESSAGE:
        for _, _, message in bag.messages([_TF_STATIC]):
            transforms.add(message)
    try:
        return transforms.mount(_VEHICLE_FRAME, frame_id)
    except ConfigurationError:
        return NADIR

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 2 <-> the nouns of the domain, for recordings (no rclpy needed).

Readers work on any object with the fields of the message, be it from rosbags or from rclpy.
Builders make messages of the rosbags type store.
"""

from __future__ import annotations

from math import atan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Pose, RecordingError, VehicleError
from peace_ros.core.images import jpeg_from_rgb, rgb_from_message
from peace_ros.core.poses import pose_from_enu_flu
from peace_ros.recording.bag import TYPESTORE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

IMAGE_TYPES = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage')
POSE_TYPES = (
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'nav_msgs/msg/Odometry',
)

_NS = 1_000_000_000
_TYPES = TYPESTORE.types


def stamp_ns_of(message: Any) -> int:
    """Return the stamp of a message's header in nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def frame_from_message(message: Any) -> Frame:
    """Return the frame of an Image or CompressedImage.

    Raises:
        ImageError: unknown encoding, impossible size, or bytes that are no whole image.

    """
    return Frame(rgb_from_message(message), stamp_ns_of(message))


def pose_from_message(message: Any) -> Pose:
    """Return the pose of a message of :data:`POSE_TYPES` (ENU, FLU; ground at z = 0).

    Raises:
        RecordingError: a number is not finite, or the attitude is no rotation.

    """
    pose = message.pose
    pose = pose.pose if hasattr(pose, 'pose') else pose
    try:
        return pose_from_enu_flu(stamp_ns_of(message), pose.position, pose.orientation)
    except VehicleError as error:
        raise RecordingError(str(error)) from error


def fov_x_rad_of(camera_info: Any) -> float:
    """Return the full horizontal field of view of a CameraInfo.

    Raises:
        RecordingError: it was never calibrated (focal length 0).

    """
    focal_px, width_px = float(camera_info.k[0]), int(camera_info.width)
    if not focal_px > 0.0 or width_px < 1:
        raise RecordingError(
            f'camera_info with focal length {focal_px} px and width {width_px} px is not '
            'calibrated: give --fov'
        )
    return 2.0 * atan(width_px / (2.0 * focal_px))


def header(stamp_ns: int, frame_id: str = '') -> Any:
    """Return a std_msgs/Header."""
    time = _TYPES['builtin_interfaces/msg/Time'](sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)
    return _TYPES['std_msgs/msg/Header'](stamp=time, frame_id=frame_id)


def mono8_image(grey: NDArray[np.uint8], stamp_ns: int, frame_id: str = 'camera') -> Any:
    """Return a sensor_msgs/Image of a height x width uint8 array."""
    height, width = grey.shape
    return _TYPES['sensor_msgs/msg/Image'](
        header=header(stamp_ns, frame_id),
        height=height,
        width=width,
        encoding='mono8',
        is_bigendian=0,
        step=width,
        data=np.ascontiguousarray(grey).reshape(-1),
    )


def jpeg_image(
    image_rgb: NDArray[np.uint8], stamp_ns: int, frame_id: str = 'camera', quality: int = 90
) -> Any:
    """Return a sensor_msgs/CompressedImage (JPEG) of a height x width x 3 uint8 RGB array."""
    return _TYPES['sensor_msgs/msg/CompressedImage'](
        header=header(stamp_ns, frame_id),
        format='rgb8; jpeg compressed bgr8',
        data=np.frombuffer(jpeg_from_rgb(image_rgb, quality), np.uint8),
    )


def diagnostic_array(
    stamp_ns: int, name: str, level: int, sentence: str, values: Mapping[str, str]
) -> Any:
    """Return a diagnostic_msgs/DiagnosticArray with one status; level 0 ok, 1 warn, 2 error."""
    pair = _TYPES['diagnostic_msgs/msg/KeyValue']
    status = _TYPES['diagnostic_msgs/msg/DiagnosticStatus'](
        level=level,
        name=name,
        message=sentence,
        hardware_id='',
        values=[pair(key=key, value=value) for key, value in values.items()],
    )
    return _TYPES['diagnostic_msgs/msg/DiagnosticArray'](header=header(stamp_ns), status=[status])


def diagnostic_values(message: Any) -> dict[str, str]:
    """Return the key/value pairs of the first status of a DiagnosticArray."""
    statuses: Sequence[Any] = message.status
    if not statuses:
        return {}
    return {each.key: each.value for each in statuses[0].values}


def pose_stamped(
    stamp_ns: int,
    position_enu: tuple[float, float, float],
    attitude_enu_flu: tuple[float, float, float, float],
    frame_id: str = 'map',
) -> Any:
    """Return a geometry_msgs/PoseStamped (ENU metres; quaternion w, x, y, z)."""
    x, y, z = position_enu
    qw, qx, qy, qz = attitude_enu_flu
    pose = _TYPES['geometry_msgs/msg/Pose'](
        position=_TYPES['geometry_msgs/msg/Point'](x=x, y=y, z=z),
        orientation=_TYPES['geometry_msgs/msg/Quaternion'](x=qx, y=qy, z=qz, w=qw),
    )
    return _TYPES['geometry_msgs/msg/PoseStamped'](header=header(stamp_ns, frame_id), pose=pose)

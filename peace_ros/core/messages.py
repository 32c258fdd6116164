# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS messages <-> the nouns of the domain, for messages of rclpy and of rosbags alike.

Readers take any object with the fields of the message. :class:`MessageBuilder` makes messages of
whatever classes it is given. Stamps are carried over, never renewed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import (
    Camera,
    DepthImage,
    Distortion,
    Frame,
    Heatmap,
    ImageError,
    Pose,
    Prompt,
    VehicleError,
)
from peace_ros.core.domain.camera import UPRIGHT
from peace_ros.core.domain.geometry import attitude_enu_flu_to_ned_frd, enu_to_ned
from peace_ros.core.images import jpeg_from_rgb, pixels_from_raw, rgb_from_message
from peace_ros.core.optics import check_lens
from peace_ros.core.prompting.pairs import prompt_from_pairs

NANOSECONDS = 1_000_000_000
CAMERA_FRAME = 'camera'
_DEPTHS = {'32FC1': 'f4', '16UC1': 'u2'}
"""Encoding of depth images -> kind of their values."""
_LENGTHS = (0.9, 1.1)
"""Between which a quaternion's length counts as rounding; beyond, it is no rotation."""


def ns_from_time(stamp: Any) -> int:
    """Return the nanoseconds of a builtin_interfaces/Time."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def stamp_ns_of(message: Any) -> int:
    """Return the stamp of a message's header in nanoseconds."""
    return ns_from_time(message.header.stamp)


def frame_from_message(message: Any, info: Any = None, *, rectified: bool = False) -> Frame:
    """Return the frame of an Image or CompressedImage.

    Args:
        message: the image.
        info: the CameraInfo of the camera, None where it is not known.
        rectified: the image was rectified, as image_proc does.

    Raises:
        PeaceError: image or calibration cannot be used, or they do not belong together.
    """
    frame = Frame(rgb_from_message(message), stamp_ns_of(message))
    if info is None:
        return frame
    return replace(frame, camera=camera_from_info(info, frame.size_px, rectified=rectified))


def camera_info_topic(image_topic: str) -> str:
    """Return the topic of the CameraInfo of an image topic: its sibling, as in image_transport."""
    return image_topic.removesuffix('/compressed').rpartition('/')[0] + '/camera_info'


def is_rectified(image_topic: str) -> bool:
    """Return whether a topic holds rectified images by its name: ``image_rect``, or with more."""
    name = image_topic.removesuffix('/compressed').rpartition('/')[2]
    return 'rect' in name.split('_')


def camera_from_info(info: Any, size_px: tuple[int, int], *, rectified: bool) -> Camera | None:
    """Return the camera of a CameraInfo, None where it is not calibrated (focal length 0).

    Args:
        info: the message. K and D count for a raw image, P and R for a rectified one; both are
            those of the whole sensor, of which binning and region of interest are read out.
        size_px: width and height of the image that it came with.
        rectified: see :func:`frame_from_message`.

    Raises:
        PeaceError: it cannot be that of the image.
    """
    matrix = np.reshape(info.p, (3, 4)) if rectified else np.reshape(info.k, (3, 3))
    if matrix[0, 0] == 0.0:
        return None
    roi, binning = info.roi, (max(1, int(info.binning_x)), max(1, int(info.binning_y)))
    part = (int(roi.width or info.width), int(roi.height or info.height))
    told = part[0] // binning[0], part[1] // binning[1]
    if told != size_px:
        raise ImageError(
            f'camera_info describes {told[0]} x {told[1]} px, the image has {size_px[0]} x '
            f'{size_px[1]} px: calibrate the camera at the size that it publishes'
        )
    focal = (float(matrix[axis, axis]) / binning[axis] for axis in (0, 1))
    offsets = int(roi.x_offset), int(roi.y_offset)
    # Pixel centres are whole numbers, before binning and after it.
    centre = (
        (float(matrix[axis, 2]) - offsets[axis] + 0.5) / binning[axis] - 0.5 for axis in (0, 1)
    )
    bends = not rectified and any(info.d)
    distortion = Distortion(info.distortion_model, tuple(map(float, info.d))) if bends else None
    turn = tuple(map(float, info.r)) if rectified and any(info.r) else UPRIGHT
    camera = Camera(*size_px, _pair(focal), _pair(centre), distortion, turn)
    check_lens(camera)
    return camera


def _pair(values: Iterable[float]) -> tuple[float, float]:
    first, second = values
    return first, second


def heatmap_from_image(message: Any, info: Any = None) -> Heatmap:
    """Return the heatmap of a mono8 Image; any other encoding is an ImageError.

    Args:
        message: the heatmap.
        info: the CameraInfo of its frame as segmentation publishes it, None where it is not known.

    Raises:
        PeaceError: one of them cannot be used.
    """
    if message.encoding != 'mono8':
        raise ImageError(f'heatmap encoding {message.encoding!r}: publish it as mono8')
    levels = pixels_from_raw(
        message.encoding, message.width, message.height, message.step, message.data
    )
    safety = levels[:, :, 0].astype(np.float32) / np.float32(255.0)
    if info is None:
        return Heatmap(safety, stamp_ns_of(message))
    size_px = int(info.width), int(info.height)
    camera = camera_from_info(info, size_px, rectified=not any(info.d))
    return Heatmap(safety, stamp_ns_of(message), size_px, camera)


def heatmap_levels(heatmap: Heatmap) -> NDArray[np.uint8]:
    """Return a heatmap as mono8: 255 is certainly safe; what is not a number becomes 0."""
    safety = np.nan_to_num(heatmap.safety, nan=0.0, posinf=0.0, neginf=0.0)
    levels: NDArray[np.uint8] = np.rint(np.clip(safety, 0.0, 1.0) * 255.0).astype(np.uint8)
    return levels


def depth_from_image(message: Any) -> DepthImage:
    """Return the depth of a 32FC1 (metres) or 16UC1 (millimetres, 0 unknown) Image, in metres.

    Raises:
        ImageError: another encoding, or the size is wrong.
    """
    if message.encoding not in _DEPTHS:
        raise ImageError(f'depth encoding {message.encoding!r}: publish {" or ".join(_DEPTHS)}')
    kind = np.dtype(_DEPTHS[message.encoding])
    row_bytes, size = message.width * kind.itemsize, message.height * message.step
    if message.width < 1 or message.step < row_bytes or len(message.data) != size:
        raise ImageError(
            f'depth image {message.width} x {message.height}, {message.step} bytes per row: '
            f'{len(message.data)} bytes in place of {size}'
        )
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    order = kind.newbyteorder('>' if message.is_bigendian else '<')
    depth = np.ascontiguousarray(rows[:, :row_bytes]).view(order).astype(np.float32)
    if kind.kind == 'u':
        depth = np.where(depth > 0.0, depth / np.float32(1000.0), np.float32(np.nan))
    return DepthImage(depth, stamp_ns_of(message))


def pose_from_message(message: Any) -> Pose:
    """Return the pose (NED, FRD) of a message in ENU, FLU; the ground is at z = 0.

    Args:
        message: PoseStamped, PoseWithCovarianceStamped or Odometry.

    Raises:
        VehicleError: a value is not finite or the quaternion is not of unit length.

    """
    pose = message.pose
    pose = pose.pose if hasattr(pose, 'pose') else pose
    return _pose_from_enu_flu(stamp_ns_of(message), pose.position, pose.orientation)


def pose_from_transform(transform: Any) -> Pose:
    """Return the pose of a tf transform local frame -> vehicle, as :func:`pose_from_message`."""
    body = transform.transform
    return _pose_from_enu_flu(stamp_ns_of(transform), body.translation, body.rotation)


def _pose_from_enu_flu(stamp_ns: int, position: Any, orientation: Any) -> Pose:
    """Return the pose (NED, FRD) of a position in ENU and an attitude FLU in ENU (REP-103).

    The ground is taken to be at z = 0.

    Args:
        stamp_ns: of the message.
        position: has x, y and z in metres: Point or Vector3.
        orientation: has w, x, y and z: Quaternion.

    Raises:
        VehicleError: a value is not finite or the quaternion is not of unit length.
    """
    enu = float(position.x), float(position.y), float(position.z)
    turn = tuple(float(getattr(orientation, each)) for each in 'wxyz')
    length = sqrt(sum(each * each for each in turn))
    if not all(map(isfinite, (*enu, *turn))) or not _LENGTHS[0] < length < _LENGTHS[1]:
        raise VehicleError(
            f'pose {enu} with quaternion {turn} (length {length:.2f}) at {stamp_ns} ns: it must '
            'be in finite metres with a quaternion of length 1'
        )
    w, x, y, z = (each / length for each in turn)
    north, east, down = enu_to_ned(*enu)
    return Pose(stamp_ns, north, east, down, attitude_enu_flu_to_ned_frd((w, x, y, z)), -down)


def diagnostic_values(message: Any) -> dict[str, str]:
    """Return the key/value pairs of all statuses of a DiagnosticArray."""
    return {pair.key: pair.value for status in message.status for pair in status.values}


def prompt_from_message(message: Any) -> Prompt:
    """Return the prompt of its DiagnosticArray; ConfigurationError when it holds none."""
    return prompt_from_pairs(diagnostic_values(message), stamp_ns_of(message))


class MessageBuilder:
    """Makes the messages that flights and recordings share."""

    def __init__(self, class_of: Callable[[str, str], Any], octets: Callable[[bytes], Any]) -> None:
        """Take the classes to build from.

        Args:
            class_of: (package, name) -> class that takes its fields as keywords.
            octets: makes what those classes want for a field uint8[].
        """
        self._class = class_of
        self._octets = octets

    def time(self, at_ns: int) -> Any:
        """Return a builtin_interfaces/Time."""
        sec, nanosec = divmod(at_ns, NANOSECONDS)
        return self._class('builtin_interfaces', 'Time')(sec=sec, nanosec=nanosec)

    def header(self, at_ns: int, frame_id: str = '') -> Any:
        """Return a std_msgs/Header."""
        return self._class('std_msgs', 'Header')(stamp=self.time(at_ns), frame_id=frame_id)

    def image(
        self, pixels: NDArray[np.uint8], encoding: str, at_ns: int, frame_id: str = CAMERA_FRAME
    ) -> Any:
        """Return the Image of a height x width (mono8) or height x width x 3 (rgb8) array."""
        return self._class('sensor_msgs', 'Image')(
            header=self.header(at_ns, frame_id),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=pixels.size // pixels.shape[0],
            data=self._octets(pixels.tobytes()),
        )

    def heatmap(self, heatmap: Heatmap, frame_id: str = CAMERA_FRAME) -> Any:
        """Return the mono8 Image of a heatmap."""
        return self.image(heatmap_levels(heatmap), 'mono8', heatmap.stamp_ns, frame_id)

    def jpeg(
        self,
        image_rgb: NDArray[np.uint8],
        at_ns: int,
        quality: int = 90,
        frame_id: str = CAMERA_FRAME,
    ) -> Any:
        """Return the JPEG CompressedImage of a height x width x 3 RGB array."""
        return self._class('sensor_msgs', 'CompressedImage')(
            header=self.header(at_ns, frame_id),
            format='rgb8; jpeg compressed bgr8',
            data=self._octets(jpeg_from_rgb(image_rgb, quality)),
        )

    def diagnostic_array(
        self, at_ns: int, name: str, level: Any, sentence: str, values: Iterable[tuple[str, str]]
    ) -> Any:
        """Return a DiagnosticArray of one status: a sentence and key/value pairs.

        ``level`` is 0 (ok), 1 (warn) or 2 (error); classes of rclpy want it as one byte.
        """
        pair = self._class('diagnostic_msgs', 'KeyValue')
        status = self._class('diagnostic_msgs', 'DiagnosticStatus')(
            level=level,
            name=name,
            message=sentence,
            hardware_id='',
            values=[pair(key=key, value=value) for key, value in values],
        )
        return self._class('diagnostic_msgs', 'DiagnosticArray')(
            header=self.header(at_ns), status=[status]
        )

    def pose_stamped(
        self,
        at_ns: int,
        position_enu: tuple[float, float, float],
        attitude_enu_flu: tuple[float, float, float, float],
        frame_id: str = 'map',
    ) -> Any:
        """Return a PoseStamped (ENU metres; quaternion w, x, y, z)."""
        x, y, z = position_enu
        qw, qx, qy, qz = attitude_enu_flu
        pose = self._class('geometry_msgs', 'Pose')(
            position=self._class('geometry_msgs', 'Point')(x=x, y=y, z=z),
            orientation=self._class('geometry_msgs', 'Quaternion')(x=qx, y=qy, z=qz, w=qw),
        )
        return self._class('geometry_msgs', 'PoseStamped')(
            header=self.header(at_ns, frame_id), pose=pose
        )

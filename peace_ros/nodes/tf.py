# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""tf by the buffer of tf2: the pose of the vehicle, and how its camera is mounted at each pose."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

import yaml
from rclpy.node import Node
from rclpy.time import Time

from peace_ros.core.domain import ConfigurationError, Mount, Pose, VehicleError
from peace_ros.core.transforms import end_of_chain, mount_from_transform

_WAITING = 256
_WAIT_NS = 500_000_000
"""A transform that moves may arrive so much later than the pose of its moment."""


class TfTree:
    """The transforms of /tf and /tf_static.

    Args:
        node: Subscribes.
        parameter: Which parameter asks for it.

    Raises:
        ConfigurationError: tf2_ros is not installed.
    """

    def __init__(self, node: Node, parameter: str) -> None:
        try:
            tf2 = import_module('tf2_ros')
        except ImportError as error:
            raise ConfigurationError(
                f'parameter {parameter} = tf needs the package tf2_ros: install it with ROS '
                f'(ros-jazzy-tf2-ros-py), or leave {parameter} as it is by default'
            ) from error
        self._error: type[Exception] = tf2.TransformException
        self._untimely: type[Exception] = tf2.ExtrapolationException
        self._buffer = tf2.Buffer()
        self._listener = tf2.TransformListener(self._buffer, node, spin_thread=False)

    def look_up(self, parent: str, child: str, stamp_ns: int = 0) -> Any:
        """Return the TransformStamped from a frame to one below it in the tree.

        Args:
            parent: where the chain begins, such as map.
            child: where it ends, such as base_link.
            stamp_ns: moment; 0: the newest at which the whole chain is known.

        Raises:
            ConfigurationError: there is no chain of frames between them.
            VehicleError: it is not known at that moment.
        """
        parent, child = parent.lstrip('/'), child.lstrip('/')
        try:
            return self._buffer.lookup_transform(parent, child, Time(nanoseconds=stamp_ns))
        except self._untimely as error:
            # It happens in every step while a transform is slower than the poses.
            raise VehicleError(f'tf from {parent} to {child}: {error}') from error
        except self._error as error:
            # To read all frames takes long.
            frames = yaml.safe_load(self._buffer.all_frames_as_yaml()) or {}
            parents = {name: about['parent'] for name, about in frames.items()}
            end = end_of_chain(parents, child, parent)
            if end != parent:
                raise ConfigurationError(
                    f'tf does not lead from {parent} to {child or "(no frame_id)"}: upwards it '
                    f'ends at {end or "(no name)"}: publish the transform {parent} to {end}'
                ) from error
            raise VehicleError(f'tf from {parent} to {child}: {error}') from error


class TfMounts:
    """Pairs each pose of the vehicle with the mount of its camera at that moment.

    Args:
        node: Subscribes.
        vehicle: Frame of the vehicle.

    Raises:
        ConfigurationError: tf2_ros is not installed.
    """

    def __init__(self, node: Node, vehicle: str) -> None:
        self._tf, self._vehicle = TfTree(node, 'mount_source'), vehicle
        self._optical: str | None = None
        self._waiting: deque[Pose] = deque(maxlen=_WAITING)
        self.problem = 'no heatmap has come yet that names the frame of its camera'
        """Why it is not known how the camera is mounted; empty while it is."""

    def see(self, optical: str) -> None:
        """Take the frame_id of the newest frame: an optical frame of REP-103."""
        self._optical = optical

    def of(self, poses: Sequence[Pose]) -> Iterator[tuple[Pose, Mount]]:
        """Yield the poses whose transform is known by now, oldest first."""
        self._waiting.extend(poses)
        while self._waiting and self._optical is not None:
            stamp_ns = self._waiting[0].stamp_ns
            try:
                found = self._tf.look_up(self._vehicle, self._optical, stamp_ns)
                mount = mount_from_transform(found)
            except ConfigurationError as error:
                self.problem = str(error)
                self._waiting.clear()
                return
            except VehicleError as error:
                if self._waiting[-1].stamp_ns - stamp_ns < _WAIT_NS:
                    return
                self.problem = str(error)
            else:
                self.problem = ''
                yield self._waiting.popleft(), mount
                continue
            self._waiting.popleft()

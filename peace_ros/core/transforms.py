# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Transforms of tf -> how the camera is mounted on its vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np

from peace_ros.core.domain import ConfigurationError, Mount
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import mount_from_optical, multiply, rotation_matrix

_LONGEST = 32
"""Transforms between two frames; more are a circle."""
_Placed = tuple[Quaternion, tuple[float, float, float]]
"""Rotation and translation (m)."""


def mount_from_transform(message: Any) -> Mount:
    """Return the mount of a camera out of the TransformStamped base_link -> optical frame.

    Raises:
        ConfigurationError: it is no rotation, or not finite.
    """
    return mount_from_optical(*_placed(message))


def end_of_chain(parents: Mapping[str, str], child: str, top: str) -> str:
    """Return the frame at which the way upwards from a frame ends: ``top``, or before it.

    Args:
        parents: frame -> the frame above it.
        child: where the way begins.
        top: where it shall end.
    """
    for _ in range(_LONGEST):
        if child == top or child not in parents:
            break
        child = parents[child]
    return child


def _placed(message: Any) -> _Placed:
    to, turn = message.transform.translation, message.transform.rotation
    q = (float(turn.w), float(turn.x), float(turn.y), float(turn.z))
    length = sqrt(sum(part * part for part in q)) or 1.0
    w, x, y, z = (part / length for part in q)
    return (w, x, y, z), (float(to.x), float(to.y), float(to.z))


class StaticTransforms:
    """Transforms of a recorded /tf_static, each from a parent to a child frame."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}
        self._placed: dict[str, _Placed] = {}

    def add(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage; a transform replaces the one that it had of this child."""
        for each in message.transforms:
            child = each.child_frame_id.lstrip('/')
            self._parents[child] = each.header.frame_id.lstrip('/')
            self._placed[child] = _placed(each)

    def mount(self, vehicle: str, optical: str) -> Mount:
        """Return how a camera sits on a vehicle.

        Args:
            vehicle: its frame (forward, left, up), an ancestor of that of the camera.
            optical: frame of the camera (REP-103: right, down in the picture, along the view).

        Raises:
            ConfigurationError: there is no chain of transforms between them, or one is no rotation.
        """
        frame, turn, offset = optical.lstrip('/'), (1.0, 0.0, 0.0, 0.0), np.zeros(3)
        end = end_of_chain(self._parents, frame, vehicle)
        if end != vehicle:
            raise ConfigurationError(
                f'/tf_static does not say how the camera is mounted: from '
                f'{optical or "(no frame_id)"} upwards it ends at {end or "(no name)"}, not at '
                f'{vehicle}: publish the transform {vehicle} to {end}'
            )
        while frame != vehicle:
            q, to = self._placed[frame]
            turn, offset = multiply(q, turn), np.array(to) + rotation_matrix(q) @ offset
            frame = self._parents[frame]
        x, y, z = map(float, offset)
        return mount_from_optical(turn, (x, y, z))

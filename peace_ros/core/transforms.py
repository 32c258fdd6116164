# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The static transforms of a vehicle: how its camera is mounted, as tf has it."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from peace_ros.core.domain import ConfigurationError, Mount
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import mount_from_optical, multiply, rotation_matrix

_LONGEST = 32
"""Transforms between vehicle and camera; more are a circle."""


class StaticTransforms:
    """Transforms of /tf_static, each from a parent to a child frame."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Quaternion, tuple[float, float, float]]] = {}

    def add(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage; a transform replaces the one that it had of this child."""
        for each in message.transforms:
            to, turn = each.transform.translation, each.transform.rotation
            q = (float(turn.w), float(turn.x), float(turn.y), float(turn.z))
            length = sqrt(sum(part * part for part in q)) or 1.0
            self._parents[each.child_frame_id.lstrip('/')] = (
                each.header.frame_id.lstrip('/'),
                (q[0] / length, q[1] / length, q[2] / length, q[3] / length),
                (float(to.x), float(to.y), float(to.z)),
            )

    def mount(self, vehicle: str, optical: str) -> Mount:
        """Return how a camera sits on a vehicle.

        Args:
            vehicle: its frame (forward, left, up), an ancestor of that of the camera.
            optical: frame of the camera (REP-103: right, down in the picture, along the view).

        Raises:
            ConfigurationError: there is no chain of transforms between them, or one is no rotation.
        """
        frame, turn, offset = optical.lstrip('/'), (1.0, 0.0, 0.0, 0.0), np.zeros(3)
        for _ in range(_LONGEST):
            if frame == vehicle:
                x, y, z = map(float, offset)
                return mount_from_optical(turn, (x, y, z))
            if frame not in self._parents:
                break
            frame, q, to = self._parents[frame]
            turn, offset = multiply(q, turn), np.array(to) + rotation_matrix(q) @ offset
        raise ConfigurationError(
            f'/tf_static does not say how the camera is mounted: from {optical or "(no frame_id)"} '
            f'upwards it ends at {frame or "(no name)"}, not at {vehicle}: publish the transform '
            f'{vehicle} to {frame}, or choose mount_source parameters'
        )

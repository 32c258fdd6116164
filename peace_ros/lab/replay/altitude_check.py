# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the altitudes of a recording agree with the scale of its pictures.

During a climb or a descent the pictures give the ratio of the heights at its ends, the poses their
difference. Both together give the height itself: a descent from 60 m to 50 m lets the ground grow
more than one from 180 m to 170 m.

Altitudes that were assumed have no true difference. Then only the ratios are compared.
"""

from __future__ import annotations

from math import log, log1p

from peace_ros.core.domain import Camera, Frame, Pose
from peace_ros.core.mapping.registration import View, small_grey
from peace_ros.core.mapping.scale import HeightChange, height_change

_LEAST_CHANGE_M = 3.0
_LEAST_SCALE = 0.08
"""Relative change of the height: less is not told apart from errors of the corners."""
_DOUBT = 0.3
"""Relative difference of the heights from which it is said."""
_DOUBT_OF_FACTORS = 0.15
"""The same of the factors by which heights change, where the altitudes were assumed."""


class AltitudeCheck:
    """Follows the frames of a replay.

    Args:
        assumed: The camera of frames that come without a calibration.
        are_recorded: The altitudes were measured; otherwise the user or a default gave them.
    """

    def __init__(self, assumed: Camera, *, are_recorded: bool = True) -> None:
        self._assumed = assumed
        self._are_recorded = are_recorded
        self._last: View | None = None
        self._first_m = 0.0
        self._ratio = 1.0
        self._doubt: tuple[float, float] | None = None
        self._factors: tuple[float, float, float, float] | None = None
        self._strength = _LEAST_SCALE
        self._furthest = log1p(_DOUBT_OF_FACTORS)

    def add(self, frame: Frame, pose: Pose) -> None:
        """Take a frame and the pose of the camera at its stamp, with the altitude as recorded."""
        view = View(small_grey(frame.image_rgb), pose)
        last, self._last = self._last, view
        change = None
        if last is not None:
            change = height_change(last, view, frame.camera or self._assumed)
        if not isinstance(change, HeightChange):
            self._first_m, self._ratio = pose.altitude_agl_m, 1.0
            return
        self._ratio *= change.ratio
        climbed_m, scale = pose.altitude_agl_m - self._first_m, self._ratio - 1.0
        if not self._are_recorded:
            self._compare_factors(pose.altitude_agl_m)
        elif abs(climbed_m) >= _LEAST_CHANGE_M and abs(scale) > self._strength:
            self._strength = abs(scale)
            self._doubt = self._first_m, climbed_m / scale

    def _compare_factors(self, altitude_m: float) -> None:
        if min(altitude_m, self._first_m) <= 0.0:
            return
        told = altitude_m / self._first_m
        apart = abs(log(told / self._ratio))
        if apart > self._furthest:
            self._furthest = apart
            self._factors = self._first_m, altitude_m, told, self._ratio

    def remark(self) -> str | None:
        """Return the doubt, None where there is none or nothing to judge by."""
        if self._factors is not None:
            first_m, last_m, told, seen = self._factors
            return (
                f'the altitudes are doubtful: from {first_m:.0f} m to {last_m:.0f} m the height '
                f'changes by the factor {told:.2f}, in the pictures by {seen:.2f}: give a true '
                '--altitude, or a --log'
            )
        if self._doubt is None:
            return None
        told_m, seen_m = self._doubt
        if seen_m > 0.0 and abs(told_m - seen_m) <= _DOUBT * seen_m:
            return None
        if seen_m <= 0.0:
            return 'the pictures grow where the altitude does: the altitudes do not belong to them'
        return (
            f'the altitudes are doubtful: by the scale of the pictures {told_m:.0f} m are about '
            f'{seen_m:.0f} m above ground: give --ground {told_m - seen_m:.0f}'
        )

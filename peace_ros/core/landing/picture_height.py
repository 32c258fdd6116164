# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Height above ground by the scale of the pictures, from the altitude at an engagement on."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import Camera
from peace_ros.core.mapping import HeightChange, View, height_change

_PERIOD_NS = 300_000_000
"""A picture is measured this often: at 3 m/s a vehicle sinks by 0.9 m meanwhile."""
_GAP_NS = 1_000_000_000
"""Without a measurement for so long the pictures begin again."""
_NEW_KEY_RATIO = 1.15
_NEW_KEY_WAY = 0.25
"""A new key picture after this change of the height, or this way over ground in heights."""


@dataclass(frozen=True)
class _ScaledView:
    view: View
    height_m: float
    """By the pictures."""


class PictureHeight:
    """Multiplies the ratios of heights between pictures, from the first altitude on.

    Each picture is compared with a key picture, which stays while enough of it is in view: a
    vehicle that hovers collects no error. Over a gap (no texture, no pictures) the height follows
    the altitude that the autopilot reports, and what they differed by before stays.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._taken_ns: int | None = None
        self._key: _ScaledView | None = None
        self._last: _ScaledView | None = None
        self.stamp_ns: int | None = None
        """Stamp of the newest picture that was measured, None before the first."""
        self.above_reported_m = 0.0
        """Height by the pictures minus the reported altitude, at that stamp."""

    def change_camera(self, camera: Camera) -> None:
        """Use another camera, and begin again."""
        self._camera = camera
        self.begin()

    def begin(self) -> None:
        """Begin with the altitude of the next picture."""
        self._taken_ns = self._key = self._last = self.stamp_ns = None
        self.above_reported_m = 0.0

    def take(self, view: View) -> None:
        """Take a picture with its attitude, and the altitude that was reported at its stamp."""
        now_ns, reported_m = view.pose.stamp_ns, view.pose.altitude_agl_m
        if not reported_m > 0.0 or (self._taken_ns or -_PERIOD_NS) + _PERIOD_NS > now_ns:
            return
        self._taken_ns = now_ns
        found = self._measured(view)
        if found is not None:
            self._last = found
            self.stamp_ns, self.above_reported_m = now_ns, found.height_m - reported_m
        elif self._last is None or now_ns - self._last.view.pose.stamp_ns > _GAP_NS:
            self._key = self._last = _ScaledView(view, reported_m + self.above_reported_m)

    def _measured(self, view: View) -> _ScaledView | None:
        """Return the height at a view; None where neither key nor last picture give it."""
        for base in (self._key, self._last):
            if base is None:
                return None
            change = height_change(base.view, view, self._camera)
            if isinstance(change, HeightChange):
                found = _ScaledView(view, base.height_m * change.ratio)
                span = max(change.ratio, 1.0 / change.ratio)
                if base is not self._key or span > _NEW_KEY_RATIO or change.moved > _NEW_KEY_WAY:
                    self._key = found
                return found
        return None

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which camera took a frame: the one that came with it, else that of the parameters."""

from __future__ import annotations

from peace_ros.core.domain import Camera, Heatmap

_SAME_SHAPE = 0.01
"""Relative difference of two aspect ratios that count as equal."""


class Calibration:
    """Says for each heatmap what took its frame, or why that is not known."""

    def __init__(self, assumed: Camera) -> None:
        """Take the camera of the parameters, for frames without a calibration."""
        self._assumed = assumed
        self._has_been_told = False

    def camera_of(self, heatmap: Heatmap) -> Camera | str:
        """Return the camera of the frame, or why the heatmap cannot be projected."""
        if heatmap.camera is not None:
            self._has_been_told = True
            return heatmap.camera
        if self._has_been_told:
            return 'its camera_info is missing, which the frames before it had'
        size = heatmap.frame_size_px
        height, width = heatmap.safety.shape
        agrees = (
            has_shape(self._assumed, width, height)
            if size is None
            else size == (self._assumed.width_px, self._assumed.height_px)
        )
        if agrees:
            return self._assumed
        found = f'a heatmap of {width} x {height}' if size is None else f'{size[0]} x {size[1]}'
        return (
            f'the frames have {found} px and no camera_info, the parameters camera_width and '
            f'camera_height say {self._assumed.width_px} x {self._assumed.height_px} px: publish '
            'camera_info beside the image, or set the parameters'
        )


def has_shape(camera: Camera, width_px: int, height_px: int) -> bool:
    """Return whether a picture of this size can be the whole frame, scaled."""
    ratio = width_px * camera.height_px / (height_px * camera.width_px)
    return abs(ratio - 1.0) <= _SAME_SHAPE

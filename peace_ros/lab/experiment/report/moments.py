# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of chosen runs, seen again: worlds depend on their seeds only, so none is stored."""

from __future__ import annotations

import base64
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ImageError, Label, Pose, is_safe
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.pipeline import Pipeline
from peace_ros.lab.experiment.places import START_ALTITUDE_M, Place, Start, open_camera
from peace_ros.lab.experiment.store import Row
from peace_ros.simulation.camera import NadirCamera

_OVERVIEW_M = 160.0
"""Altitude from which the picture of the path is taken."""
_STRIP = 5
_RED, _CYAN, _WHITE = (200, 30, 30), (40, 220, 255), (255, 255, 255)

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class RunPictures:
    """Data URIs of one run."""

    overview: str
    """The path from above; the start is a ring, the end a dot."""
    view: str
    """What the camera saw at the end."""
    truth: str
    """The same with unsafe ground in red, and the footprint."""
    heatmap: str
    """What the networks say of it; empty without a model."""
    strip: tuple[str, ...]
    """Views along the flight."""


def run_pictures(
    row: Row, place: Place, footprint_m: float, pipeline: Pipeline | None
) -> RunPictures:
    """Fly over the world of a run again, and take pictures.

    Args:
        row: of the file of flights.
        place: its world.
        footprint_m: radius of the vehicle on the ground.
        pipeline: of its configuration; None: no heatmap.

    Raises:
        WorldError: the world cannot be used.
    """
    start = Start(
        row['run'],
        row['world_seed'],
        row['start_east_m'],
        row['start_north_m'],
        row['start_heading_rad'],
    )
    camera = open_camera(place, start, CameraOptions().camera)
    poses = _poses(row)
    view = camera.view(poses[-1])
    heatmap = ''
    if pipeline is not None:
        try:
            safety = pipeline.segment(view.image_rgb).safety
            heatmap = _uri(_coloured(safety, view.image_rgb.shape[0]))
        except ImageError:
            heatmap = ''
    chosen = np.linspace(0, len(poses) - 1, _STRIP).round().astype(int)
    return RunPictures(
        overview=_uri(_overview(camera, poses)),
        view=_uri(view.image_rgb),
        truth=_uri(_with_truth(view.image_rgb, view.labels, camera, poses[-1], footprint_m)),
        heatmap=heatmap,
        strip=tuple(_uri(camera.view(poses[number]).image_rgb) for number in chosen),
    )


def _poses(row: Row) -> list[Pose]:
    """Return the poses of the track: level, besides the last."""
    level = (float(np.cos(row['start_heading_rad'] / 2)), 0.0, 0.0)
    quaternion = (*level, float(np.sin(row['start_heading_rad'] / 2)))
    columns = (row[f'track_{name}'] for name in ('time_s', 'north_m', 'east_m', 'altitude_m'))
    poses = [
        Pose(round(time_s * 1e9), north_m, east_m, -altitude_m, quaternion, altitude_m)
        for time_s, north_m, east_m, altitude_m in zip(*columns, strict=True)
    ]
    end: Any = tuple(row['end_quaternion_ned_frd'])
    return [*poses[:-1], replace(poses[-1], quaternion_ned_frd=end)]


def _overview(camera: NadirCamera, poses: list[Pose]) -> Image:
    middle = poses[len(poses) // 2]
    reach_m = max(
        abs(each.north_m - middle.north_m) + abs(each.east_m - middle.east_m) for each in poses
    )
    altitude_m = max(_OVERVIEW_M, START_ALTITUDE_M + 1.4 * reach_m)
    above = replace(
        middle,
        altitude_agl_m=altitude_m,
        down_m=-altitude_m,
        quaternion_ned_frd=(1.0, 0.0, 0.0, 0.0),
    )
    image: Image = camera.view(above).image_rgb.copy()
    points = np.array([_pixel(camera, above, each) for each in poses], np.int32)
    cv2.polylines(image, [points.reshape(-1, 1, 2)], False, _CYAN, 1, cv2.LINE_AA)
    cv2.circle(image, points[0].tolist(), 5, _WHITE, 1, cv2.LINE_AA)
    cv2.circle(image, points[-1].tolist(), 3, _RED, -1, cv2.LINE_AA)
    return image


def _pixel(camera: NadirCamera, above: Pose, place: Pose) -> tuple[int, int]:
    per_m = camera.camera.focal_px / above.altitude_agl_m
    cu, cv = camera.camera.centre_px
    return (
        round(cu + (place.east_m - above.east_m) * per_m),
        round(cv - (place.north_m - above.north_m) * per_m),
    )


def _with_truth(
    image: Image, labels: Image | None, camera: NadirCamera, pose: Pose, footprint_m: float
) -> Image:
    shown: Image = image.copy()
    if labels is not None:
        unsafe = (labels != Label.UNLABELED) & ~is_safe(labels)
        shown[unsafe] = (0.6 * shown[unsafe] + 0.4 * np.array(_RED)).astype(np.uint8)
    radius_px = round(footprint_m * camera.camera.focal_px / pose.altitude_agl_m)
    middle = tuple(round(each) for each in camera.camera.centre_px)
    cv2.circle(shown, middle, max(radius_px, 2), _CYAN, 1, cv2.LINE_AA)
    return shown


def _coloured(safety: NDArray[np.float32], side: int) -> Image:
    grey = (np.clip(safety, 0.0, 1.0) * 255.0).astype(np.uint8)
    large = cv2.resize(grey, (side, side), interpolation=cv2.INTER_NEAREST)
    return np.asarray(
        cv2.cvtColor(cv2.applyColorMap(large, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB), np.uint8
    )


def _uri(image: Image) -> str:
    data = cv2.imencode(
        '.jpg', cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 82]
    )
    return 'data:image/jpeg;base64,' + base64.b64encode(data[1].tobytes()).decode()

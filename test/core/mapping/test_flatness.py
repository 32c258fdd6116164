# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Depth closes ground that is rough, wherever the camera leans, and opens nothing."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, DepthImage, Heatmap, Pose
from peace_ros.core.domain.geometry import quaternion_from_euler, rotation_matrix
from peace_ros.core.mapping import MapParameters, RefusedLookError, SafetyMap

CAMERA = Camera.from_degrees(352, 352, 73.0)
S = 1_000_000_000
PX = 120


def pose_at(
    time_s: float = 0.0,
    altitude_m: float = 16.0,
    attitude_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    place: tuple[float, float] = (0.0, 0.0),
) -> Pose:
    q = quaternion_from_euler(*(radians(each) for each in attitude_deg))
    return Pose(round(time_s * S), *place, -altitude_m, q, altitude_m)


def measured(pose: Pose, boxes: tuple[tuple[float, float, float, float], ...] = ()) -> DepthImage:
    """Return what a sensor measures over level ground with boxes (north, east, width, height)."""
    camera = CAMERA.resized(PX, PX)
    v, u = np.mgrid[0:PX, 0:PX].astype(float)
    cu, cv = camera.centre_px
    body = np.stack((-(v - cv), u - cu, np.full((PX, PX), camera.focal_px))) / camera.focal_px
    north, east, down = np.tensordot(rotation_matrix(pose.quaternion_ned_frd), body, axes=1)
    depth = pose.altitude_agl_m / down
    for box_north, box_east, width, height in boxes:
        top = (pose.altitude_agl_m - height) / down
        inside = np.maximum(
            np.abs(pose.north_m + north * top - box_north),
            np.abs(pose.east_m + east * top - box_east),
        )
        depth = np.where(inside < 0.5 * width, np.minimum(depth, top), depth)
    return DepthImage(depth.astype(np.float32), pose.stamp_ns)


@pytest.fixture
def safe_map() -> SafetyMap:
    """Ground that heatmaps call safe all over, seen from 60 m."""
    safety_map = SafetyMap(MapParameters(map_size_m=80.0))
    for number in range(12):
        heatmap = Heatmap(np.full((96, 96), 0.95, np.float32), round(0.5 * number * S))
        safety_map.add(heatmap, CAMERA, pose_at(0.5 * number, 60.0))
    return safety_map


def score_at(safety_map: SafetyMap, north_m: float, east_m: float) -> float:
    return safety_map.score_around(north_m, east_m, 0.5, 6 * S)[0]


@pytest.mark.parametrize('attitude', [(0.0, 0.0, 0.0), (12.0, -9.0, 130.0)])
def test_what_stands_on_the_ground_closes_it_and_flat_ground_stays_open(
    safe_map: SafetyMap, attitude: tuple[float, float, float]
) -> None:
    pose = pose_at(6.0, attitude_deg=attitude)
    safe_map.add_depth(measured(pose, ((2.0, -1.0, 1.5, 2.5),)), CAMERA, pose)
    assert score_at(safe_map, 2.0, -1.0) == 0.0
    assert score_at(safe_map, -3.0, 3.0) > 0.8


def test_what_was_rough_opens_only_when_it_is_measured_flat(safe_map: SafetyMap) -> None:
    pose = pose_at(6.0)
    safe_map.add_depth(measured(pose, ((0.0, 0.0, 1.5, 2.5),)), CAMERA, pose)
    high = pose_at(7.0, 60.0)
    safe_map.add_depth(measured(high), CAMERA, high)
    assert score_at(safe_map, 0.0, 0.0) == 0.0, 'nothing is measured from 60 m'
    safe_map.add_depth(measured(pose), CAMERA, pose)
    assert score_at(safe_map, 0.0, 0.0) > 0.8


def test_flat_ground_that_heatmaps_call_unsafe_stays_unsafe() -> None:
    safety_map = SafetyMap(MapParameters(map_size_m=80.0))
    pose = pose_at(0.0)
    safety_map.add(Heatmap(np.full((96, 96), 0.3, np.float32), 0), CAMERA, pose)
    before = score_at(safety_map, 0.0, 0.0)
    safety_map.add_depth(measured(pose), CAMERA, pose)
    assert score_at(safety_map, 0.0, 0.0) == before < 0.5


def _spoilt(depth: DepthImage, value: float) -> DepthImage:
    changed: NDArray[np.float32] = depth.depth_m.copy()
    changed[::3, ::3] = value
    return DepthImage(changed, depth.stamp_ns)


@pytest.mark.parametrize('value', [0.0, 20.0, 65.5, float('nan'), float('inf'), -1.0])
def test_what_was_not_measured_does_not_count(safe_map: SafetyMap, value: float) -> None:
    pose = pose_at(6.0)
    safe_map.add_depth(_spoilt(measured(pose), value), CAMERA, pose)
    assert score_at(safe_map, 0.0, 0.0) > 0.8
    boxed = measured(pose, ((0.0, 0.0, 1.5, 2.5),))
    safe_map.add_depth(_spoilt(boxed, value), CAMERA, pose)
    assert score_at(safe_map, 0.0, 0.0) == 0.0


def test_a_sensor_that_measures_nothing_changes_nothing(safe_map: SafetyMap) -> None:
    nothing = DepthImage(np.full((PX, PX), 20.0, np.float32), 6 * S)
    safe_map.add_depth(nothing, CAMERA, pose_at(6.0))
    assert score_at(safe_map, 0.0, 0.0) > 0.8


def test_a_slope_is_rough_when_it_is_steep(safe_map: SafetyMap) -> None:
    pose = pose_at(6.0, altitude_m=14.0)
    level = measured(pose).depth_m
    rows = np.linspace(-0.5, 0.5, PX, dtype=np.float32)[:, None]
    gentle = DepthImage(level * (1.0 + 0.2 * rows), 6 * S)
    safe_map.add_depth(gentle, CAMERA, pose)
    assert score_at(safe_map, 0.0, 0.0) > 0.8
    steep = DepthImage(level * (1.0 + 1.2 * rows), 6 * S)
    safe_map.add_depth(steep, CAMERA, pose)
    assert score_at(safe_map, 0.0, 0.0) == 0.0


def test_rough_ground_moves_with_the_window_and_grows_with_doubt(safe_map: SafetyMap) -> None:
    pose = pose_at(6.0)
    safe_map.add_depth(measured(pose, ((0.0, 0.0, 1.5, 2.5),)), CAMERA, pose)
    away = pose_at(6.5, 60.0, place=(20.0, -15.0))
    safe_map.add(Heatmap(np.full((96, 96), 0.95, np.float32), away.stamp_ns), CAMERA, away)
    assert score_at(safe_map, 0.0, 0.0) == 0.0
    assert score_at(safe_map, 5.0, 0.0) > 0.8
    safe_map.widen_unsafe(4.0)
    assert score_at(safe_map, 4.0, 0.0) == 0.0
    safe_map.clear()
    safe_map.add(Heatmap(np.full((96, 96), 0.95, np.float32), 7 * S), CAMERA, pose_at(7.0))
    assert score_at(safe_map, 0.0, 0.0) > 0.5


def test_a_camera_that_leans_too_far_is_refused(safe_map: SafetyMap) -> None:
    pose = pose_at(6.0, attitude_deg=(55.0, 0.0, 0.0))
    with pytest.raises(RefusedLookError):
        safe_map.add_depth(measured(pose_at(6.0)), CAMERA, pose)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A heatmap lies where the ground is that it shows, at any attitude."""

from math import degrees, hypot, radians, tan

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import Heatmap
from peace_ros.core.domain.geometry import ground_to_image
from peace_ros.core.mapping import MapParameters, RefusedLookError, SafetyMap
from peace_ros.core.mapping.projection import tilt_rad

PARAMETERS = MapParameters(map_size_m=160.0)
SPOT_PX = 14.0


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    altitude_m=st.floats(22.0, 60.0),
    attitude=st.tuples(st.floats(-25.0, 25.0), st.floats(-25.0, 25.0), st.floats(-180.0, 180.0)),
    position=st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0)),
    pixel=st.tuples(st.floats(60.0, 292.0), st.floats(60.0, 292.0)),
)
def test_what_a_pixel_shows_is_found_again_on_the_ground(
    *, camera, pose_at, altitude_m, attitude, position, pixel
):
    roll, pitch, yaw = attitude
    pose = pose_at(altitude_m, *position, roll=roll, pitch=pitch, yaw=yaw)
    ground = np.linalg.inv(ground_to_image(camera, pose)) @ np.array([*pixel, 1.0])
    spot = ground[:2] / ground[2]
    reach_m = hypot(spot[0] - position[0], spot[1] - position[1])
    assume(ground[2] > 0.0 and reach_m < 50.0)
    assume(reach_m < altitude_m * tan(radians(55.0)))
    rows, columns = np.mgrid[0:352, 0:352]
    near = np.hypot(columns - pixel[0], rows - pixel[1]) < SPOT_PX
    safety_map = SafetyMap(PARAMETERS)
    for number in range(3):
        heatmap = Heatmap(np.where(near, 0.95, 0.05).astype(np.float32), (number + 1) * 10**9)
        safety_map.add(heatmap, camera, pose)
    layers = safety_map.layers(3 * 10**9)
    found = np.argwhere(layers.score > 0.5)
    assert len(found) > 0
    centre = layers.centre_of(*found.mean(axis=0))
    slant = 1.0 + (reach_m / altitude_m) ** 2
    pixel_m = altitude_m / camera.focal_px * slant
    # A circle in a slanted picture is an egg on the ground, so its middle is off by a part of it.
    assert hypot(centre[0] - spot[0], centre[1] - spot[1]) < 0.6 + 0.25 * SPOT_PX * pixel_m


@pytest.mark.parametrize(
    ('angles', 'tilt_deg'),
    [({'yaw': 77.0}, 0.0), ({'roll': 30.0, 'yaw': 10.0}, 30.0), ({'pitch': -100.0}, 100.0)],
)
def test_tilt_is_the_angle_off_the_vertical(pose_at, angles, tilt_deg):
    assert degrees(tilt_rad(pose_at(**angles))) == pytest.approx(tilt_deg, abs=1e-6)


def test_frames_at_too_much_tilt_are_refused_and_change_nothing(camera, pose_at, look):
    safety_map = SafetyMap(PARAMETERS)
    safety_map.add(look(1.0), camera, pose_at(roll=39.0))
    with pytest.raises(RefusedLookError, match='41 deg') as refusal:
        safety_map.add(look(2.0), camera, pose_at(roll=29.0, pitch=-30.5))
    assert refusal.value.fate == 'taken at too much tilt'
    assert safety_map.stamp_ns == 10**9


def test_ground_above_the_level_of_the_vehicle_lies_farther_out_on_the_map(camera, pose_at):
    """The ground is taken for level: what is higher by h is displaced outwards by h tan(slant)."""
    pose = pose_at(40.0)
    true_m, height_m = 15.0, 3.0
    at_height = pose_at(40.0 - height_m)
    u, v, w = ground_to_image(camera, at_height) @ np.array([true_m, 0.0, 1.0])
    north, _, scale = np.linalg.inv(ground_to_image(camera, pose)) @ np.array([u / w, v / w, 1.0])
    assert north / scale - true_m == pytest.approx(height_m * true_m / (40.0 - height_m))

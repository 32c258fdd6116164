# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Without a position the map is carried by pictures, loses accuracy, and is dropped when lost."""

from dataclasses import replace
from math import hypot, nan, radians, sin

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Frame, Heatmap, Pose
from peace_ros.core.domain.geometry import ground_to_image, quaternion_from_euler
from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.intake import HeatmapIntake
from peace_ros.core.landing.odometry import VisualOdometry
from peace_ros.core.mapping import MapParameters, Mismatch, SafetyMap, View, small_grey
from peace_ros.simulation import NadirCamera, draw_world

S = 1_000_000_000
CAMERA = Camera.from_degrees(256, 256, 73.0)
SPEED_M_S = 2.0
LOST_S, BACK_S = 3.0, 9.0
SAFE_M = 12.0
"""Ground is safe north of the start up to here."""


@pytest.fixture(scope='module')
def eye():
    return NadirCamera(draw_world(4, 160.0, 0.25), CAMERA)


class Outage:
    """A flight to the north that has no position for a while; its ground is safe to one side."""

    def __init__(self, eye: NadirCamera, *, pictures: bool = True, back_m: float = 0.0) -> None:
        self.safety_map = SafetyMap(MapParameters(map_size_m=120.0))
        self.intake = HeatmapIntake(LandingParameters(), CAMERA, self.safety_map)
        self.eye = eye
        self.pictures = pictures
        self.back_m = back_m
        """The position that comes back is off by this."""
        self.random = np.random.default_rng(3)
        self.time_s = 0.0

    def truth(self) -> Pose:
        lean = quaternion_from_euler(radians(6.0 * sin(self.time_s)), radians(-4.0), 0.4)
        north_m = SPEED_M_S * self.time_s
        return Pose(round(self.time_s * S), north_m, 0.0, -40.0, lean, 40.0)

    def picture(self, pose: Pose) -> np.ndarray:
        clean = self.eye.view(pose).image_rgb.astype(np.float32)
        noisy = clean + self.random.normal(0.0, 3.0, clean.shape)
        return np.clip(noisy, 0.0, 255.0).astype(np.uint8)

    def heatmap(self, pose: Pose) -> Heatmap:
        matrix = np.linalg.inv(self._image_from_ground(pose))
        rows, columns = np.mgrid[0:64, 0:64]
        points = matrix @ np.stack([columns.ravel(), rows.ravel(), np.ones(rows.size)])
        safe = (points[0] / points[2]).reshape(64, 64) < SAFE_M
        return Heatmap(np.where(safe, 0.95, 0.3).astype(np.float32), pose.stamp_ns)

    @staticmethod
    def _image_from_ground(pose: Pose) -> np.ndarray:
        return ground_to_image(CAMERA.resized(64, 64), pose)

    def run(self, until_s: float) -> None:
        while self.time_s < until_s - 1e-9:
            self.time_s += 0.25
            pose = self.truth()
            told = pose
            if LOST_S < self.time_s < BACK_S:
                told = replace(pose, north_m=nan, east_m=nan)
            elif self.time_s >= BACK_S:
                told = replace(pose, north_m=pose.north_m + self.back_m)
            self.intake.add_pose(told)
            if self.pictures:
                self.intake.add_view(Frame(self.picture(pose), pose.stamp_ns))
            self.intake.add_heatmap(self.heatmap(pose))
            self.intake.tick(pose.stamp_ns)

    def edge_m(self) -> float:
        """North end of the safe ground on the map, straight ahead."""
        layers = self.safety_map.layers(self.safety_map.stamp_ns)
        _, column = layers.cell_at(0.0, 0.0)
        rows = np.flatnonzero(layers.score[:, column] > 0.7)
        return layers.centre_of(int(rows.max()), column)[0]


def test_pictures_carry_the_map_until_the_position_is_back(eye):
    flight = Outage(eye)
    flight.run(BACK_S - 0.5)
    assert flight.safety_map.stamp_ns > round((BACK_S - 1.5) * S), 'heatmaps still come in'
    assert flight.edge_m() == pytest.approx(SAFE_M, abs=1.5)
    flight.run(BACK_S + 1.5)
    assert flight.intake.drops == 0
    assert flight.edge_m() == pytest.approx(SAFE_M, abs=2.5)
    assert flight.edge_m() < SAFE_M + 0.6, 'errors shrink what is safe'


def test_without_pictures_the_map_is_dropped(eye):
    flight = Outage(eye, pictures=False)
    flight.run(BACK_S - 0.5)
    assert flight.intake.drops == 1
    assert flight.safety_map.stamp_ns is None
    assert 'no position for' in flight.intake.last_rejection
    flight.run(BACK_S + 0.5)
    assert flight.safety_map.stamp_ns is not None


def test_a_position_that_comes_back_elsewhere_drops_the_map(eye):
    flight = Outage(eye, back_m=9.0)
    flight.run(BACK_S)
    assert flight.intake.drops == 1
    assert 'from the estimate by pictures' in flight.intake.last_rejection
    flight.run(BACK_S + 2.0)
    assert flight.intake.drops == 1
    assert flight.edge_m() == pytest.approx(SAFE_M + 9.0, abs=1.0)


def test_a_camera_that_freezes_while_there_is_no_position_drops_the_map(eye):
    flight = Outage(eye)
    flight.run(5.0)
    assert flight.intake.drops == 0
    frozen = flight.picture(flight.truth())
    flight.picture = lambda _pose: frozen
    flight.run(7.5)
    assert flight.intake.drops == 1
    assert 'same picture' in flight.intake.last_rejection


def test_hovering_does_not_drift_and_distance_costs_accuracy(eye):
    flight = Outage(eye)
    odometry = VisualOdometry(CAMERA)

    def view_at(time_s: float) -> View:
        flight.time_s = time_s
        return View(small_grey(flight.picture(flight.truth())), flight.truth())

    odometry.anchor(view_at(1.0))
    hovering = [odometry.follow(replace_position(view_at(1.0))) for _ in range(8)]
    assert max(hypot(pose.north_m - 2.0, pose.east_m) for pose in hovering) < 0.15
    at_hover_m = odometry.drift_m
    for step in range(1, 25):
        pose = odometry.follow(replace_position(view_at(1.0 + step)))
        assert not isinstance(pose, Mismatch)
        assert hypot(pose.north_m - 2.0 - 2.0 * step, pose.east_m) < odometry.drift_m
    assert at_hover_m < 0.5 < odometry.drift_m < 6.0


def replace_position(view: View) -> View:
    return View(view.grey, replace(view.pose, north_m=nan, east_m=nan))


def test_widening_shrinks_safe_ground_and_never_makes_any(eye):
    flight = Outage(eye)
    flight.run(2.5)
    now_ns = flight.safety_map.stamp_ns
    before = flight.safety_map.layers(now_ns)
    flight.safety_map.widen_unsafe(1.2)
    after = flight.safety_map.layers(now_ns)
    assert (after.score <= before.score + 1e-6).all()
    assert (after.looks <= before.looks).all()
    assert (after.age_s >= before.age_s).all()
    assert np.count_nonzero(after.score > 0.7) < 0.97 * np.count_nonzero(before.score > 0.7)

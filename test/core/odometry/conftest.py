# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle over a drawn town, with a camera and an inertial measurement unit."""

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import NADIR, Camera, Frame, MotionEstimate
from peace_ros.core.odometry import OdometryParameters, VisualInertialOdometry
from peace_ros.lab.evaluation.odometry.motion import InertialUnit, Motion
from peace_ros.simulation import NadirCamera, draw_world

cv2.setNumThreads(1)  # one of two cores; the pictures are small

CAMERA = Camera.from_degrees(320, 240, 73.0)
FRAME_S, SAMPLE_S = 0.1, 0.01


class SeenFlight:
    """Flies a motion and shows its frames to the odometry."""

    def __init__(self, world, motion, *, camera=CAMERA, mount=NADIR, parameters=None, error=1.0):
        self.motion = motion
        self.eye = NadirCamera(world, camera, mount)
        self.random = np.random.default_rng(4)
        self.unit = InertialUnit(motion, self.random, error)
        self.odometry = VisualInertialOdometry(camera, mount, parameters or OdometryParameters())
        self.odometry.align(motion.pose(0.0), tuple(motion.velocity(0.0)))
        self.frames = 0
        self.samples = 0

    @property
    def time_s(self):
        return self.frames * FRAME_S

    def seen(self, time_s):
        """Height x width x 3 of the moment."""
        return self.eye.view(self.motion.pose(time_s)).image_rgb

    def measured(self, time_s):
        return self.unit.measure(time_s)

    def step(self, picture=None, altitude_m=None):
        """Give the next frame, by default what is seen, with noise; return the result."""
        self.frames += 1
        while self.samples * SAMPLE_S <= self.time_s + SAMPLE_S:
            self.odometry.add_inertial(self.measured(self.samples * SAMPLE_S))
            self.samples += 1
        if picture is None:
            clean = self.seen(self.time_s).astype(np.float32)
            noisy = clean + self.random.normal(0.0, 3.0, (*clean.shape[:2], 1))
            picture = np.clip(noisy, 0.0, 255.0).astype(np.uint8)
        pose = self.motion.pose(self.time_s)
        frame = Frame(picture, pose.stamp_ns)
        return self.odometry.add_frame(
            frame, pose.altitude_agl_m if altitude_m is None else altitude_m
        )

    def run(self, frames):
        return [self.step() for _ in range(frames)]

    def velocity_error(self, estimate):
        assert isinstance(estimate, MotionEstimate)
        true = self.motion.velocity(self.motion.time_s(estimate.velocity_stamp_ns))
        return float(np.linalg.norm(estimate.velocity_m_s - true))

    def position_error(self, estimate):
        assert isinstance(estimate, MotionEstimate)
        true = self.motion.pose(self.motion.time_s(estimate.pose.stamp_ns))
        return float(
            np.hypot(
                estimate.pose.north_m - true.north_m,
                estimate.pose.east_m - true.east_m,
            )
        )


@pytest.fixture(scope='session')
def town():
    return draw_world(3, 240.0, 0.2)


@pytest.fixture
def fly(town):
    def begin(motion: Motion, **settings) -> SeenFlight:
        return SeenFlight(town, motion, **settings)

    return begin

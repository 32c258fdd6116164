# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Odometry feeds a simulated autopilot: real messages both ways, without a line between."""

from math import hypot

import cv2
import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Camera, Frame, Pose, VehicleError
from peace_ros.core.odometry import Doubt
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import ArduPilot, Px4
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vision_feed import VisionFeed
from peace_ros.simulation import NadirCamera, draw_world
from peace_ros.simulation.autopilot import AutopilotParameters
from peace_ros.simulation.autopilot.commands import run_message
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.guided import PositionTarget
from peace_ros.simulation.autopilot.modes import Mode
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics
from peace_ros.simulation.autopilot.streams import Streams

cv2.setNumThreads(1)
CAMERA = Camera.from_degrees(240, 240, 73.0)
LATE_S = 0.05
"""From a picture to its estimate at the autopilot."""
OFTEN = ('LOCAL_POSITION_NED', 'ATTITUDE', 'GLOBAL_POSITION_INT', 'GPS_RAW_INT')
SELDOM = ('HEARTBEAT', 'EXTENDED_SYS_STATE', 'EKF_STATUS_REPORT', 'ESTIMATOR_STATUS')


@pytest.fixture(scope='module')
def town():
    return draw_world(3, 240.0, 0.2)


class DirectLink:
    """What the link does, without bytes; its clock is that of the autopilot."""

    def __init__(self, flight, kind):
        self.flight, self.broken, self.sent = flight, '', []
        self.dialect = Px4() if kind is Kind.PX4 else ArduPilot()
        clock = TimeMap()
        self.heard = Assembler(self.dialect, VehicleParameters(), clock)
        for number in range(5):
            clock.add(number, number, number)

    @property
    def now_ns(self):
        return round(self.flight.time_s * 1e9)

    @property
    def has_gnss_fix(self):
        return self.heard.has_gnss_fix

    def telemetry(self):
        return self.heard.telemetry(self.now_ns)

    def take_inertial(self):
        return self.heard.inertial.drain()

    def send_motion(self, estimate):
        if self.broken:
            raise VehicleError(self.broken)
        self.sent.append(estimate)
        for message in self.dialect.motion_messages(estimate):
            assert run_message(self.flight, message)


class Flown:
    """A vehicle with a camera over a town, and the feed."""

    def __init__(self, town, kind=Kind.ARDUPILOT, wind_m_s=4.0):
        self.personality = Personality(kind)
        self.flight = Flight(
            Physics(wind_to_m_s=(wind_m_s, 0.0)), self.personality, vision_delay_s=LATE_S
        )
        self.link = DirectLink(self.flight, kind)
        self.feed = VisionFeed(self.link, CAMERA)
        self.streams = Streams(AutopilotParameters(autopilot=kind.value), self.personality)
        self.eye = NadirCamera(town, CAMERA)
        self.random = np.random.default_rng(2)
        self.waiting, self.steps, self.blind = [], 0, False

    def hear(self, *names):
        for name in names:
            number = getattr(mavlink, f'MAVLINK_MSG_ID_{name}')
            message = (
                self.streams.build(number, self.flight) if self.streams.knows(number) else None
            )
            if message is not None:
                self.link.heard.take(message, self.link.now_ns, self.link.now_ns)

    def see(self):
        p = self.flight.physics
        north, east, down, q = p.north_m, p.east_m, p.down_m, p.quaternion_ned_frd
        pose = Pose(self.link.now_ns, north, east, down, q, max(0.5, -down))
        picture = self.eye.view(pose).image_rgb.astype(np.float32)
        picture += self.random.normal(0.0, 3.0, (*picture.shape[:2], 1))
        if self.blind:
            picture[:] = 0.0
        frame = Frame(np.clip(picture, 0.0, 255.0).astype(np.uint8), pose.stamp_ns)
        self.waiting.append((self.flight.time_s + LATE_S, frame))

    def let(self, seconds, velocity=None, camera=True):
        for _ in range(round(seconds * 100)):
            self.steps += 1
            if velocity is not None and self.steps % 5 == 0:
                self.flight.take_velocity(PositionTarget(1, 0x5C7, velocity))
            self.flight.step(0.01)
            self.hear('RAW_IMU', 'HIGHRES_IMU')
            if self.steps % 4 == 0:
                self.hear(*OFTEN)
            if self.steps % 20 == 0:
                self.hear(*SELDOM)
            if camera and self.steps % 10 == 0:
                self.see()
            while self.link.heard.poses:
                self.feed.add_pose(self.link.heard.poses.popleft())
            while self.waiting and self.waiting[0][0] <= self.flight.time_s:
                self.feed.add_frame(self.waiting.pop(0)[1])
            self.feed.step()
        return self

    def climb(self, height_m):
        self.let(43.0, camera=False)
        if self.personality.is_px4:
            self.flight.take_off(height_m)
            self.flight.arm()
        else:
            self.flight.set_mode(Mode.GUIDED)
            self.flight.arm()
            self.flight.take_off(height_m)
        return self.let(10.0 + height_m / 2.0, camera=False)

    @property
    def off_m(self):
        """How far the vehicle is from where its filter believes it is."""
        north, east, _ = self.flight.position_m
        return hypot(north - self.flight.physics.north_m, east - self.flight.physics.east_m)


def test_it_flies_on_vision_where_it_would_land(town):
    flown = Flown(town).climb(50.0).let(3.0)
    assert flown.feed.problem == ''
    assert flown.feed.off_m < 0.5
    flown.flight.lose_gps(stale=False)
    flown.let(0.5)
    assert flown.flight.estimator.use_source(2)
    flown.let(6.0, (2.0, 1.0, 0.0)).let(14.0, (0.3, 0.0, 1.5)).let(3.0, (0.0, 0.0, 0.0))
    assert flown.flight.mode is Mode.GUIDED
    assert flown.feed.problem == ''
    assert -flown.flight.physics.down_m < 35.0
    assert flown.off_m < 1.0
    assert flown.feed.off_m is None


def test_px4_flies_on_its_odometry(town):
    flown = Flown(town, Kind.PX4, wind_m_s=0.0).climb(40.0).let(2.0)
    flown.flight.lose_gps(stale=False)
    flown.let(10.0)
    assert flown.flight.has_position
    assert flown.flight.estimator.source == 2
    assert flown.off_m < 1.0


def test_on_the_ground_it_says_that_the_vehicle_stands(town):
    flown = Flown(town).let(44.0, camera=False).let(1.0)
    assert flown.feed.problem == ''
    assert len(flown.link.sent) >= 8
    assert not flown.link.sent[-1].velocity_m_s.any()
    assert flown.link.sent[-1].pose.north_m == pytest.approx(0.0, abs=0.01)


def test_without_gnss_before_it_sends_nothing(town):
    flown = Flown(town).climb(30.0)
    flown.flight.lose_gps(stale=False)
    flown.let(2.0)
    assert flown.feed.sent == 0
    assert 'GNSS has not given a position' in flown.feed.problem


def test_a_blind_camera_is_said_and_nothing_is_sent(town):
    flown = Flown(town).climb(30.0).let(2.0)
    flown.blind = True
    sent = flown.let(0.3).feed.sent
    flown.let(0.5)
    assert flown.feed.sent == sent
    assert flown.feed.problem in {each.value for each in Doubt}
    flown.blind = False
    flown.let(1.5)
    assert flown.feed.problem == ''


def test_after_missing_body_rates_it_begins_again_only_with_gnss(town):
    flown = Flown(town).climb(30.0).let(2.0)
    resets = flown.link.sent[-1].resets
    flown.link.take_inertial = list
    flown.let(0.5)
    assert 'no body rates' in flown.feed.problem
    del flown.link.take_inertial
    flown.link.heard.inertial.drain()
    flown.let(2.0)
    assert flown.feed.problem == ''
    assert flown.link.sent[-1].resets > resets
    flown.flight.lose_gps(stale=False)
    flown.let(0.5)
    flown.link.take_inertial = list
    flown.let(0.5)
    del flown.link.take_inertial
    flown.link.heard.inertial.drain()
    sent = flown.feed.sent
    flown.let(2.0)
    assert flown.feed.sent == sent
    assert 'body rates were missing' in flown.feed.problem


def test_a_connection_that_is_broken_is_said(town):
    flown = Flown(town).climb(30.0).let(1.0)
    flown.link.broken = 'the connection is closed'
    flown.let(0.5)
    assert flown.feed.problem == 'the connection is closed'

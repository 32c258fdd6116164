# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Camera images reach the landing core only when asked for, and carry the map over an outage."""

from __future__ import annotations

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from peace_ros.core.domain import Camera
from peace_ros.core.landing import LandingCore
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.messages import image_message
from peace_ros.simulation import NadirCamera, draw_world
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

OUTAGE_S = 4.5
"""Longer than a map outlives the position, shorter than the autopilot endures it."""


def test_images_reach_the_core_with_their_stamps_and_bad_ones_are_passed_over(
    bench, picture, monkeypatch
):
    stamps = []
    monkeypatch.setattr(LandingCore, 'add_view', lambda _, frame: stamps.append(frame.stamp_ns))
    node = bench.run(LandingNode, interface='twist', registration=True)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    broken = picture(7)
    broken.encoding = 'nonsense'
    sent = iter(range(1000, 100_000))

    def publish():
        images.publish(broken)
        images.publish(picture(next(sent)))

    bench.until(lambda: len(stamps) > 2, publish)
    assert stamps == sorted(stamps)
    assert 7 not in stamps
    assert node.failure is None


def test_no_images_are_asked_for_otherwise(bench):
    node = bench.run(LandingNode, interface='twist', registration=False)
    assert not [each for each in node.subscriptions if each.topic_name == '/image']


class Flight:
    """A vehicle 30 m above a drawn world, whose camera and whose heatmaps the test publishes."""

    camera = Camera.from_degrees(256, 256, 73.0)

    def __init__(self, bench, sim, *, registration):
        self.bench, self.sim = bench, sim
        self.eye = NadirCamera(draw_world(4, 160.0, 0.25), self.camera)
        self.random = np.random.default_rng(5)
        self.statuses = bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)
        self.node = bench.run(
            LandingNode,
            mavlink=sim.url,
            registration=registration,
            camera_width=256,
            camera_height=256,
            safe_altitude_m=20.5,
        )
        self.heatmaps = bench.offer_heatmaps()
        self.heatmaps.frame_size_px = (256, 256)
        self.images = bench.offer(Image, 'image', qos.IMAGE_OUT) if registration else None
        self.client = bench.peer.create_client(Trigger, '/landing/engage')
        bench.until(self.client.service_is_ready)

    def see(self):
        at_ns = self.node.clock_ns()
        if self.images is not None:
            clean = self.eye.view(self.sim.truth()).image_rgb.astype(np.float32)
            noisy = np.clip(clean + self.random.normal(0.0, 2.0, clean.shape), 0.0, 255.0)
            self.images.publish(image_message(noisy.astype(np.uint8), 'rgb8', at_ns))
        safety = self.random.uniform(0.95, 0.99, (88, 88)).astype(np.float32)
        self.heatmaps.publish(safety, at_ns)

    def engage(self):
        future = self.client.call_async(Trigger.Request())
        self.bench.until(future.done, self.see)
        return future.result().success

    def fly_on(self, seconds):
        end = time.monotonic() + seconds
        self.bench.until(lambda: time.monotonic() > end, self.see)

    def fly_until(self, state):
        self.bench.until(lambda: self.value('state') == state, self.see)

    def value(self, key):
        message = self.statuses[-1] if self.statuses else DiagnosticArray()
        pairs = message.status[0].values if message.status else []
        return {each.key: each.value for each in pairs}.get(key, '0')


@pytest.fixture
def above():
    """A vehicle 30 m above home in GUIDED."""
    sim = AutopilotSim(AutopilotParameters(port=0))
    sim.step(43.0)
    sim.pilot_mode('GUIDED')
    sim.flight.arm()
    sim.flight.take_off(30.0)
    sim.step(30.0)
    with sim:
        yield sim


@pytest.mark.parametrize('registration', [True, False])
def test_an_outage_of_the_position_costs_the_map_only_without_pictures(bench, above, registration):
    flight = Flight(bench, above, registration=registration)
    bench.until(flight.engage, flight.see)
    flight.fly_until('LANDING')
    above.lose_gps()
    flight.fly_until('HOLD')
    altitude_m = above.truth().altitude_agl_m
    flight.fly_on(OUTAGE_S)
    assert flight.value('state') == 'HOLD', 'nothing descends without a position'
    assert above.truth().altitude_agl_m > altitude_m - 1.5
    used = int(flight.value('heatmaps/used'))
    flight.fly_on(0.5)
    went_on = int(flight.value('heatmaps/used')) - used
    above.restore_gps()
    flight.fly_until('HANDOVER')
    dropped = int(flight.value('heatmaps/map dropped'))
    assert (went_on > 3, dropped) == ((True, 0) if registration else (False, 1))

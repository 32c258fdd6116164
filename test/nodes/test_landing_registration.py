# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Camera images reach the landing core only when registration is asked for."""

from __future__ import annotations

from sensor_msgs.msg import Image

from peace_ros.landing import LandingCore
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode


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
    node = bench.run(LandingNode, interface='twist')
    assert not [each for each in node.subscriptions if each.topic_name == '/image']

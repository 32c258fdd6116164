# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Depth images reach the landing core, and bad ones are passed over."""

from __future__ import annotations

from array import array

import numpy as np
from sensor_msgs.msg import Image

from peace_ros.core.landing import LandingCore
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.messages import time_from_ns


def depth(at_ns: int, encoding: str = '32FC1') -> Image:
    message = Image(encoding=encoding, height=2, width=3, step=12)
    message.header.stamp = time_from_ns(at_ns)
    message.data = array('B', np.full((2, 3), 7.5, np.float32).tobytes())
    return message


def test_depth_reaches_the_core_with_its_stamp_and_bad_ones_are_passed_over(bench, monkeypatch):
    seen = []
    monkeypatch.setattr(
        LandingCore, 'add_depth', lambda _, d: seen.append((d.stamp_ns, float(d.depth_m.max())))
    )
    node = bench.run(LandingNode, interface='twist')
    depths = bench.offer(Image, 'depth', qos.IMAGE_OUT)
    sent = iter(range(1000, 100_000))

    def publish():
        depths.publish(depth(7, '16UC1'))
        depths.publish(depth(next(sent)))

    bench.until(lambda: len(seen) > 2, publish)
    assert [at_ns for at_ns, _ in seen] == sorted(at_ns for at_ns, _ in seen)
    assert {metres for _, metres in seen} == {7.5}
    assert node.failure is None

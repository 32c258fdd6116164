# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CPU and memory of prompt generator and segmentation, as two processes and as one.

python -m peace_ros.lab.benchmark.composition --size 640x480 --rate 10 --seconds 20
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image

from peace_ros.core.presets import load_preset
from peace_ros.core.resources import config_dir
from peace_ros.nodes.messages import image_message
from peace_ros.nodes.qos import IMAGE_IN, IMAGE_OUT
from peace_ros.simulation.demo.nodes import ros_arguments
from peace_ros.simulation.demo.processes import ProcessGroup

SEPARATE = ('peace_ros.nodes.prompt_generator', 'peace_ros.nodes.segmentation')
COMPOSED = ('peace_ros.nodes.perception',)
READY_S = 90.0
_TICK_S = 1.0 / os.sysconf('SC_CLK_TCK')


@dataclass(frozen=True)
class Load:
    """What a set of processes took while frames came at one rate."""

    cpu: float
    """CPU seconds per second."""
    memory_mb: float
    """Proportional set size: a page that two processes share counts half for each."""
    heatmaps_hz: float
    latency_s: float
    """From the stamp of a frame to the arrival of its heatmap, median."""


class _FrameSource(Node):  # type: ignore[misc]
    """Publishes noise at a rate, and counts the heatmaps."""

    def __init__(self, width: int, height: int, rate_hz: float) -> None:
        super().__init__('camera')
        rng = np.random.default_rng(0)
        self._pixels = rng.integers(0, 256, (height, width, 3), np.uint8)
        self._out = self.create_publisher(Image, 'image', IMAGE_OUT)
        self.latencies_s: list[float] = []
        self.create_subscription(Image, 'heatmap', self._on_heatmap, IMAGE_IN)
        self.create_timer(1.0 / rate_hz, self._publish)

    def _publish(self) -> None:
        at_ns = self.get_clock().now().nanoseconds
        self._out.publish(image_message(self._pixels, 'rgb8', at_ns))

    def _on_heatmap(self, message: Image) -> None:
        now_ns = self.get_clock().now().nanoseconds
        stamp = message.header.stamp
        self.latencies_s.append((now_ns - stamp.sec * 10**9 - stamp.nanosec) / 1e9)


def measure(modules: Sequence[str], size: tuple[int, int], rate_hz: float, seconds: float) -> Load:
    """Run the modules on frames of one size and rate.

    Raises:
        RuntimeError: there is no heatmap within ``READY_S``.
    """
    arguments = ros_arguments({}, load_preset('peace_cs').path)
    camera, executor = _FrameSource(*size, rate_hz), SingleThreadedExecutor()
    executor.add_node(camera)

    def spin(until_s: float, *, first: bool) -> None:
        while time.monotonic() < until_s and not (first and len(camera.latencies_s) > rate_hz):
            executor.spin_once(timeout_sec=0.1)

    with tempfile.TemporaryDirectory() as folder, ProcessGroup(Path(folder)) as group:
        for module in modules:
            group.start(module, module, arguments)
        pids = list(group.pids.values())
        spin(time.monotonic() + READY_S, first=True)
        if not camera.latencies_s:
            raise RuntimeError(f'no heatmap within {READY_S} s: see the log of {modules}')
        camera.latencies_s.clear()
        began_s, cpu_s = time.monotonic(), sum(map(_cpu_s, pids))
        spin(began_s + seconds, first=False)
        took_s = time.monotonic() - began_s
        load = Load(
            (sum(map(_cpu_s, pids)) - cpu_s) / took_s,
            sum(map(_memory_mb, pids)),
            len(camera.latencies_s) / took_s,
            float(np.median(camera.latencies_s)),
        )
    executor.shutdown()
    camera.destroy_node()
    return load


def _cpu_s(pid: int) -> float:
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) * _TICK_S


def _memory_mb(pid: int) -> float:
    for line in Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='ascii').splitlines():
        if line.startswith('Pss:'):
            return int(line.split()[1]) / 1000.0
    raise RuntimeError(f'/proc/{pid}/smaps_rollup has no Pss')


def main(args: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--size', default='640x480', help='of the frames, WIDTHxHEIGHT')
    parser.add_argument('--rate', type=float, default=10.0, help='frames per second')
    parser.add_argument('--seconds', type=float, default=20.0, help='of measuring, for each')
    given = parser.parse_args(args)
    width, height = map(int, given.size.split('x'))
    # Fast DDS loses images of this size with its default segment.
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(config_dir() / 'fastdds.xml'))
    rclpy.init(args=[])
    loads = {
        name: measure(modules, (width, height), given.rate, given.seconds)
        for name, modules in (('separate', SEPARATE), ('composed', COMPOSED))
    }
    rclpy.try_shutdown()
    print('| processes | CPU s/s | memory MB | heatmaps/s | latency s |\n|---|---|---|---|---|')
    for name, load in loads.items():
        print(
            f'| {name} | {load.cpu:.2f} | {load.memory_mb:.0f} | {load.heatmaps_hz:.1f} '
            f'| {load.latency_s:.3f} |'
        )
    before, after = loads.values()
    cpu = 1.0 - after.cpu / before.cpu * before.heatmaps_hz / max(after.heatmaps_hz, 1e-9)
    memory = 1.0 - after.memory_mb / before.memory_mb
    print(f'\ncomposed: CPU per heatmap {-cpu:+.0%}, memory {-memory:+.0%}')
    return 0


if __name__ == '__main__':
    sys.exit(main())

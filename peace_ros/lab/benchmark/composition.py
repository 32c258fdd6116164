# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CPU, memory and delay of prompt generator and segmentation, as two processes and as one.

A landing node runs beside them, engaged, so that each frame leads to a set-point.

python -m peace_ros.lab.benchmark.composition --size 640x480 --rate 10 --seconds 20
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import Camera, Frame, Pose
from peace_ros.core.inference.session import Session
from peace_ros.core.messages import frame_from_message, stamp_ns_of
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.presets import load_preset
from peace_ros.nodes.messages import camera_info, image_message, pose_to_message
from peace_ros.nodes.qos import IMAGE_IN, IMAGE_OUT, POSE, RESULT
from peace_ros.simulation.demo.isolation import isolate
from peace_ros.simulation.demo.nodes import ros_arguments
from peace_ros.simulation.demo.processes import ProcessGroup

SEPARATE = ('peace_ros.nodes.prompt_generator', 'peace_ros.nodes.segmentation')
COMPOSED = ('peace_ros.nodes.perception',)
READY_S = 90.0
_POSE_HZ = 30.0
_HEIGHT_M = 50.0
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
    setpoint_p95_s: float
    """From the stamp of a frame to the arrival of the first set-point that rests on it."""


class _HoveringCamera(Node):  # type: ignore[misc]
    """A camera of noise on a vehicle that hovers; notes when heatmaps and set-points come."""

    def __init__(self, width: int, height: int, rate_hz: float, **options: Any) -> None:
        super().__init__('world', **options)
        rng = np.random.default_rng(0)
        self._pixels = rng.integers(0, 256, (height, width, 3), np.uint8)
        self._camera = Camera.from_degrees(width, height, 73.0)
        self._images = self.create_publisher(Image, 'image', IMAGE_OUT)
        self._infos = self.create_publisher(CameraInfo, 'camera_info', RESULT)
        self._poses = self.create_publisher(PoseStamped, 'pose', POSE)
        self.latencies_s: list[float] = []
        self.setpoint_latencies_s: dict[int, float] = {}
        """By the stamp (ns) of the frame."""
        self._frames_ns: set[int] = set()
        self.create_subscription(Image, 'heatmap', self._on_heatmap, IMAGE_IN)
        self.create_subscription(TwistStamped, 'landing/setpoint', self._on_setpoint, RESULT)
        self.create_timer(1.0 / rate_hz, self._show)
        self.create_timer(1.0 / _POSE_HZ, self._hover)

    def begin(self) -> None:
        """Forget what has come so far."""
        self.latencies_s.clear()
        self.setpoint_latencies_s.clear()
        self._frames_ns.clear()

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _show(self) -> None:
        at_ns = self._now_ns()
        self._frames_ns.add(at_ns)
        size_px = self._camera.width_px, self._camera.height_px
        self._infos.publish(camera_info(size_px, self._camera, at_ns, 'optical'))
        self._images.publish(image_message(self._pixels, 'rgb8', at_ns, 'optical'))

    def _hover(self) -> None:
        level = (1.0, 0.0, 0.0, 0.0)
        pose = Pose(self._now_ns(), 0.0, 0.0, -_HEIGHT_M, level, _HEIGHT_M)
        self._poses.publish(pose_to_message(pose))

    def _on_heatmap(self, message: Image) -> None:
        self.latencies_s.append((self._now_ns() - stamp_ns_of(message)) / 1e9)

    def _on_setpoint(self, message: TwistStamped) -> None:
        frame_ns = stamp_ns_of(message)
        if frame_ns in self._frames_ns:
            latency_s = (self._now_ns() - frame_ns) / 1e9
            self.setpoint_latencies_s.setdefault(frame_ns, latency_s)


def measure(modules: Sequence[str], size: tuple[int, int], rate_hz: float, seconds: float) -> Load:
    """Run the modules on frames of one size and rate.

    Raises:
        RuntimeError: there are no heatmaps or no set-points within ``READY_S``.
    """
    arguments = ros_arguments({}, load_preset('peace_cs').path)
    landing = ros_arguments({'interface': 'twist', 'auto_engage': True})
    world, executor = _HoveringCamera(*size, rate_hz), SingleThreadedExecutor()
    executor.add_node(world)

    def spin(until_s: float, *, first: bool) -> None:
        while time.monotonic() < until_s:
            executor.spin_once(timeout_sec=0.1)
            if first and len(world.latencies_s) > rate_hz and world.setpoint_latencies_s:
                return

    with tempfile.TemporaryDirectory() as folder, ProcessGroup(Path(folder)) as group:
        for module in modules:
            group.start(module, module, arguments)
        pids = list(group.pids.values())
        group.start('landing', 'peace_ros.nodes.landing', landing)
        spin(time.monotonic() + READY_S, first=True)
        if not (world.latencies_s and world.setpoint_latencies_s):
            raise RuntimeError(
                f'{len(world.latencies_s)} heatmaps and {len(world.setpoint_latencies_s)} '
                f'set-points within {READY_S} s: run it on a machine with less load'
            )
        world.begin()
        began_s, cpu_s = time.monotonic(), sum(map(_cpu_s, pids))
        spin(began_s + seconds, first=False)
        took_s = time.monotonic() - began_s
        load = Load(
            (sum(map(_cpu_s, pids)) - cpu_s) / took_s,
            sum(map(_memory_mb, pids)),
            len(world.latencies_s) / took_s,
            float(np.median(world.latencies_s)),
            float(np.percentile(list(world.setpoint_latencies_s.values()), 95.0)),
        )
    executor.shutdown()
    world.destroy_node()
    return load


def median_of(loads: Sequence[Load]) -> Load:
    """Return the median of each figure."""
    return Load(*(float(np.median(each)) for each in zip(*map(astuple, loads), strict=True)))


def network_share(size: tuple[int, int], frames: int = 20) -> tuple[float, float]:
    """Return the CPU seconds that one frame takes, without ROS, and those of its networks.

    What is not of the networks is all that two processes could share.
    """
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (size[1], size[0], 3), np.uint8)
    pipeline = Pipeline.from_preset('peace_cs')
    pipeline.look(Frame(pixels, 0))
    taken_s: list[float] = []
    run = Session.run

    def timed(session: Session, *args: Any, **given: Any) -> Any:
        began_s = time.process_time()
        try:
            return run(session, *args, **given)
        finally:
            taken_s.append(time.process_time() - began_s)

    with patch.object(Session, 'run', timed):
        began_s = time.process_time()
        for number in range(frames):
            pipeline.look(frame_from_message(image_message(pixels, 'rgb8', number + 1)))
        all_s = time.process_time() - began_s
    return all_s / frames, sum(taken_s) / frames


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
    parser.add_argument(
        '--rounds', type=int, default=1, help='of both in turn; the table has the medians'
    )
    given = parser.parse_args(args)
    width, height = map(int, given.size.split('x'))
    with tempfile.TemporaryDirectory() as folder:
        isolate(Path(folder))  # others on this machine would be second publishers
        return _compare((width, height), given.rate, given.seconds, given.rounds)


def _compare(size: tuple[int, int], rate_hz: float, seconds: float, rounds: int) -> int:
    rclpy.init(args=[])
    runs: dict[str, list[Load]] = {'separate': [], 'composed': []}
    for _ in range(rounds):
        for name, modules in (('separate', SEPARATE), ('composed', COMPOSED)):
            runs[name].append(measure(modules, size, rate_hz, seconds))
    loads = {name: median_of(each) for name, each in runs.items()}
    rclpy.try_shutdown()
    print(
        '| processes | CPU s/s | memory MB | heatmaps/s | latency s | frame to set-point, p95 s |\n'
        '|---|---|---|---|---|---|'
    )
    for name, load in loads.items():
        print(
            f'| {name} | {load.cpu:.2f} | {load.memory_mb:.0f} | {load.heatmaps_hz:.1f} '
            f'| {load.latency_s:.3f} | {load.setpoint_p95_s:.3f} |'
        )
    before, after = loads.values()
    cpu = 1.0 - after.cpu / before.cpu * before.heatmaps_hz / max(after.heatmaps_hz, 1e-9)
    memory = 1.0 - after.memory_mb / before.memory_mb
    faster = before.setpoint_p95_s / after.setpoint_p95_s
    print(
        f'\ncomposed: CPU per heatmap {-cpu:+.0%}, memory {-memory:+.0%}, frame to set-point '
        f'(p95) {faster:.2f} times as fast; load average {os.getloadavg()[0]:.1f}'
    )
    frame_s, networks_s = network_share(size)
    print(
        f'one frame takes {1e3 * frame_s:.0f} ms CPU without ROS, {1e3 * networks_s:.0f} ms '
        f'({networks_s / frame_s:.0%}) of it in the networks, which both ways run alike'
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the live page: CPU and memory of the node, updates, latency, first picture.

``python test/watch/measure.py [--seconds 20] [--viewers 2]`` starts the watch node as a process,
publishes what a landing publishes (status at 10 Hz, pose at 25 Hz, overlay at 5 Hz, map at 1 Hz),
and looks at the page with Chromium. Latency is from the moment before a status is published to the
frame of the browser after its reason was written, by one clock, since both are on one machine.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from shutil import which

import numpy as np
import psutil
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from playwright.sync_api import sync_playwright
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage

from peace_ros.core.domain import Camera, Pose
from peace_ros.nodes import qos
from peace_ros.nodes.messages import (
    camera_info,
    diagnostic_array,
    jpeg_message,
    pose_to_message,
)

sys.path.insert(0, str(Path(__file__).parent))
from scenes import status_of

SIDE_PX, CELLS = 352, 480
OBSERVE = """() => {
  window.delays = [];
  new MutationObserver(() => requestAnimationFrame(() => {
    const sent = Number(document.getElementById('reason').textContent.split(' ')[1]);
    if (sent) window.delays.push(Date.now() - sent);
  })).observe(document.getElementById('reason'), { childList: true });
}"""


class Landing(Node):
    """Publishes what a landing publishes, from a thread of its own."""

    def __init__(self) -> None:
        super().__init__('measured_landing')
        self._status = self.create_publisher(DiagnosticArray, 'landing/status', qos.RESULT)
        self._pose = self.create_publisher(PoseStamped, 'landing/pose', qos.RESULT)
        self._overlay = self.create_publisher(CompressedImage, 'overlay/compressed', qos.IMAGE_OUT)
        self._info = self.create_publisher(CameraInfo, 'heatmap/frame_info', qos.RESULT)
        self._map = self.create_publisher(OccupancyGrid, 'landing/map', qos.LATCHED)
        picture = np.random.default_rng(1).integers(0, 255, (44, 44, 3), np.uint8)
        self._picture = picture.repeat(8, axis=0).repeat(8, axis=1)
        self._camera = Camera.from_degrees(SIDE_PX, SIDE_PX, 73.0)
        grid = OccupancyGrid()
        grid.info.resolution, grid.info.width, grid.info.height = 0.5, CELLS, CELLS
        cells = np.random.default_rng(2).integers(-1, 100, (CELLS // 8, CELLS // 8), np.int8)
        grid.data = cells.repeat(8, axis=0).repeat(8, axis=1).ravel().tolist()
        self._grid = grid
        self.over = threading.Event()

    def run(self) -> None:
        turn = 0
        while not self.over.wait(0.02):
            now_ns = self.get_clock().now().nanoseconds
            if turn % 2 == 0:
                self._pose.publish(
                    pose_to_message(Pose(now_ns, 12.0, -4.0, -63.0, (1.0, 0.0, 0.0, 0.0), 63.0))
                )
            if turn % 5 == 0:
                values = {**status_of('aiming'), 'reason': f'sent {time.time() * 1e3:.0f} ms'}
                self._status.publish(
                    diagnostic_array(now_ns, 'landing/status', b'\x00', 'AIMING', values.items())
                )
            if turn % 10 == 0 and self._overlay.get_subscription_count():
                self._info.publish(camera_info((SIDE_PX, SIDE_PX), self._camera, now_ns, 'x'))
                self._overlay.publish(jpeg_message(self._picture, now_ns))
            if turn % 50 == 0 and self._map.get_subscription_count():
                self._map.publish(self._grid)
            turn += 1


def cpu_share(process: psutil.Process, seconds: float) -> float:
    """Return the share of one core that a process takes."""

    def spent() -> float:
        times = process.cpu_times()
        return float(times.user + times.system)

    before = spent()
    time.sleep(seconds)
    return (spent() - before) / seconds


def measure(seconds: float, viewers: int, url: str, process: psutil.Process) -> dict[str, float]:
    found = {'cpu_idle': cpu_share(process, seconds)}
    before_mb = process.memory_full_info().pss / 1e6
    with sync_playwright() as run:
        browser = run.chromium.launch(executable_path=which('chromium'), args=['--no-sandbox'])
        pages = []
        for _ in range(viewers):
            page = browser.new_page(viewport={'width': 1440, 'height': 900})
            begin = time.monotonic()
            page.goto(url)
            page.locator('#overlay').wait_for()
            found.setdefault('first_picture_s', time.monotonic() - begin)
            page.evaluate(OBSERVE)
            pages.append(page)

        def updates() -> list[int]:
            return [int(page.evaluate('document.body.dataset.updates ?? 0')) for page in pages]

        before, begin = updates(), time.monotonic()
        found['cpu_watched'] = cpu_share(process, seconds)
        elapsed_s = time.monotonic() - begin
        rates = [(b - a) / elapsed_s for a, b in zip(before, updates(), strict=True)]
        found['updates_per_s'] = min(rates)
        delays = np.concatenate([page.evaluate('window.delays') for page in pages])
        found['latency_p50_ms'], found['latency_p95_ms'] = np.percentile(delays, [50, 95])
        browser.close()
    found['memory_before_mb'] = before_mb
    memory = process.memory_full_info()
    found['memory_pss_mb'], found['memory_rss_mb'] = memory.pss / 1e6, memory.rss / 1e6
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seconds', type=float, default=20.0)
    parser.add_argument('--viewers', type=int, default=2)
    given = parser.parse_args()
    rclpy.init()
    landing = Landing()
    threading.Thread(target=landing.run, daemon=True).start()
    with tempfile.TemporaryDirectory() as folder:
        address = Path(folder) / 'url'
        command = [sys.executable, '-m', 'peace_ros.watch.watch', '--ros-args']
        command += ['-p', 'port:=0', '-p', f'url_file:={address}']
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as started:
            while not address.is_file():
                time.sleep(0.1)
            time.sleep(3.0)
            process = psutil.Process(started.pid)
            found = measure(given.seconds, given.viewers, address.read_text().strip(), process)
            started.terminate()
    landing.over.set()
    load = os.getloadavg()[0]
    for name, value in {**found, 'load_average': load}.items():
        print(f'{name}: {value:.3f}')


if __name__ == '__main__':
    main()

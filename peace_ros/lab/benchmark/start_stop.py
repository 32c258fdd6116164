# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How long each node on board takes from its start to ready, and from SIGINT to its exit.

Ready is the log line of a node that is active, of the recorder that it records. The nodes get
camera frames meanwhile, and the signal comes a second after ready: the networks are at work.

python -m peace_ros.lab.benchmark.start_stop --times 20
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Image

from peace_ros.core.node_parameters import RECORDER
from peace_ros.core.presets import load_preset
from peace_ros.core.resources import config_dir
from peace_ros.nodes.messages import image_message
from peace_ros.nodes.qos import IMAGE_OUT
from peace_ros.simulation.demo.nodes import ros_arguments

READY = {
    'prompt_generator': ('ready: ',),
    'segmentation': ('ready: ',),
    'perception': (r'\[prompt_generator\]: ready: ', r'\[segmentation\]: ready: '),
    'landing': ('waiting for the vehicle: ',),
    RECORDER: ('recording into ',),
}
"""Node -> what its log says, in any order, once it works."""
READY_LIMIT_S, EXIT_LIMIT_S = 3.0, 2.0
_GIVE_UP_S = 60.0
_AT_WORK_S = 1.0


class Lifetime(NamedTuple):
    """One start and end of a process."""

    ready_s: float
    """From the start of the process to the last line of ``READY``."""
    cpu_s: float
    """CPU time until then, which other work on the machine does not make longer."""
    exit_s: float
    """From SIGINT until the process has ended."""
    status: int
    """Its exit status."""


def measure(node: str, preset: str = 'peace_cs') -> Lifetime:
    """Start a node, interrupt it when it works, and wait for its end.

    Raises:
        RuntimeError: it ended before it was ready, or was not ready within 60 s.
    """
    room = 'recorder' if node == RECORDER else 'nodes'
    began_s = time.monotonic()
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            [
                *(sys.executable, '-m', f'peace_ros.{room}.{node}'),
                *ros_arguments(_own_parameters(node, folder), load_preset(preset).path),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as process,
    ):
        overdue = threading.Timer(_GIVE_UP_S, process.kill)
        overdue.start()
        try:
            _read_until_ready(process, node)
            ready_s, cpu_s = time.monotonic() - began_s, _cpu_s(process.pid)
            time.sleep(_AT_WORK_S)
            told_s = time.monotonic()
            process.send_signal(signal.SIGINT)
            status = process.wait()
            return Lifetime(ready_s, cpu_s, time.monotonic() - told_s, status)
        finally:
            overdue.cancel()
            process.kill()


def _own_parameters(node: str, folder: str) -> dict[str, object]:
    if node == 'landing':
        # Port 0: any that is free. No autopilot answers, so the node keeps looking for one.
        return {'mavlink': 'udpin:127.0.0.1:0'}
    return {'recordings': folder} if node == RECORDER else {}


def _read_until_ready(process: subprocess.Popen[str], node: str) -> None:
    waiting, said = set(READY[node]), []
    for line in process.stdout or ():
        said.append(line)
        waiting = {each for each in waiting if not re.search(each, line)}
        if not waiting:
            return
    raise RuntimeError(f'{node} was not ready within {_GIVE_UP_S:.0f} s:\n{"".join(said[-8:])}')


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process so far, user and system."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def main(args: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit does not hold."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--times', type=int, default=20, help='starts of each node')
    parser.add_argument('--nodes', nargs='+', choices=READY, default=list(READY))
    given = parser.parse_args(args)
    if given.times < 1:
        parser.error(f'--times is {given.times}: give 1 or more')
    # Fast DDS loses images of this size with its default segment.
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(config_dir() / 'fastdds.xml'))
    with _frames():
        lives = {node: [measure(node) for _ in range(given.times)] for node in given.nodes}
    print('| node | start to ready, median, largest | CPU | SIGINT to exit, median, largest |')
    print('|---|---|---|---|')
    good = True
    for node, each in lives.items():
        ready, ended = [life.ready_s for life in each], [life.exit_s for life in each]
        cpu_s = np.median([life.cpu_s for life in each])
        print(
            f'| `{node}` | {np.median(ready):.2f} s, {max(ready):.2f} s | {cpu_s:.2f} s '
            f'| {np.median(ended):.2f} s, {max(ended):.2f} s |'
        )
        good &= max(ready) < READY_LIMIT_S and max(ended) < EXIT_LIMIT_S
        good &= all(life.status == 0 for life in each)
    load, _, _ = os.getloadavg()
    print(f'\n{given.times} times each, load average {load:.1f} on {os.cpu_count()} cores')
    print(f'every start below {READY_LIMIT_S:g} s, every end below {EXIT_LIMIT_S:g} s', end=' ')
    print('with exit status 0: yes' if good else 'with exit status 0: no')
    return 0 if good else 1


@contextmanager
def _frames() -> Iterator[None]:
    """Publish noise of 640 x 480 pixels at 5 Hz meanwhile, and raise at the end what ended that."""
    pixels = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    stop = threading.Event()

    def publish() -> None:
        while not stop.wait(0.2):
            images.publish(image_message(pixels, 'rgb8', camera.get_clock().now().nanoseconds))

    # Of its own: the process of a test may have used the default one.
    context = rclpy.Context()
    rclpy.init(args=[], context=context)
    try:
        camera = Node('camera', context=context)
        images = camera.create_publisher(Image, 'image', IMAGE_OUT)
        with ThreadPoolExecutor(1) as pool:
            published = pool.submit(publish)
            try:
                yield
            finally:
                stop.set()
            published.result()
    finally:
        context.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())

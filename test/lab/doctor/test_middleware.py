# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who can take part over DDS, and whether images fit its shared memory."""

from __future__ import annotations

import shutil
from types import SimpleNamespace

import pytest

from peace_ros.core.resources import config_dir
from peace_ros.lab.doctor.middleware import (
    PROFILES,
    check_discovery,
    check_middleware,
    check_shared_memory,
    segment_of,
)

RMW = 'rmw_fastrtps_cpp'
SMALL, VGA = 352 * 352 * 3, 640 * 480 * 3


@pytest.fixture(autouse=True)
def no_profiles(monkeypatch) -> None:
    for each in PROFILES:
        monkeypatch.delenv(each, raising=False)


def test_the_middleware_and_its_domain_are_named(monkeypatch) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', '41')
    first = next(check_middleware())
    assert first.figures == {'rmw': RMW, 'domain': '41'}
    assert 'rclpy 7' in first.found


@pytest.mark.parametrize(
    ('discovery', 'count'), [('', 1), ('LOCALHOST', 0), ('OFF', 0), ('SUBNET', 0)]
)
def test_an_open_network_must_be_chosen(discovery: str, count: int, to_mend) -> None:
    found = to_mend(check_discovery(discovery))
    assert len(found) == count
    if found:
        assert 'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST' in found[0][1]


def test_images_that_the_default_segment_loses_are_found(to_mend) -> None:
    assert not to_mend(check_shared_memory(RMW, SMALL))
    ((found, remedy),) = to_mend(check_shared_memory(RMW, VGA))
    assert '0.92 MB' in found
    assert 'will be lost' in found
    assert f'{PROFILES[0]} name {config_dir()}/fastdds.xml' in remedy


def test_the_shipped_profiles_are_read(monkeypatch, to_mend) -> None:
    file = config_dir() / 'fastdds.xml'
    monkeypatch.setenv(PROFILES[0], str(file))
    assert not to_mend(check_shared_memory(RMW, VGA))
    frame_bytes = segment_of(file) // 3
    ((_, remedy),) = to_mend(check_shared_memory(RMW, frame_bytes))
    assert f'segment_size {4 * frame_bytes} or more' in remedy


def test_profiles_that_cannot_be_read_are_to_be_mended(tmp_path, monkeypatch, to_mend) -> None:
    file = tmp_path / 'profiles.xml'
    monkeypatch.setenv(PROFILES[0], str(file))
    assert 'cannot be read' in to_mend(check_shared_memory(RMW, VGA))[0][0]
    file.write_text('<profiles><segment_size>many</segment_size></profiles>')
    assert 'cannot be read' in to_mend(check_shared_memory(RMW, VGA))[0][0]
    file.write_text('<profiles>')
    assert 'cannot be read' in to_mend(check_shared_memory(RMW, VGA))[0][0]


def test_a_container_with_little_shared_memory_is_found(monkeypatch, to_mend) -> None:
    monkeypatch.setattr(shutil, 'disk_usage', lambda _folder: SimpleNamespace(free=1e6))
    ((found, remedy),) = to_mend(check_shared_memory(RMW, SMALL))
    assert '1 MB free' in found
    assert '--shm-size' in remedy


def test_another_middleware_is_not_judged(to_mend) -> None:
    (only,) = check_shared_memory('rmw_cyclonedds_cpp', VGA)
    assert only.outcome.value == 'not checked'

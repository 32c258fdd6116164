# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What makes no sense is refused before anything is started."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import ConfigurationError, PeaceError, VehicleError, WorldError
from peace_ros.simulation.demo.nodes import Wiring, node_arguments
from peace_ros.simulation.demo.options import (
    DemoOptions,
    is_on_this_machine,
    parse_start,
    refuse_to_arm_elsewhere,
)
from peace_ros.simulation.demo.worlds import prepare_world


@pytest.fixture
def photo(tmp_path) -> Path:
    path = tmp_path / 'photo.png'
    cv2.imwrite(str(path), np.full((300, 400, 3), 120, np.uint8))
    return path


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({'world': Path('/nowhere.jpg'), 'gsd_m': 0.1}, 'no such file'),
        ({'gsd_m': 0.1}, '--world'),
        ({'labels': Path('x.png')}, '--world'),
        ({'speed': 0.0}, '--speed'),
        ({'speed': float('nan')}, '--speed'),
        ({'timeout_s': 1.0}, '--timeout'),
        ({'seed': -1}, '--seed'),
        ({'camera_size': '8x352'}, '--camera 8x352: give 64 to 4096'),
        ({'camera_size': '640'}, 'give WxH'),
        ({'camera_size': '640x-360'}, 'give WxH'),
        ({'camera_size': 'x'}, 'give WxH'),
        ({'distortion': '0.1,x'}, '--distortion'),
        ({'distortion': '0.1,0.2'}, '4 or 5 finite numbers'),
        ({'distortion': 'orthographic:0.1'}, 'orthographic'),
        ({'distortion': '0.1,nan,0,0'}, 'finite'),
        ({'mount_pitch_deg': 95.0}, 'mount_pitch'),
        ({'fov_deg': 200.0}, 'camera_fov'),
        ({'mavlink': 'udpin:127.0.0.1:1'}, '--pose-mavlink'),
        ({'pose_mavlink': 'udpin:127.0.0.1:1'}, '--mavlink'),
        ({'mavlink': 'udpin:127.0.0.1:1', 'pose_mavlink': 'udpin:127.0.0.1:1'}, 'second'),
        ({'mavlink': 'tcp:h:1', 'pose_mavlink': 'tcp:h:2', 'speed': 2.0}, '--speed'),
        ({'mavlink': 'somewhere', 'pose_mavlink': 'tcp:h:2'}, "--mavlink: connection 'somewhere'"),
        ({'mavlink': 'tcp:h:1', 'pose_mavlink': 'tcp:h'}, "--pose-mavlink: connection 'tcp:h'"),
        ({'autopilot': 'betaflight'}, '--autopilot'),
        ({'mavlink': 'tcp:h:1', 'pose_mavlink': 'tcp:h:2', 'autopilot': 'px4'}, '--autopilot'),
    ],
)
def test_senseless_options_are_refused(given, words) -> None:
    with pytest.raises(ConfigurationError, match=words):
        DemoOptions(**given)


@pytest.mark.parametrize('gsd', [None, 0.0, -1.0, 100.0, float('nan')])
def test_a_world_needs_a_sensible_ground_sampling_distance(photo, gsd) -> None:
    with pytest.raises(ConfigurationError, match='--gsd'):
        DemoOptions(world=photo, gsd_m=gsd)


@pytest.mark.parametrize('text', ['', '1', '1,2,3', 'a,b', 'nan,1', '1,inf', '1e9,0'])
def test_a_start_that_is_none_is_refused(text) -> None:
    with pytest.raises(ConfigurationError, match='--start'):
        parse_start(text)


def test_a_start_is_east_then_north() -> None:
    assert parse_start('40,-25.5') == (40.0, -25.5)


@pytest.mark.parametrize(
    'url',
    ['udpout:127.0.0.1:14550', 'udpin:127.0.0.1:14550', 'tcp:localhost:5762', 'udpout:127.3.2.1:9'],
)
def test_loopback_is_this_machine(url) -> None:
    assert is_on_this_machine(url)
    refuse_to_arm_elsewhere(url)


@pytest.mark.parametrize(
    'url',
    [
        'udpin:0.0.0.0:14550',
        'udpout:192.168.1.10:14550',
        'tcp:10.0.0.2:5760',
        'serial:/dev/ttyACM0:921600',
        '/dev/ttyACM0:921600',
        'udpout:no-such-host.invalid:14550',
        '',
        'nonsense',
    ],
)
def test_a_vehicle_that_may_be_real_is_never_armed(url) -> None:
    assert not is_on_this_machine(url)
    with pytest.raises(VehicleError, match='arms'):
        refuse_to_arm_elsewhere(url)


def test_results_go_where_the_user_stands(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    fresh = DemoOptions(seed=7).new_run_dir()
    assert fresh.parent == tmp_path / 'runs'
    assert fresh.name.endswith('-seed7')
    with pytest.raises(ConfigurationError, match='--run-dir'):
        DemoOptions(run_dir=fresh.parent).new_run_dir()


def test_a_label_raster_beside_the_world_is_found_and_said(photo, tmp_path) -> None:
    options = DemoOptions(world=photo, gsd_m=0.5, seed=4)
    assert prepare_world(options, tmp_path).label_file is None
    labels = tmp_path / 'photo_label.png'
    cv2.imwrite(str(labels), np.ones((300, 400), np.uint8))
    prepared = prepare_world(options, tmp_path)
    assert prepared.label_file == labels
    assert 'photo_label.png (found beside it)' in prepared.note
    assert prepared.world.labels is not None


def test_labels_of_another_size_are_refused(photo, tmp_path) -> None:
    labels = tmp_path / 'other.png'
    cv2.imwrite(str(labels), np.ones((30, 40), np.uint8))
    with pytest.raises(WorldError, match='size'):
        prepare_world(DemoOptions(world=photo, gsd_m=0.5, labels=labels), tmp_path)


def test_the_start_follows_the_seed_and_shifts_the_world(photo, tmp_path) -> None:
    starts = set()
    for seed in range(5):
        prepared = prepare_world(DemoOptions(world=photo, gsd_m=1.0, seed=seed), tmp_path)
        again = prepare_world(DemoOptions(world=photo, gsd_m=1.0, seed=seed), tmp_path)
        start = (prepared.start_east_m, prepared.start_north_m)
        assert start == (again.start_east_m, again.start_north_m)
        assert abs(start[0]) <= 60.0
        assert abs(start[1]) <= 45.0
        starts.add(start)
    assert len(starts) == 5
    given = prepare_world(DemoOptions(world=photo, gsd_m=1.0, start='30,-20'), tmp_path)
    column, row = given.world.pixel(0.0, 0.0)
    assert (column, row) == pytest.approx((199.5 + 30.0, 149.5 + 20.0))


def wiring(tmp_path, photo, **changes) -> Wiring:
    prepared = prepare_world(DemoOptions(world=photo, gsd_m=0.5, start='1,2'), tmp_path)
    plain = {
        'world': prepared,
        'camera': DemoOptions(camera_size='704x396', mount_pitch_deg=15.0).camera_options,
        'lens': None,
        'preset': tmp_path / 'preset.yaml',
        'recordings': tmp_path / 'recordings',
        'speed': 2.0,
        'mavlink': 'udpout:127.0.0.1:5',
        'pose_mavlink': None,
        'autopilot_port': 5,
    }
    return Wiring(**{**plain, **changes})


def test_with_our_own_autopilot_six_nodes_share_its_clock(tmp_path, photo) -> None:
    arguments = node_arguments(wiring(tmp_path, photo))
    assert len(arguments) == 6
    assert f"recordings:='{tmp_path / 'recordings'}'" in arguments['recorder']
    for name, given in arguments.items():
        clock = 'publish_clock:=true' if name == 'autopilot_sim' else 'use_sim_time:=true'
        assert clock in given
    assert 'speed:=2.0' in arguments['autopilot_sim']
    assert {'start_x:=1.0', 'start_y:=2.0', 'gsd:=0.5'} <= set(arguments['satellite_view'])
    assert "mavlink:='udpout:127.0.0.1:5'" in arguments['landing']
    assert {'camera_width:=704', 'camera_height:=396'} <= set(arguments['satellite_view'])
    assert not [each for each in arguments['landing'] if each.startswith('camera_')]
    for name in ('satellite_view', 'landing'):
        assert 'mount_pitch:=15.0' in arguments[name]
    for name in ('prompt_generator', 'segmentation', 'landing'):
        assert str(tmp_path / 'preset.yaml') in arguments[name]


def test_a_lens_reaches_the_simulated_camera_only(tmp_path, photo) -> None:
    lens = DemoOptions(distortion='equidistant:0.05,-0.01,0.002,-0.001').lens
    arguments = node_arguments(wiring(tmp_path, photo, lens=lens))
    assert "distortion_model:='equidistant'" in arguments['satellite_view']
    assert 'distortion:=[0.05, -0.01, 0.002, -0.001]' in arguments['satellite_view']
    assert 'distortion' not in ' '.join(arguments['landing'])
    assert DemoOptions(distortion='-0.2,0.04,0,0').lens.model == 'plumb_bob'


def test_a_given_autopilot_replaces_ours_and_leads_the_camera(tmp_path, photo) -> None:
    given = wiring(tmp_path, photo, speed=1.0, pose_mavlink='tcp:127.0.0.1:7', autopilot_port=None)
    arguments = node_arguments(given)
    assert 'autopilot_sim' not in arguments
    assert "pose_mavlink:='tcp:127.0.0.1:7'" in arguments['satellite_view']
    assert 'use_sim_time:=false' in arguments['landing']


def test_every_refusal_is_a_peace_error() -> None:
    with pytest.raises(PeaceError):
        DemoOptions(seed=-1)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The history of a run and the summary that is judged from it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from peace_ros.core.domain import Camera, Label, Pose, RecordingError
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.history import History, Status
from peace_ros.simulation.demo.report import draw_pictures, headline
from peace_ros.simulation.demo.summary import Ending, Setting, Truth, summarise
from peace_ros.simulation.world import World

SECOND = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
SETTING = Setting(seed=3, config='peace_cs', speed=2.0, world='drawn-3')
CAMERA = Camera.from_degrees(64, 64, 73.0)
GSD_M = 0.5


def pose(seconds: float, north_m: float, east_m: float, altitude_m: float) -> Pose:
    return Pose(round(seconds * SECOND), north_m, east_m, -altitude_m, LEVEL, altitude_m)


def truth(labels: np.ndarray | None, start_east_m: float = 0.0) -> Truth:
    image = np.full((800, 800, 3), 100, np.uint8)
    world = World(image, labels, GSD_M, 'w')
    return Truth(NadirCamera(replace(world, centre_east_m=-start_east_m), CAMERA), 1.5)


def meadow() -> np.ndarray:
    """Grass, with a road 20 m wide through the middle from north to south."""
    labels = np.full((800, 800), Label.GRASS, np.uint8)
    labels[:, 380:420] = Label.PAVED
    return labels


def history_of_a_landing(east_m: float = 30.0) -> History:
    history = History()
    history.engaged_ns = 10 * SECOND
    for k in range(61):
        done = min(1.0, max(0.0, (k - 10) / 40.0))
        history.add_pose(pose(k, 0.0, done * east_m, 100.0 - 80.0 * done))
    frame = np.full((64, 64, 3), 90, np.uint8)
    for k in range(8, 50):
        history.add_heatmap(k * SECOND, np.full((32, 32), 200, np.uint8), frame)
    history.add_prompt('A photo of {term}.')
    history.add_prompt('A blurred photo of {term}.')
    history.add_prompt('A photo of {term}.')
    states = [(5, 'IDLE'), (11, 'SEARCHING'), (20, 'AIMING'), (30, 'LANDING'), (50, 'HANDOVER')]
    for seconds, state in states:
        values = {'state': state, 'focus_radius_m': '9.0', 'focus_north_m': '0'}
        values.update(focus_east_m='1', site_north_m='0', site_east_m=str(east_m))
        history.add_status(Status(seconds * SECOND, values))
    return history


def test_a_landing_on_grass_is_safe_with_its_true_clearance() -> None:
    history = history_of_a_landing(30.0)
    summary = summarise(history, Ending('handover', 'done', 50 * SECOND), SETTING, truth(meadow()))
    assert summary.outcome == 'handover'
    assert summary.safe is True
    assert summary.reached
    assert summary.succeeded
    assert summary.altitude_agl_m == pytest.approx(20.0)
    assert summary.clearance_m == pytest.approx(20.0, abs=2 * GSD_M)
    assert summary.duration_s == pytest.approx(40.0)
    assert summary.horizontal_distance_m == pytest.approx(30.0)
    assert summary.frames == 40
    assert summary.heatmap_hz == pytest.approx(1.0)
    assert summary.prompts == ('A photo of {term}.', 'A blurred photo of {term}.')
    assert [(each.name, each.seconds) for each in summary.states] == [
        ('SEARCHING', pytest.approx(9.0)),
        ('AIMING', pytest.approx(10.0)),
        ('LANDING', pytest.approx(20.0)),
        ('HANDOVER', pytest.approx(0.0)),
    ]
    assert summary.hand_over == {'east_m': pytest.approx(30.0), 'north_m': pytest.approx(0.0)}


def test_a_landing_on_the_road_is_unsafe_whatever_the_node_believed() -> None:
    history = history_of_a_landing(5.0)
    summary = summarise(history, Ending('handover', 'done', 50 * SECOND), SETTING, truth(meadow()))
    assert summary.safe is False
    assert summary.clearance_m == 0.0
    assert not summary.succeeded
    assert 'UNSAFE' in summary.headline()
    assert 'red' in str(headline(summary).style)


def test_the_edge_of_the_vehicle_counts() -> None:
    beside = truth(meadow()).judge(pose(0, 0.0, 11.0, 20.0))
    clear = truth(meadow()).judge(pose(0, 0.0, 12.5, 20.0))
    assert (beside.safe, clear.safe) == (False, True)


def test_the_start_shifts_the_vehicle_in_the_world() -> None:
    assert truth(meadow()).judge(pose(0, 0.0, 0.0, 20.0)).safe is False
    assert truth(meadow(), start_east_m=40.0).judge(pose(0, 0.0, 0.0, 20.0)).safe is True


def test_without_labels_a_hand_over_suffices_and_is_said_to_be_unjudged() -> None:
    ending = Ending('handover', 'done', 50 * SECOND)
    for world in (truth(None), truth(np.zeros((800, 800), np.uint8))):
        summary = summarise(history_of_a_landing(), ending, SETTING, world)
        assert summary.safe is None
        assert summary.clearance_m is None
        assert summary.succeeded
        assert 'no ground truth' in summary.headline()


@pytest.mark.parametrize('outcome', ['no_zone', 'timeout', 'aborted', 'error'])
def test_any_other_outcome_is_no_success(outcome) -> None:
    summary = summarise(
        history_of_a_landing(), Ending(outcome, 'because', 50 * SECOND), SETTING, truth(meadow())
    )
    assert not summary.succeeded
    assert summary.safe is None
    assert 'because' in summary.headline()


def test_a_hand_over_that_is_only_claimed_is_no_success() -> None:
    ending = Ending('handover', 'done', 30 * SECOND)
    summary = summarise(history_of_a_landing(), ending, SETTING, truth(meadow()))
    assert summary.altitude_agl_m == pytest.approx(60.0)
    assert not summary.reached
    assert not summary.succeeded


def test_a_run_that_never_began_still_has_a_summary(tmp_path) -> None:
    summary = summarise(History(), Ending('error', 'no node', None), SETTING, truth(meadow()))
    assert summary.frames == 0
    assert summary.altitude_agl_m is None
    assert draw_pictures(History(), summary, truth(meadow()), tmp_path) == []


def test_the_json_holds_what_the_issue_of_a_run_needs(tmp_path) -> None:
    ending = Ending('handover', 'done', 50 * SECOND)
    summary = summarise(history_of_a_landing(), ending, SETTING, truth(meadow()))
    summary.write(tmp_path / 'summary.json')
    content = json.loads((tmp_path / 'summary.json').read_text())
    assert set(content) >= {
        'outcome',
        'safe',
        'altitude_agl_m',
        'duration_s',
        'horizontal_distance_m',
        'clearance_m',
        'frames',
        'heatmap_hz',
        'prompts',
        'states',
        'seed',
        'config',
        'speed',
        'world',
        'mirrored',
    }
    assert content['states'][0] == {'name': 'SEARCHING', 'seconds': 9.0}
    (tmp_path / 'none').write_text('a file in place of a folder')
    with pytest.raises(RecordingError):
        summary.write(tmp_path / 'none' / 'summary.json')


def test_the_camera_that_sees_beyond_the_world_is_reported() -> None:
    history = history_of_a_landing()
    ending = Ending('timeout', '', 50 * SECOND)
    assert not summarise(history, ending, SETTING, truth(meadow())).mirrored
    far = truth(meadow(), start_east_m=170.0)
    assert summarise(history, ending, SETTING, far).mirrored


def test_pictures_are_drawn_from_the_history(tmp_path) -> None:
    world = truth(meadow())
    history = history_of_a_landing()
    summary = summarise(history, Ending('handover', 'done', 50 * SECOND), SETTING, world)
    written = draw_pictures(history, summary, world, tmp_path)
    assert [path.name for path in written] == ['trajectory.png', 'filmstrip.png']
    assert all(path.stat().st_size > 5000 for path in written)


def test_sites_that_creep_are_one_site_and_poses_never_run_backwards() -> None:
    history = History()
    for k, east_m in enumerate((10.0, 11.0, 12.0, 60.0)):
        values = {'state': 'AIMING', 'site_north_m': '0', 'site_east_m': str(east_m)}
        history.add_status(Status(k, values))
    assert [site[1] for site in history.sites] == [12.0, 60.0]
    history.add_pose(pose(2, 0, 0, 50))
    history.add_pose(pose(1, 0, 0, 99))
    assert [each.altitude_agl_m for each in history.poses] == [50]


def test_rates_are_of_the_last_seconds() -> None:
    history = History()
    assert history.heatmap_hz() == 0.0
    for k in range(100):
        history.add_heatmap(k * SECOND // 4, np.zeros((2, 2), np.uint8), None)
    assert history.heatmap_hz() == pytest.approx(4.0)

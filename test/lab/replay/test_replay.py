# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay of the small bag with the bundled models."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path

import cv2
import numpy as np
import pytest
from rich.console import Console

from peace_ros.core.domain import RecordingError
from peace_ros.core.messages import diagnostic_values, frame_from_message, stamp_ns_of
from peace_ros.lab.replay import ReplayOptions, SourceOptions, replay
from peace_ros.lab.replay.console import replay_in_terminal
from peace_ros.recording import BagReader, BagWriter, VideoWriter
from peace_ros.recording.messages import jpeg_message, pose_stamped

DATA = Path(__file__).resolve().parents[2] / 'data'
SMALL = DATA / 'small.mcap'


def test_a_replay_writes_the_topics_of_a_flight_with_the_stamps_of_its_frames(tmp_path) -> None:
    progress = []
    options = ReplayOptions(SMALL, out=tmp_path / 'out', part=SourceOptions(limit=5))
    report, folder = replay(options, lambda *told: progress.append(told))
    assert report.frames == 5
    assert report.was_engaged
    assert [told[:2] for told in progress] == [(k, 5) for k in range(1, 6)]
    assert sorted(each.name for each in folder.iterdir()) == [
        'overlays.png',
        'replay.mcap',
        'summary.json',
    ]
    summary = json.loads((folder / 'summary.json').read_text())
    assert summary['frames'] == 5
    assert summary['heatmaps']['used'] >= 4
    with BagReader(folder / 'replay.mcap') as bag:
        assert set(bag.topics) == {'/heatmap', '/landing/status', '/overlay/compressed', '/prompt'}
        stamps = {
            topic: [stamp_ns_of(message) for _, _, message in bag.messages([topic])]
            for topic in ('/heatmap', '/overlay/compressed', '/prompt')
        }
        states = [
            diagnostic_values(message)['state']
            for _, _, message in bag.messages(['/landing/status'])
        ]
        (_, _, overlay) = next(bag.messages(['/overlay/compressed']))
    with BagReader(SMALL) as bag:
        frames = [stamp_ns_of(m) for _, _, m in bag.messages(['/image/compressed'])][:5]
    assert all(found == frames for found in stamps.values())
    assert states[0] == 'SEARCHING' or 'HOLD' in states[:2]
    assert frame_from_message(overlay).image_rgb.shape == (352, 352, 3)
    assert cv2.imread(str(folder / 'overlays.png')).std() > 10.0


def test_the_same_recording_gives_the_same_bytes_of_heatmaps(tmp_path) -> None:
    found = []
    for name in ('first', 'second'):
        part = SourceOptions(limit=3)
        _, folder = replay(ReplayOptions(SMALL, out=tmp_path / name, part=part))
        with BagReader(folder / 'replay.mcap') as bag:
            found.append([m.data.tobytes() for _, _, m in bag.messages(['/heatmap'])])
    assert found[0] == found[1]
    assert len(found[0]) == 3


def pattern(level: int, width: int = 96) -> np.ndarray:
    """Return a picture that a camera may have taken."""
    rng = np.random.default_rng(level)
    return np.clip(rng.normal(100, 30, (96, width, 3)) + level / 9, 5, 250).astype(np.uint8)


@pytest.mark.parametrize(
    ('bad', 'says'),
    [
        (np.full((96, 96, 3), 120, np.uint8), 'of one colour'),
        (np.full((96, 96, 3), 255, np.uint8), 'of one colour'),
        (pattern(3, width=128), 'its sides 1.33 : 1 where the camera began with 1.00 : 1'),
    ],
)
def test_frames_that_a_flight_refuses_are_refused_and_counted(tmp_path, bad, says) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k, each in enumerate([pattern(0), pattern(1), bad, bad, pattern(4)]):
            stamp_ns = 1 + k * 500_000_000
            bag.write('/pose', stamp_ns, pose_stamped(stamp_ns, (0.0, 0.0, 50.0), (1, 0, 0, 0)))
            bag.write('/image', stamp_ns, jpeg_message(each, stamp_ns, 95))
    report, folder = replay(ReplayOptions(tmp_path / 'a.mcap', 'dd_cs', tmp_path / 'out'))
    assert (report.frames, report.unusable_frames) == (3, 2)
    assert says in report.first_fault
    with BagReader(folder / 'replay.mcap') as bag:
        stamps = [stamp_ns_of(message) for _, _, message in bag.messages(['/heatmap'])]
    assert stamps == [1, 500_000_001, 2_000_000_001]


def test_a_video_gets_an_overlay_video(tmp_path) -> None:
    with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
        for k in range(6):
            video.write(pattern(30 * k))
    options = ReplayOptions(tmp_path / 'a.mp4', out=tmp_path / 'out', part=SourceOptions(every=2))
    report, folder = replay(options)
    assert report.frames == 3
    capture = cv2.VideoCapture(str(folder / 'overlays.mp4'))
    assert int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) == 3
    capture.release()


def test_nothing_is_written_half_when_no_frame_can_be_used(tmp_path) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.write('/pose', 1, pose_stamped(1, (0.0, 0.0, 50.0), (1.0, 0.0, 0.0, 0.0)))
        image = jpeg_message(np.zeros((32, 32, 3), np.uint8), 1)
        image.data = image.data[:30]
        bag.write('/image', 1, image)
    with pytest.raises(RecordingError, match='none of 1 frames'):
        replay(ReplayOptions(tmp_path / 'a.mcap', out=tmp_path / 'out'))
    assert list((tmp_path / 'out').iterdir()) == []


def test_results_go_where_the_user_stands_and_not_beside_the_recording(
    tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folders = [ReplayOptions(SMALL).new_folder() for _ in range(2)]
    assert folders == [tmp_path / 'runs' / 'small_replay', tmp_path / 'runs' / 'small_replay_2']


def test_a_path_that_looks_like_markup_is_printed(tmp_path) -> None:
    folder = tmp_path / '[' / 'y]'
    folder.mkdir(parents=True)
    with VideoWriter(folder / 'a.mp4', 5.0) as video:
        for k in range(3):
            video.write(pattern(30 * k))
    console = Console(record=True, width=400, file=StringIO())
    options = ReplayOptions(folder / 'a.mp4', out=tmp_path / 'out', part=SourceOptions(limit=1))
    replay_in_terminal(options, console)
    assert f'{folder}/a.mp4' in console.export_text()

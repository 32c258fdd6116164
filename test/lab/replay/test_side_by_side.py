# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two replays on one page, a part of a recording, and when the landing begins."""

from __future__ import annotations

import re
from math import inf
from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import ConfigurationError, RecordingError
from peace_ros.lab.replay import ReplayOptions, SourceOptions, open_source
from peace_ros.lab.replay.assignments import with_assignments
from peace_ros.lab.replay.excerpt import Excerpt
from peace_ros.lab.replay.run import Replayer, replay
from peace_ros.lab.replay.side_by_side import moments_apart, replay_side_by_side

SMALL = Path(__file__).resolve().parents[2] / 'data' / 'small.mcap'
SECOND = 1_000_000_000


def test_other_parameters_are_compared_on_one_page_that_needs_no_other_file(tmp_path) -> None:
    options = ReplayOptions(
        SMALL,
        out=tmp_path / 'out',
        assignments=('segmentation.template=A photo of {term}.',),
        segment=Excerpt(1.0, 4.0),
    )
    told = []
    sides, page = replay_side_by_side(options, ('dd_cs', 'peace_cs'), lambda *g: told.append(g))
    assert [each.name for each in sides] == [
        'A: dd_cs',
        'B: peace_cs segmentation.template=A photo of {term}.',
    ]
    assert [each.report.frames for each in sides] == [7, 7]
    assert sides[0].report.prompts != sides[1].report.prompts
    assert page == tmp_path / 'out' / 'side_by_side.html'
    text = page.read_text()
    assert 'A: dd_cs' in text
    assert 'template=A photo of {term}.' in text
    assert text.count('data:image/jpeg;base64,') == 2, 'in three seconds two moments are apart'
    assert '<svg' in text
    assert not re.search(r'(?:src|href)="(?!data:|#)', text)
    assert (tmp_path / 'out' / 'A' / 'summary.json').is_file()
    assert (tmp_path / 'out' / 'B' / 'replay.mcap').is_file()
    first, second = (each.trace for each in sides)
    wanted = max(range(7), key=lambda k: np.count_nonzero(first.safe(k) ^ second.safe(k)))
    assert moments_apart(first, second)[0] == first.frame_stamps_ns[wanted]


def test_a_second_preset_that_cannot_be_used_is_refused_before_any_replay(tmp_path) -> None:
    options = ReplayOptions(SMALL, out=tmp_path / 'out')
    with pytest.raises(ConfigurationError, match='no_such'):
        replay_side_by_side(options, ('dd_cs', 'no_such'))
    assert not (tmp_path / 'out').exists()


def test_a_segment_holds_the_frames_between_two_moments() -> None:
    def stamps(segment: Excerpt) -> list[float]:
        replayer = Replayer(open_source(SMALL, SourceOptions(limit=8)), 'dd_cs', segment=segment)
        looks = [each for each in replayer.events() if hasattr(each, 'heatmap')]
        return [each.frame.stamp_ns / SECOND - 1.0 for each in looks]

    assert stamps(Excerpt.parse('1:2')) == [1.0, 1.5, 2.0]
    assert stamps(Excerpt.parse('2.9:')) == [3.0, 3.5]
    assert stamps(Excerpt.parse(':0.5')) == [0.0, 0.5]
    assert Excerpt.parse(':') == Excerpt(0.0, inf)


def test_a_segment_without_frames_says_where_the_recording_ends(tmp_path) -> None:
    options = ReplayOptions(SMALL, 'dd_cs', tmp_path / 'out', segment=Excerpt(60.0, 70.0))
    with pytest.raises(RecordingError, match=r'no frame lies in the segment.* 22\.0 s after'):
        replay(options)


def test_the_landing_begins_when_the_user_says(tmp_path) -> None:
    source = open_source(SMALL, SourceOptions(limit=6))
    steps = [
        each
        for each in Replayer(source, 'dd_cs', engage_at_s=1.5).events()
        if hasattr(each, 'decision')
    ]
    begun = next(each for each in steps if each.decision.state.value != 'IDLE')
    assert begun.stamp_ns / SECOND - 1.0 == pytest.approx(1.5)


def test_assignments_leave_the_preset_as_it_is() -> None:
    preset = ReplayOptions(SMALL, 'dd_cs').preset
    changed = with_assignments(
        preset, ['landing.safety_threshold=0.9', 'landing.vehicle.system_id=9']
    )
    assert changed.sections['/**/landing']['safety_threshold'] == 0.9
    assert changed.sections['/**/landing']['vehicle.system_id'] == 9
    assert preset.name == 'dd_cs'
    for wrong in ('landing.safety_threshold=high', 'landing=3', 'recorder.file_mb=3'):
        with pytest.raises(ConfigurationError, match='--set'):
            with_assignments(preset, [wrong])

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A file of the flight recorder: replayed with its own parameters, also when it was cut."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.landing import LandingParameters
from peace_ros.core.node_parameters import RecorderParameters
from peace_ros.lab.replay import ReplayOptions, SourceOptions
from peace_ros.lab.replay.golden import compare
from peace_ros.lab.replay.recorded import recorded_preset
from peace_ros.lab.replay.run import replay
from peace_ros.lab.replay.trace import Trace, TraceBuilder
from peace_ros.recorder.flight_file import TYPESTORE, Note
from peace_ros.recorder.store import RecordingStore
from peace_ros.recording import BagReader

SMALL = Path(__file__).resolve().parents[2] / 'data' / 'small.mcap'
PARAMETERS = """\
/**/landing:
  ros__parameters:
    safety_threshold: 0.9
    use_sim_time: false
    vehicle.system_id: 42
"""


def record(folder: Path, parameters: str, frames: int = 8) -> RecordingStore:
    """Record the beginning of the small bag as a flight would be, and leave the file open."""
    store = RecordingStore(folder, RecorderParameters(least_free_mb=0), print)
    store.describe('parameters/landing', {'yaml': parameters})
    images = 0
    with BagReader(SMALL) as bag:
        for topic, at_ns, message in bag.messages([*bag.topics]):
            images += topic == '/image/compressed'
            if images > frames:
                break
            kind = bag.topics[topic]
            cdr = bytes(TYPESTORE.serialize_cdr(message, kind))
            store.add(Note(topic.replace('/ground_truth/pose', '/landing/pose'), kind, at_ns, cdr))
    store.flush()
    return store


def traced(source: Path, out: Path, **options) -> Trace:
    builder = TraceBuilder()
    given = ReplayOptions(source, out=out, part=SourceOptions(limit=8), **options)
    report, _ = replay(given, trace=builder)
    return builder.trace(given.preset, report)


def test_a_cut_file_is_replayed_to_the_same_answers_with_its_own_parameters(tmp_path) -> None:
    store = record(tmp_path / 'flight', PARAMETERS)
    cut = tmp_path / 'cut.mcap'
    shutil.copy(store.path, cut)
    whole = store.path
    store.close()
    preset = recorded_preset(cut)
    assert preset.fill('landing', LandingParameters).safety_threshold == 0.9
    wanted = traced(SMALL, tmp_path / 'wanted', assignments=('landing.safety_threshold=0.9',))
    for name, path in (('cut', cut), ('whole', whole)):
        found = traced(path, tmp_path / name)
        assert found.made_with['preset'] == 'recorded'
        assert all(each.passed for each in compare(found, wanted))
        np.testing.assert_array_equal(found.setpoints_m_s, wanted.setpoints_m_s)
        assert found.masks == wanted.masks
    named = ReplayOptions(cut, 'dd_cs').preset
    assert named.name == 'dd_cs', 'what the user names goes before'


def test_other_recordings_have_no_parameters(tmp_path) -> None:
    assert recorded_preset(SMALL) is None
    assert recorded_preset(tmp_path / 'none.mcap') is None
    (tmp_path / 'short.mcap').write_bytes(b'\x89MCAP0')
    assert recorded_preset(tmp_path / 'short.mcap') is None
    assert ReplayOptions(SMALL).preset.name == 'peace_cs'


def test_parameters_of_another_version_are_refused_by_name(tmp_path) -> None:
    text = PARAMETERS.replace('safety_threshold', 'safety_treshold')
    store = record(tmp_path, text, frames=1)
    store.close()
    with pytest.raises(ConfigurationError, match='did you mean safety_threshold'):
        recorded_preset(next(tmp_path.glob('*.mcap')))

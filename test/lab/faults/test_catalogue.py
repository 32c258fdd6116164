# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The matrix: complete, distinct, and the same in the documentation."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.landing import State
from peace_ros.lab.faults.catalogue import FAULTS, REPRESENTATIVE, choose, groups, load, named
from peace_ros.lab.faults.fault import GOING, UNDER_WAY
from peace_ros.lab.faults.table import markdown

DOCS = Path(__file__).resolve().parents[3] / 'docs'

ASKED_FOR = {
    'camera stops, freezes, goes black, saturates, corrupts': (
        'camera_stops camera_freezes camera_black camera_saturates camera_cut_short '
        'camera_encoding camera_noise'
    ),
    'jumps in size or stamp': 'camera_half_size camera_other_shape stamp_future stamp_past',
    'stamps in the future, backwards, equal': 'stamp_future stamp_backwards stamp_equal',
    'prompt late or missing': 'prompt_late prompt_missing',
    'model slow, throwing, NaN': 'model_slow model_throws model_breaks model_nan',
    'heatmap all safe, all unsafe, flickering': (
        'heatmap_all_safe heatmap_all_safe_over_roofs heatmap_all_unsafe heatmap_flickers'
    ),
    'telemetry stops, altitude NaN, jumps, sign error, wrong frame': (
        'telemetry_stops altitude_nan altitude_jumps_up altitude_jumps_down altitude_sign '
        'frame_enu frame_south frame_south_at_origin frame_msl'
    ),
    'link lost for 1, 5, 60 s, duplicated, reordered, corrupted, second companion': (
        'line_lost_1_s line_lost_5_s line_lost_60_s line_doubles line_shuffles line_damages '
        'second_companion_mode'
    ),
    'autopilot reboots, refuses, changes mode': (
        'autopilot_reboots autopilot_refuses pilot_takes_over_landing'
    ),
    'barometer steps and drifts': (
        'barometer_steps_up barometer_steps_down barometer_drifts_up barometer_drifts_down'
    ),
    'GNSS lost': 'gnss_lost gnss_lost_for_good gnss_lost_position_stale',
    'clock steps': (
        'clock_steps_forward clock_steps_back autopilot_clock_forward autopilot_clock_back'
    ),
    'process killed and restarted at each state': (
        'landing_killed_searching landing_killed_aiming landing_killed_landing '
        'landing_killed_waiting landing_killed_climbing landing_killed_restarting '
        'landing_killed_handover landing_killed_hold segmentation_killed camera_killed'
    ),
    'executor stalled': 'executor_stalls landing_stands_still',
    'a defect in each thread of the landing node': (
        'thread_timer thread_callback thread_setpoint_sender thread_mavlink_link thread_engage '
        'thread_hand_over thread_after_handover thread_stuck'
    ),
    'disk full while recording': 'disk_full',
    'wind 10 m/s': 'wind_10_m_s',
    'a person walks under at 30 m': 'person_seen_at_30_m person_painted_at_30_m',
    'every site occupied': 'every_site_occupied',
}


@pytest.mark.parametrize('wish', ASKED_FOR)
def test_everything_that_was_asked_for_is_there(wish: str) -> None:
    names = {fault.name for fault in FAULTS}
    assert set(ASKED_FOR[wish].split()) <= names


def test_every_fault_has_a_name_of_its_own_and_its_sentences() -> None:
    names = [fault.name for fault in FAULTS]
    assert len(names) == len(set(names)) >= 45
    assert not set(names) & set(groups())
    for fault in FAULTS:
        assert fault.goes_wrong.endswith('.'), fault.name
        assert fault.behaviour.endswith('.'), fault.name
        assert fault.at.state in {state.value for state in State}


def test_what_has_to_happen_can_happen_before_the_fault_is_over() -> None:
    for fault in FAULTS:
        e = fault.expected
        limits = (e.within_s, e.still_within_s or 0.0, e.zero_within_s or 0.0)
        # A take-over is final, so its limits may lie after the end of the injection.
        assert max(limits) < fault.lasts_s + 1.5, fault.name
        if e.still_within_s is not None:
            # Ground truth of some tenths of a second has to show that the vehicle stands.
            assert e.still_within_s + 0.35 <= fault.lasts_s, fault.name


def test_no_fault_asks_for_nothing() -> None:
    for fault in FAULTS:
        e = fault.expected
        asked = (
            *e.reaches,
            *e.says,
            e.still_within_s,
            e.zero_within_s,
            e.silent_within_s,
            e.refuses or None,
        )
        assert any(each is not None for each in asked), fault.name


def test_a_state_that_no_landing_comes_to_by_itself_is_led_to() -> None:
    for fault in FAULTS:
        undisturbed = {State.IDLE.value, *GOING}
        assert (fault.lead is not None) == (fault.at.state not in undisturbed), fault.name


def test_names_and_groups_choose() -> None:
    assert choose([]) == tuple(sorted(FAULTS, key=choose([]).index))
    assert [fault.name for fault in choose(['camera_black'])] == ['camera_black']
    assert {fault.group for fault in choose(['clock', 'camera_black'])} == {'clock', 'camera'}
    assert named('gnss_lost').name == 'gnss_lost'
    with pytest.raises(ConfigurationError, match='nonsense'):
        choose(['nonsense'])


def test_faults_of_one_setting_are_neighbours() -> None:
    settings = [fault.setting for fault in choose([])]
    changes = sum(a != b for a, b in pairwise(settings))
    assert changes == len(set(settings)) - 1


def test_the_representatives_exist() -> None:
    assert len({named(name).group for name in REPRESENTATIVE}) == len(REPRESENTATIVE)


def test_the_documentation_is_current() -> None:
    text = (DOCS / 'faults.md').read_text(encoding='utf-8')
    assert text == markdown(), 'python -m peace_ros.lab.faults.table > docs/faults.md'
    assert all(f'| `{fault.name}` |' in text for fault in FAULTS)


GOOD = {
    'goes_wrong': 'Something.',
    'injection': '{camera: {late: 2.0}}',
    'expected': '{reaches: [HOLD], within_s: 1.0, allowed: [UNDER_WAY, HOLD]}',
    'behaviour': 'HOLD.',
}


def written(folder: Path, **changes: str) -> Path:
    file = folder / 'faults.yaml'
    lines = [f'      {key}: {value}' for key, value in {**GOOD, **changes}.items()]
    file.write_text('\n'.join(['groups:', '  mine:', '    my_fault:', *lines]))
    return file


def test_a_fault_is_read_from_a_file(tmp_path: Path) -> None:
    (fault,) = load(written(tmp_path, lead='{heatmap: nothing}', at='{state: HOLD}'))
    assert (fault.name, fault.group, fault.at.state) == ('my_fault', 'mine', 'HOLD')
    assert fault.expected.allowed == (*UNDER_WAY, 'HOLD')
    tampers: dict[str, Any] = {}
    bench: Any = SimpleNamespace(node=SimpleNamespace(tamper=tampers.__setitem__))
    fault.injection.begin(bench)
    ((delay_s, message),) = tampers['image']('picture')
    assert (delay_s, message) == (2.0, 'picture')
    fault.lead.begin(bench)
    assert list(tampers['heatmap']('heatmap')) == []
    fault.injection.end()
    assert tampers['image'] is None
    assert tampers['heatmap'] is not None


@pytest.mark.parametrize(
    ('key', 'value', 'words'),
    [
        ('injection', '{earthquake: 3}', "injection 'earthquake'"),
        ('injection', '{camera: {shaken: 3}}', "tamper 'shaken'"),
        ('injection', '{autopilot: [altitude], kill: landing}', 'my_fault'),
        ('expected', '{reaches: [HOLDING], within_s: 1.0}', "state 'HOLDING'"),
        ('expected', '{reaches: [HOLD]}', 'within 0.0 s'),
        ('at', '{above_m: 3.0}', 'above_m'),
        ('colour', 'red', 'colour'),
    ],
)
def test_a_fault_that_cannot_be_used_is_refused_by_name(
    tmp_path: Path, key: str, value: str, words: str
) -> None:
    with pytest.raises(ConfigurationError, match='fault my_fault of group mine') as refused:
        load(written(tmp_path, **{key: value}))
    assert words in str(refused.value)


def test_a_matrix_that_is_no_matrix_is_refused(tmp_path: Path) -> None:
    file = tmp_path / 'faults.yaml'
    for text in ('', 'groups: 3', '{'):
        file.write_text(text)
        with pytest.raises(ConfigurationError, match='cannot be read'):
            load(file)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two replays compared: what counts as the same, what does not, and where it begins."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.lab.replay.golden import SLACK_STEPS, compare, first_difference_ns
from peace_ros.lab.replay.trace import Trace

FRAMES, STEPS, SIDE = 20, 100, 40
SECOND = 1_000_000_000
SEARCHING = 40
"""Decisions before the landing aims at a site."""


def masks(safe: np.ndarray) -> tuple[bytes, ...]:
    return tuple(zlib.compress(np.packbits(each).tobytes()) for each in safe)


def half_safe() -> np.ndarray:
    safe = np.zeros((FRAMES, SIDE, SIDE), bool)
    safe[:, :, : SIDE // 2] = True
    return safe


def trace(**changes) -> Trace:
    sites = np.full((STEPS, 2), np.nan)
    sites[SEARCHING:] = 12.0, -3.0
    setpoints = np.zeros((STEPS, 3))
    setpoints[SEARCHING:] = 1.0, 0.0, 0.5
    plain = Trace(
        made_with={'peace_ros': '1'},
        frame_stamps_ns=np.arange(FRAMES) * SECOND // 2,
        prompts=('A {term}.',) * FRAMES,
        mask_shape=(SIDE, SIDE),
        masks=masks(half_safe()),
        step_stamps_ns=np.arange(STEPS) * SECOND // 10,
        states=('SEARCHING',) * SEARCHING + ('AIMING',) * (STEPS - SEARCHING),
        sites_m=sites,
        setpoints_m_s=setpoints,
        used=FRAMES,
        was_engaged=True,
    )
    return replace(plain, **changes)


def delayed(count: int) -> Trace:
    """The same replay, which aims a few decisions later."""
    plain = trace()
    return trace(
        states=('SEARCHING',) * count + plain.states[:-count],
        sites_m=np.concatenate((plain.sites_m[:count], plain.sites_m[:-count])),
        setpoints_m_s=np.concatenate((plain.setpoints_m_s[:count], plain.setpoints_m_s[:-count])),
    )


def failed(found: Trace, golden: Trace | None = None) -> set[str]:
    return {each.name for each in compare(found, golden or trace()) if not each.passed}


def test_a_stored_replay_is_read_back_and_equals_itself(tmp_path) -> None:
    trace().write(tmp_path / 'a.golden')
    stored = Trace.read(tmp_path / 'a.golden')
    assert failed(trace(), stored) == set()
    assert first_difference_ns(compare(trace(), stored)) is None
    np.testing.assert_array_equal(stored.safe(3), half_safe()[3])
    assert stored.distinct_states == ('SEARCHING', 'AIMING')
    assert stored.made_with == {'peace_ros': '1'}


@pytest.mark.parametrize('content', [b'', b'PK\x03\x04 cut short', b'no archive'])
def test_a_damaged_golden_file_is_one_sentence(tmp_path, content) -> None:
    (tmp_path / 'a.golden').write_bytes(content)
    with pytest.raises(RecordingError, match='--remake-golden') as told:
        Trace.read(tmp_path / 'a.golden')
    assert '\n' not in str(told.value)


def test_a_replay_in_which_nothing_was_engaged_never_passes() -> None:
    idle = trace(was_engaged=False, used=0)
    assert 'engagement' in failed(idle, idle)


def test_a_missing_frame_and_a_new_one_are_differences_of_their_moment() -> None:
    plain = trace()
    fewer = trace(
        frame_stamps_ns=np.delete(plain.frame_stamps_ns, 7),
        prompts=plain.prompts[1:],
        masks=plain.masks[1:],
    )
    for found, golden in ((fewer, plain), (plain, fewer)):
        assert failed(found, golden) == {'frames'}
        assert first_difference_ns(compare(found, golden)) == plain.frame_stamps_ns[7]


def test_heatmaps_that_did_not_reach_the_map_are_missed() -> None:
    assert failed(trace(used=FRAMES - 1)) == set()
    assert failed(trace(used=FRAMES - 2)) == {'frames used'}


def test_one_word_in_twenty_frames_may_differ_and_not_two() -> None:
    first, *rest = trace().prompts
    assert failed(trace(prompts=('B {term}.', *rest))) == set()
    two = trace(prompts=(first, 'B {term}.', 'B {term}.', *rest[2:]))
    assert failed(two) == {'prompts'}
    assert first_difference_ns(compare(two, trace())) == trace().frame_stamps_ns[1]


def test_heatmaps_may_differ_at_borders_only() -> None:
    def changed(pixels: int) -> Trace:
        safe = half_safe()
        safe[5].reshape(-1)[:pixels] ^= True
        return trace(masks=masks(safe))

    assert failed(changed(SIDE * SIDE // 200)) == set()
    assert failed(changed(2 * SIDE)) == set(), 'IoU 0.95'
    assert failed(changed(6 * SIDE)) == {'heatmaps'}, 'IoU 0.86'
    assert first_difference_ns(compare(changed(6 * SIDE), trace())) == trace().frame_stamps_ns[5]


def test_a_few_pixels_are_a_border_whatever_their_iou() -> None:
    safe = np.zeros((FRAMES, SIDE, SIDE), bool)
    nothing = trace(masks=masks(safe))
    safe[5, 0, :8] = True
    assert failed(trace(masks=masks(safe)), nothing) == set()
    safe[5, 0, :9] = True
    assert failed(trace(masks=masks(safe)), nothing) == {'heatmaps'}


def test_heatmaps_of_another_model_are_not_compared_pixel_by_pixel() -> None:
    (check,) = [
        each for each in compare(trace(mask_shape=(20, 80)), trace()) if each.name == 'heatmaps'
    ]
    assert not check.passed
    assert 'of 80 x 20 in place of 40 x 40 px' in check.found


def test_a_frame_with_another_prompt_is_not_held_against_its_heatmap() -> None:
    safe = half_safe()
    safe[5] = False
    prompts = [*trace().prompts]
    prompts[5] = 'B {term}.'
    assert failed(trace(masks=masks(safe), prompts=tuple(prompts))) == set()


def test_decisions_may_come_half_a_second_later_and_no_more() -> None:
    assert failed(delayed(SLACK_STEPS)) == set()
    assert failed(delayed(SLACK_STEPS + 1)) >= {'states'}
    late = compare(delayed(20), trace())
    assert {each.name for each in late if not each.passed} == {'states', 'sites', 'set-points'}
    assert first_difference_ns(late) == trace().step_stamps_ns[SEARCHING]


def test_a_short_state_that_is_new_or_lost_is_found() -> None:
    states = [*trace().states]
    states[20] = 'HOLD'
    with_hold = trace(states=tuple(states))
    for found, golden in ((with_hold, trace()), (trace(), with_hold)):
        assert failed(found, golden) == {'states'}
        assert first_difference_ns(compare(found, golden)) == trace().step_stamps_ns[20]


def test_another_site_and_another_velocity_are_found() -> None:
    plain = trace()
    assert failed(trace(sites_m=plain.sites_m + 2.9)) == set()
    assert failed(trace(sites_m=plain.sites_m + 3.1)) == {'sites'}
    assert failed(trace(setpoints_m_s=plain.setpoints_m_s + 0.29)) == set()
    assert failed(trace(setpoints_m_s=plain.setpoints_m_s - 0.31)) == {'set-points'}
    nowhere = trace(sites_m=np.full((STEPS, 2), np.nan))
    assert failed(nowhere) == {'sites'}


def test_replays_without_a_common_decision_do_not_pass() -> None:
    later = trace(step_stamps_ns=trace().step_stamps_ns + 1)
    assert failed(later) == {'states', 'sites', 'set-points'}

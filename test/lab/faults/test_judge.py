# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The judge: lets a good landing pass, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.faults.fault import Expected, Fault
from peace_ros.lab.faults.judge import describe, judge
from peace_ros.lab.faults.record import Ended, Record, Said, Sent, TruthSample


def with_expected(fault: Fault, **changes: object) -> Fault:
    return replace(fault, expected=replace(fault.expected, **changes))


def test_a_landing_that_holds_and_goes_on_passes(stopping: Fault, record: Record) -> None:
    row = judge(stopping, record)
    assert row.passed, row.failures
    assert row.took_s == pytest.approx(2.0)
    assert row.recovered_s == pytest.approx(0.5)
    assert row.still_after_s == pytest.approx(2.0, abs=0.3)
    assert row.max_descent_m_s == 0.0
    assert row.states == ('LANDING', 'HOLD', 'LANDING')
    assert row.figures['last_motion_s'] == pytest.approx(1.91)


def test_an_unsafe_hand_over_fails_whatever_else_is_good(stopping: Fault, record: Record) -> None:
    record.unsafe.append((7.0, 'a person is 0.4 m beside the point'))
    row = judge(stopping, record)
    assert not row.passed
    assert row.unsafe_handovers == 1
    assert 'a person' in row.failures[0]


def test_a_late_hold_fails(stopping: Fault, record: Record) -> None:
    record.said = [s if s.state != 'HOLD' else replace(s, at_s=s.at_s + 0.8) for s in record.said]
    assert any('2.80 s' in each for each in judge(stopping, record).failures)


def test_a_hold_that_never_comes_fails(stopping: Fault, record: Record) -> None:
    record.said = [replace(s, state='LANDING') for s in record.said]
    failures = judge(stopping, record).failures
    assert any('HOLD never came' in each for each in failures)


def test_the_true_descent_counts_and_not_the_word_of_the_landing(
    stopping: Fault, record: Record
) -> None:
    record.truths = [TruthSample(t.at_s, 0.0, 0.0, 40.0 - t.at_s) for t in record.truths]
    row = judge(stopping, record)
    assert any('descended until' in each for each in row.failures)
    assert row.max_descent_m_s == pytest.approx(1.0, abs=0.01)


def test_no_ground_truth_is_no_proof_of_standing(stopping: Fault, record: Record) -> None:
    record.truths = [t for t in record.truths if t.at_s < 3.0]
    assert any('no ground truth' in each for each in judge(stopping, record).failures)


def test_ground_truth_with_a_hole_is_no_proof_either(stopping: Fault, record: Record) -> None:
    record.truths = [t for t in record.truths if not 3.6 < t.at_s < 4.4]
    assert any('no ground truth for 0.80' in f for f in judge(stopping, record).failures)
    record.truths = []
    assert any('no ground truth for 2.00' in f for f in judge(stopping, record).failures)


def test_motion_on_the_wire_in_hold_fails(stopping: Fault, record: Record) -> None:
    record.sent.append(Sent(4.0, 0.0, 0.0, -0.01))
    failures = judge(stopping, record).failures
    assert any('stand still' in each for each in failures)
    assert any('were not zero' in each for each in failures)


def test_a_landing_that_does_not_go_on_fails(stopping: Fault, record: Record) -> None:
    record.said = [s for s in record.said if s.at_s < 5.5]
    record.said += [Said(5.5 + step / 10.0, 'HOLD') for step in range(45)]
    failures = judge(stopping, record).failures
    assert any('did not follow' in each for each in failures)


def test_a_fault_that_was_never_taken_away_proves_no_recovery(
    stopping: Fault, record: Record
) -> None:
    record.ended_s = None
    assert any('never taken away' in each for each in judge(stopping, record).failures)


def test_a_process_that_ends_by_itself_is_a_crash(stopping: Fault, record: Record) -> None:
    record.ended.append(Ended(3.0, 'landing', 1, meant=False, last_words='Traceback'))
    row = judge(stopping, record)
    assert row.crashes == 1
    assert not row.passed


def test_a_process_that_the_matrix_killed_is_none(stopping: Fault, record: Record) -> None:
    record.ended.append(Ended(3.0, 'segmentation', -9, meant=True))
    row = judge(stopping, record)
    assert row.passed
    assert row.crashes == 0


def test_a_process_may_end_only_with_a_sentence(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, ends_processes=('segmentation',))
    assert any('did not end' in each for each in judge(fault, record).failures)
    record.ended.append(Ended(1.0, 'segmentation', 2, meant=False))
    assert any('without a word' in each for each in judge(fault, record).failures)
    record.ended[0] = replace(record.ended[0], last_words='bundle x is damaged')
    assert judge(fault, record).passed


def test_a_silent_landing_node_hangs(stopping: Fault, record: Record) -> None:
    record.said = [s for s in record.said if not 2.5 < s.at_s < 4.5]
    row = judge(stopping, record)
    assert row.hangs == 1
    assert not row.passed
    record.stopped_s.append((2.5, 4.5))
    assert judge(stopping, record).hangs == 0


def test_silence_until_the_end_is_a_hang_too(stopping: Fault, record: Record) -> None:
    record.closed_s = 12.0
    assert judge(stopping, record).hangs == 1


def test_sinking_below_the_floor_fails_while_it_is_ours(stopping: Fault, record: Record) -> None:
    record.truths.append(TruthSample(7.9, 0.0, 0.0, 18.9))
    assert any('sank to 18.90 m' in each for each in judge(stopping, record).failures)
    record.lost_control_s = 7.0
    assert not any('sank' in each for each in judge(stopping, record).failures)


def test_set_points_after_aborted_fail(stopping: Fault, record: Record) -> None:
    fault = with_expected(
        stopping,
        reaches=('ABORTED',),
        recovers=(),
        still_within_s=None,
        zero_within_s=None,
        stays='ABORTED',
    )
    record.said = [Said(s.at_s, 'ABORTED' if s.at_s >= 0.2 else 'LANDING') for s in record.said]
    record.sent = [s for s in record.sent if s.at_s < 0.3]
    assert judge(fault, record).passed, judge(fault, record).failures
    record.sent.append(Sent(3.0, 0.0, 0.0, 0.0))
    assert 'set-points after ABORTED' in judge(fault, record).failures[-1]
    record.sent.pop()
    record.said[-1] = Said(8.0, 'SEARCHING')
    assert any('was left for SEARCHING' in each for each in judge(fault, record).failures)


def test_what_stays_stays_from_the_recovery_on(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, recovers=('LANDING',), stays='LANDING')
    assert judge(fault, record).passed, judge(fault, record).failures
    record.said[-1] = Said(8.0, 'HOLD')
    assert any('was left for HOLD' in each for each in judge(fault, record).failures)


def test_silence_on_the_wire_is_checked_to_the_end(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, silent_within_s=0.5)
    failures = judge(fault, record).failures
    assert any('set-points after 0.5 s' in each for each in failures)


def test_a_state_that_is_not_allowed_fails(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, allowed=('LANDING', 'WAITING'))
    assert any('HOLD after 2.00 s is not allowed' in each for each in judge(fault, record).failures)


def test_an_engagement_must_be_refused_with_words(stopping: Fault, record: Record) -> None:
    fault = replace(stopping, expected=Expected(refuses=True))
    assert not judge(fault, record).passed
    assert judge(fault, replace(record, refusal='not armed')).passed
    assert not judge(stopping, replace(record, refusal='not armed')).passed


def test_a_flight_that_failed_is_no_success(stopping: Fault) -> None:
    row = judge(stopping, Record(trouble='segmentation ended by itself'))
    assert not row.passed
    assert row.failures == ('segmentation ended by itself',)


def test_an_expectation_names_states_that_exist() -> None:
    with pytest.raises(ConfigurationError, match='HOLDING'):
        Expected(reaches=('HOLDING',), within_s=1.0)
    with pytest.raises(ConfigurationError, match='give both'):
        Expected(reaches=('HOLD',))


def test_the_description_says_every_limit(stopping: Fault) -> None:
    assert describe(stopping) == (
        'HOLD within 2.5 s; no descent after 3 s; zero on the wire within 2.8 s; '
        'afterwards LANDING within 4 s'
    )


def test_a_person_below_is_not_descended_upon_for_long(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, over_person_s=1.5)
    assert any('no person walked below' in each for each in judge(fault, record).failures)
    record.over_person_s = 1.2
    row = judge(fault, record)
    assert row.passed
    assert row.figures['over_person_s'] == 1.2
    record.over_person_s = 1.8
    assert any('over the person for 1.8 s' in each for each in judge(fault, record).failures)


def test_a_reason_that_was_never_said_fails(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, says=('a fence', 'in the way'))
    record.said = [replace(s, reason='a fence is here') for s in record.said]
    failures = judge(fault, record).failures
    assert failures == ('the status never said "in the way"',)
    record.said[-1] = replace(record.said[-1], reason='it is in the way')
    assert judge(fault, record).passed
    assert 'the status says "a fence"' in describe(fault)


def test_a_reason_of_before_the_fault_does_not_count(stopping: Fault, record: Record) -> None:
    fault = with_expected(stopping, says=('a fence',))
    record.said = [Said(-1.0, 'LANDING', 'a fence'), *record.said]
    assert judge(fault, record).failures == ('the status never said "a fence"',)

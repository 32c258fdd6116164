# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps the vehicle from following is named: fence, second commander, battery, STATUSTEXT."""

from math import nan

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.stops import Stops

S = 1_000_000_000
OURS, THEIRS = (1.0, 0.5, 1.5), (0.0, 0.0, 3.0)
VELOCITY, PLACE = 0xDC7, 0xDF8
LIMITED = (0, 0, mavlink.FENCE_BREACH_NONE, 0, mavlink.FENCE_MITIGATE_VEL_LIMIT)


def target(velocity, mask=VELOCITY):
    return mavlink.MAVLink_position_target_local_ned_message(
        0, 1, mask, 0.0, 0.0, 0.0, *velocity, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def fence(*fields):
    return mavlink.MAVLink_fence_status_message(*fields)


def battery(charge_state):
    return mavlink.MAVLink_battery_status_message(
        0, 0, 0, 32767, [12400] * 10, 0, -1, -1, 18, 0, charge_state
    )


def flown(reports, told=OURS, seconds=4.0, stops=None):
    """Send ``told`` at 20 Hz and take reports(time) at 10 Hz; return the stops and the time."""
    stops = stops or Stops()
    for step in range(round(seconds * 20)):
        now_ns = step * S // 20
        if told is not None:
            stops.tell(told(now_ns / S) if callable(told) else told, now_ns)
        if step % 2 == 0:
            for message in reports(now_ns / S):
                stops.take(message, now_ns)
    return stops, now_ns


@pytest.mark.parametrize(
    'reported',
    [
        pytest.param(OURS, id='what we sent'),
        pytest.param((0.5, 0.25, 1.0), id='limited by the autopilot'),
        pytest.param((0.0, 0.0, 0.0), id='stopped'),
        pytest.param((1.1, 0.4, 1.6), id='rounded'),
        pytest.param((nan, nan, nan), id='says nothing'),
    ],
)
def test_a_target_that_our_set_points_explain_accuses_nobody(reported):
    stops, now_ns = flown(lambda _t: [target(reported)])
    assert stops.other_commander(now_ns) == ''


@pytest.mark.parametrize(
    ('reported', 'mask'),
    [(THEIRS, VELOCITY), ((-0.5, 0.5, 1.5), VELOCITY), ((0.0, 0.0, 0.0), PLACE)],
    ids=['faster', 'another way', 'a place'],
)
def test_a_target_that_we_did_not_send_is_a_second_commander(reported, mask):
    stops, now_ns = flown(lambda t: [target(OURS) if t < 1.5 else target(reported, mask)])
    assert 'a second commander' in stops.other_commander(now_ns)
    assert 'POSITION_TARGET_LOCAL_NED' in stops.other_commander(now_ns)


def test_a_second_commander_is_found_although_every_second_target_is_ours():
    stops, now_ns = flown(lambda t: [target(THEIRS if round(t * 10) % 2 else OURS)], seconds=1.8)
    assert stops.other_commander(now_ns)


def test_one_strange_target_among_many_accuses_nobody():
    stops, now_ns = flown(lambda t: [target(THEIRS if round(t * 10) % 8 == 0 else OURS)])
    assert stops.other_commander(now_ns) == ''


def test_our_own_older_set_point_accuses_nobody():
    """A line that is 1 s late reports what we sent before."""

    def told(t):
        return (2.0, 0.0, 0.0) if int(t) % 2 else (-2.0, 0.0, 0.0)

    stops, now_ns = flown(lambda t: [target(told(t - 1.0))], told)
    assert stops.other_commander(now_ns) == ''


def test_targets_count_once_our_set_points_flow():
    def reports(t):
        return [target(OURS if t < 0.3 else THEIRS)]

    assert flown(reports, told=None)[0].other_commander(S) == ''
    assert flown(reports, seconds=1.0)[0].other_commander(S) == ''


def test_a_second_commander_that_falls_silent_is_gone_after_three_seconds():
    def reports(t):
        return [target(THEIRS if 1.5 <= t < 2.5 else OURS)]

    stops, now_ns = flown(reports, seconds=5.0)
    assert stops.other_commander(now_ns)
    stops, now_ns = flown(reports, seconds=6.0)
    assert stops.other_commander(now_ns) == ''


def test_a_target_that_a_fence_has_changed_accuses_nobody():
    aside = target((-0.5, 0.0, 0.0))
    stops, now_ns = flown(
        lambda t: [target(OURS)] if t < 1.5 else [aside] if t < 1.8 else [fence(*LIMITED), aside]
    )
    assert stops.other_commander(now_ns) == ''
    assert stops.limits_speed(now_ns)
    stops, now_ns = flown(lambda t: [target(OURS) if t < 1.5 else aside])
    assert stops.other_commander(now_ns)


def test_an_autopilot_that_never_reports_our_set_point_is_not_compared():
    stops, now_ns = flown(lambda _t: [target(THEIRS)])
    assert stops.other_commander(now_ns) == ''


def test_a_velocity_that_is_left_out_in_part_accuses_nobody():
    stops, now_ns = flown(lambda t: [target(OURS) if t < 1.5 else target(THEIRS, 0xDCF)])
    assert stops.other_commander(now_ns) == ''


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        (LIMITED, 'limits the speed'),
        ((1, 1, mavlink.FENCE_BREACH_MINALT, 0, 1), 'outside of its fence (least altitude'),
        ((1, 1, mavlink.FENCE_BREACH_MAXALT, 0, 0), 'outside of its fence (greatest altitude'),
        ((1, 1, mavlink.FENCE_BREACH_BOUNDARY, 0, 1), 'outside of its fence (boundary'),
        ((1, 1, 99, 0, 1), 'outside of its fence (type unknown'),
    ],
)
def test_a_fence_is_named_with_its_type(fields, words):
    stops = Stops()
    stops.take(fence(*fields), S)
    assert words in stops.fence(S)
    assert words in stops.explanation(S)


def test_a_vehicle_inside_of_its_fence_has_no_fence_in_the_way():
    stops = Stops()
    stops.take(fence(0, 3, mavlink.FENCE_BREACH_NONE, 5, mavlink.FENCE_MITIGATE_NONE), S)
    assert (stops.fence(S), stops.limits_speed(S)) == ('', False)


def test_an_old_report_of_a_fence_says_nothing():
    stops = Stops()
    stops.take(fence(*LIMITED), S)
    assert stops.limits_speed(2 * S)
    assert not stops.limits_speed(2 * S + 1)
    assert stops.fence(2 * S + 1) == ''


@pytest.mark.parametrize(
    ('charge', 'words'), [(2, 'low'), (3, 'critically low'), (4, 'at once'), (5, 'failed')]
)
def test_a_low_battery_is_named(charge, words):
    stops = Stops()
    stops.take(battery(charge), S)
    assert words in stops.battery(S)
    assert words in stops.explanation(S)
    assert stops.battery(7 * S) == ''


@pytest.mark.parametrize('charge', [0, 1, 7])
def test_a_battery_that_is_not_low_is_not_named(charge):
    stops = Stops()
    stops.take(battery(charge), S)
    assert (stops.battery(S), stops.explanation(S)) == ('', '')


def test_a_text_explains_what_happens_soon_after_it():
    stops = Stops()
    stops.take_text('Mode change failed', S)
    assert stops.explanation(4 * S) == '"Mode change failed"'
    assert stops.explanation(4 * S + 1) == ''


@pytest.mark.parametrize(
    ('reported', 'words'), [(OURS, ''), ((0.2, 0.1, 0.3), 'are not our newest set-points')]
)
def test_slower_targets_explain_a_vehicle_that_does_not_follow(reported, words):
    stops, now_ns = flown(lambda _t: [target(reported)])
    assert words in stops.hindrance(now_ns)
    assert bool(stops.hindrance(now_ns)) == bool(words)
    assert stops.explanation(now_ns) == ''


def test_a_set_point_that_is_kept_because_no_newer_one_arrives_is_ours():
    """The line to the autopilot is lost: it keeps the last set-point for GUID_TIMEOUT."""

    def told(t):
        return (3.0 - 0.4 * t, 0.0, 0.0)

    stops, now_ns = flown(lambda t: [target(told(min(t, 1.5)))], told)
    assert stops.other_commander(now_ns) == ''
    assert 'it may not receive them' in stops.hindrance(now_ns)

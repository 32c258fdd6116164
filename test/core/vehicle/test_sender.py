# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The dead-man, with a clock in the test's hand."""

import threading
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peace_ros.core.domain import Setpoint, Telemetry, VehicleError
from peace_ros.core.vehicle import (
    Answer,
    RequestResult,
    SenderParameters,
    SenderState,
    SetpointSender,
)


class RecordingLink:
    """Keeps what was sent."""

    def __init__(self):
        self.sent = []
        self.holds = 0
        self.in_control = True
        self.taken_over = False
        self.hold_answer = Answer.ACCEPTED
        self.held = threading.Event()
        self.broken = False

    def telemetry(self):
        return Telemetry(received_ns=0, in_control=self.in_control)

    def take_poses(self):
        return []

    def send_velocity(self, setpoint):
        if self.broken:
            raise VehicleError('the line broke')
        self.sent.append(setpoint)

    def request_control(self, *, by_person=False):
        return RequestResult(Answer.ACCEPTED)

    def request_hold(self):
        self.holds += 1
        self.held.set()
        return RequestResult(self.hold_answer)

    def close(self):
        return None


class Bench:
    def __init__(self, **parameters):
        self.now_ns = 10**12
        self.link = RecordingLink()
        self.sender = SetpointSender(
            self.link, parameters=SenderParameters(**parameters), steady_ns=lambda: self.now_ns
        )

    def run(self, seconds, step_s=0.05):
        for _ in range(round(seconds / step_s)):
            self.now_ns += int(step_s * 1e9)
            self.sender.tick()

    @property
    def state(self):
        return self.sender.statistics().state


FORWARD = Setpoint(stamp_ns=7, v_north_m_s=3.0, v_down_m_s=1.0)


@pytest.fixture
def bench():
    return Bench()


def test_says_nothing_before_the_first_decision(bench):
    bench.run(10.0)
    assert bench.link.sent == []
    assert bench.link.holds == 0
    assert bench.state is SenderState.IDLE


def test_repeats_a_fresh_setpoint_at_its_rate(bench):
    bench.sender.submit(FORWARD)
    bench.run(0.4)
    assert bench.link.sent == [FORWARD] * 8


def test_an_old_setpoint_becomes_exactly_zero(bench):
    bench.sender.submit(FORWARD)
    bench.run(0.4)
    assert bench.link.sent[-1] == FORWARD
    bench.run(0.1)
    assert bench.link.sent[-1].is_zero, 'at half a second the zero has been sent'
    bench.run(1.0)
    assert all(each.is_zero for each in bench.link.sent[8:])
    assert len(bench.link.sent) == 30
    assert bench.state is SenderState.ZERO
    assert bench.link.holds == 0


def test_then_the_autopilot_is_asked_once_for_its_own_hold(bench, eventually):
    bench.sender.submit(FORWARD)
    bench.run(2.6)
    assert bench.link.held.wait(2.0)
    assert eventually(lambda: (bench.sender.tick(), bench.state is SenderState.HANDED_OVER)[1])
    count = len(bench.link.sent)
    bench.run(10.0)
    assert bench.link.holds == 1
    assert len(bench.link.sent) == count


def test_a_refused_hold_keeps_zero_flowing(bench, eventually):
    bench.link.hold_answer = Answer.REFUSED
    bench.sender.submit(FORWARD)
    bench.run(2.6)
    assert bench.link.held.wait(2.0)
    assert eventually(lambda: 'refused' in bench.sender.statistics().last_error)
    count = len(bench.link.sent)
    bench.run(5.0)
    assert len(bench.link.sent) == count + 100
    assert all(each.is_zero for each in bench.link.sent[count:])
    assert bench.link.holds == 1


def test_after_a_handover_a_decision_needs_an_explicit_resume(bench, eventually):
    bench.sender.submit(FORWARD)
    bench.run(2.6)
    assert eventually(lambda: (bench.sender.tick(), bench.state is SenderState.HANDED_OVER)[1])
    count = len(bench.link.sent)
    bench.sender.submit(FORWARD)
    bench.run(0.2)
    assert len(bench.link.sent) == count
    bench.sender.resume()
    bench.run(0.2)
    assert len(bench.link.sent) == count, 'what was submitted before is not remembered'
    bench.sender.submit(FORWARD)
    bench.run(0.2)
    assert len(bench.link.sent) == count + 4


@pytest.mark.parametrize('how', ['in_control', 'taken_over'])
def test_a_pilot_who_took_over_is_left_alone(bench, how):
    bench.sender.submit(FORWARD)
    bench.run(0.2)
    setattr(bench.link, how, how == 'taken_over')
    count = len(bench.link.sent)
    bench.run(10.0)
    assert len(bench.link.sent) == count
    assert bench.link.holds == 0
    assert bench.state is SenderState.NOT_IN_CONTROL
    assert bench.sender.statistics().withheld == 200


def test_nothing_leaves_after_stop(bench):
    bench.sender.submit(FORWARD)
    bench.sender.stop()
    bench.sender.submit(FORWARD)
    bench.run(5.0)
    assert bench.link.sent == []
    assert bench.link.holds == 0
    with pytest.raises(VehicleError, match='new one'):
        bench.sender.start()


@pytest.mark.parametrize('bad', [float('nan'), float('inf')])
def test_a_setpoint_that_is_no_number_is_refused_and_refreshes_nothing(bench, bad):
    bench.sender.submit(FORWARD)
    bench.run(0.4)
    with pytest.raises(VehicleError, match='finite'):
        bench.sender.submit(Setpoint(0, bad))
    bench.run(0.2)
    assert bench.link.sent[-1].is_zero


def test_a_broken_line_is_counted_not_raised(bench):
    bench.sender.submit(FORWARD)
    bench.link.broken = True
    bench.run(0.2)
    assert bench.sender.statistics().errors == 4
    assert 'broke' in bench.sender.statistics().last_error


def test_gaps_are_measured(bench):
    bench.sender.submit(FORWARD)
    bench.run(0.2)
    bench.run(0.3, step_s=0.3)
    assert bench.sender.statistics().max_gap_s == pytest.approx(0.3)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.floats(0.01, 1.0)), min_size=1, max_size=40))
def test_no_setpoint_is_ever_sent_past_its_age(steps):
    bench = Bench()
    submitted_ns = None
    for submit, wait_s in steps:
        if submit:
            bench.sender.submit(FORWARD)
            submitted_ns = bench.now_ns
        bench.now_ns += int(wait_s * 1e9)
        count = len(bench.link.sent)
        bench.sender.tick()
        for each in bench.link.sent[count:]:
            assert each.is_zero or bench.now_ns - submitted_ns <= 500_000_000


def test_its_own_thread_keeps_the_rate():
    link = RecordingLink()
    sender = SetpointSender(link, limit_s=2.0)
    sender.start()
    sender.submit(FORWARD)
    time.sleep(1.0)
    sender.stop()
    count = len(link.sent)
    assert 12 <= count <= 22
    time.sleep(0.2)
    assert len(link.sent) == count
    assert sender.statistics().max_gap_s < 0.5


def test_a_stop_leaves_at_once_and_zeros_after_it_keep_the_rate():
    link = RecordingLink()
    sender = SetpointSender(link, limit_s=3.0, parameters=SenderParameters(rate_hz=4.0))
    sender.start()
    sender.submit(FORWARD)
    time.sleep(0.85)  # a turn has just been, the next is 0.15 s away
    sender.submit(Setpoint(stamp_ns=8))
    time.sleep(0.05)
    stopped, count = link.sent[-1].is_zero, len(link.sent)
    for _ in range(20):
        sender.submit(Setpoint(stamp_ns=9))
        time.sleep(0.005)
    sender.stop()
    assert stopped
    assert len(link.sent) <= count + 1


def test_a_thread_that_died_is_not_called_sending(eventually):
    died = []
    link = RecordingLink()
    sender = SetpointSender(link, on_defect=died.append)
    sender.start()
    sender.submit(FORWARD)
    assert eventually(lambda: sender.statistics().state is SenderState.SENDING)
    link.telemetry = lambda: 1 / 0
    assert eventually(lambda: died != [])
    assert isinstance(died[0], ZeroDivisionError)
    assert eventually(lambda: sender.is_stuck)
    assert sender.statistics().state is SenderState.STUCK


def test_a_thread_that_stands_still_is_found_without_waiting_for_it(eventually):
    link, gate = RecordingLink(), threading.Event()
    sender = SetpointSender(link)
    sender.start()
    link.send_velocity = lambda _setpoint: gate.wait(20.0)
    sender.submit(FORWARD)
    assert eventually(lambda: sender.is_stuck)
    begun = time.monotonic()
    sender.submit(FORWARD)
    assert sender.statistics().state is SenderState.STUCK
    sender.watch()
    sender.watch()
    with pytest.raises(RuntimeError, match='does not run'):
        sender.watch()
    sender.halt()
    assert time.monotonic() - begun < 0.5, 'nobody waits for the thread'
    assert sender.statistics().state is SenderState.STOPPED
    gate.set()


def test_one_late_look_of_a_process_that_was_stopped_as_a_whole_is_no_failure(bench):
    bench.sender.start()
    for _ in range(10):
        bench.now_ns += 10**10  # the clock ran on while nobody ran
        bench.sender.watch()
        before = bench.sender._ticked_ns
        deadline = time.monotonic() + 5.0
        while bench.sender._ticked_ns == before and time.monotonic() < deadline:
            time.sleep(0.005)
        bench.sender.watch()
    bench.sender.stop()


def test_halting_leaves_nothing_to_send(bench):
    bench.sender.submit(FORWARD)
    bench.sender.halt()
    bench.run(5.0)
    assert bench.link.sent == []
    assert bench.link.holds == 0

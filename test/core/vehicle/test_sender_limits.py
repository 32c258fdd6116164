# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sender at its limits, tick by tick, without its thread."""

from __future__ import annotations

import threading

import pytest

from peace_ros.core.domain import Setpoint, Telemetry, VehicleError
from peace_ros.core.vehicle import (
    Answer,
    RequestResult,
    SenderParameters,
    SenderState,
    SenderStatistics,
    SetpointSender,
)

MS = 1_000_000
FORWARD = Setpoint(stamp_ns=7, v_north_m_s=3.0, v_down_m_s=1.0)
ZERO = Setpoint(stamp_ns=7)
P = SenderParameters(rate_hz=20.0, limit_s=0.5, handover_s=2.0)


class Link:
    def __init__(self) -> None:
        self.sent: list[Setpoint] = []
        self.in_control, self.taken_over, self.mode_known = True, False, True
        self.holds = 0
        self.answer = RequestResult(Answer.ACCEPTED)
        self.broken = ''

    def telemetry(self) -> Telemetry:
        return Telemetry(received_ns=0, in_control=self.in_control, mode_known=self.mode_known)

    def send_velocity(self, setpoint: Setpoint) -> None:
        if self.broken:
            raise VehicleError(self.broken)
        self.sent.append(setpoint)

    def request_hold(self) -> RequestResult:
        self.holds += 1
        if self.broken:
            raise VehicleError(self.broken)
        return self.answer


class Thread:
    """Stands in for the thread of the sender."""

    def __init__(self) -> None:
        self.alive = True
        self.joined: list[float] = []

    def is_alive(self) -> bool:
        return self.alive

    def join(self, timeout: float) -> None:
        self.joined.append(timeout)


class Bench:
    def __init__(self, limit_s: float | None = None) -> None:
        self.now_ns = 10**12
        self.link = Link()
        self.sender = SetpointSender(
            self.link, limit_s=limit_s, parameters=P, steady_ns=lambda: self.now_ns
        )

    def tick(self, after_ms: float = 0.0) -> list[Setpoint]:
        """Return what this tick sent."""
        self.now_ns += round(after_ms * MS)
        count = len(self.link.sent)
        self.sender.tick()
        return self.link.sent[count:]

    @property
    def state(self) -> SenderState:
        return self.sender.statistics().state


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_before_anything_was_submitted_all_counts_are_zero(bench: Bench) -> None:
    assert bench.sender.statistics() == SenderStatistics()
    assert bench.tick() == []
    assert bench.sender.statistics() == SenderStatistics()


@pytest.mark.parametrize(('limit_s', 'fresh_ms'), [(None, 440.0), (1.5, 1440.0)])
def test_a_setpoint_is_sent_until_the_next_tick_would_be_too_late(
    limit_s: float | None, fresh_ms: float
) -> None:
    bench = Bench(limit_s)
    bench.sender.submit(FORWARD)
    assert bench.tick(fresh_ms) == [FORWARD]
    assert bench.state is SenderState.SENDING
    assert bench.tick(0.01) == [ZERO]
    assert bench.state is SenderState.ZERO


def test_a_clock_that_goes_back_makes_a_setpoint_old(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    assert bench.tick() == [FORWARD]
    assert bench.tick(-1.0) == [ZERO]


@pytest.mark.parametrize(('limit_s', 'after_ms'), [(None, 2500.0), (1.5, 3500.0)])
def test_the_autopilot_is_asked_to_hold_once_zero_was_sent_for_long_enough(
    limit_s: float | None, after_ms: float, eventually
) -> None:
    bench = Bench(limit_s)
    bench.sender.submit(FORWARD)
    bench.tick(after_ms)
    assert not bench.sender._hold_asked
    assert bench.tick(0.01) == [ZERO]
    assert eventually(lambda: bench.link.holds == 1)
    assert eventually(lambda: bench.sender._handed_over)
    assert bench.tick(50.0) == []
    assert bench.state is SenderState.HANDED_OVER
    assert bench.link.holds == 1


def test_a_fresh_setpoint_asks_for_nothing(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    bench.tick(2600.0)
    other = Bench()
    for _ in range(60):
        other.sender.submit(FORWARD)
        assert other.tick(100.0) == [FORWARD]
    assert not other.sender._hold_asked


def test_what_was_sent_and_withheld_is_counted(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    for _ in range(3):
        bench.tick(50.0)
    bench.tick(500.0)
    bench.tick(50.0)
    bench.link.in_control = False
    for _ in range(4):
        assert bench.tick(50.0) == []
    assert bench.sender.statistics() == SenderStatistics(
        state=SenderState.NOT_IN_CONTROL, sent=3, zeros=2, withheld=4, max_gap_s=0.5
    )


def test_nothing_is_sent_while_the_mode_is_not_known(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    bench.link.mode_known = False
    assert bench.tick(50.0) == []
    assert bench.state is SenderState.MODE_UNKNOWN
    bench.link.in_control = False
    assert bench.tick(50.0) == []
    assert bench.state is SenderState.NOT_IN_CONTROL
    bench.link.mode_known = bench.link.in_control = True
    assert bench.tick(50.0) == [FORWARD]


def test_gaps_are_those_within_a_row_of_sending(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    bench.tick(50.0)
    bench.link.in_control = False
    bench.tick(1000.0)
    bench.link.in_control = True
    bench.sender.submit(FORWARD)
    bench.tick(1000.0)
    assert bench.sender.statistics().max_gap_s == 0.0
    bench.tick(70.0)
    bench.tick(60.0)
    assert bench.sender.statistics().max_gap_s == 0.07
    bench.sender.resume()
    bench.sender.submit(FORWARD)
    bench.tick(5000.0)
    assert bench.sender.statistics().max_gap_s == 0.07, 'a new row'


def test_a_line_that_breaks_is_counted_and_no_gap(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    bench.tick(50.0)
    bench.link.broken = 'the line broke'
    bench.tick(50.0)
    bench.tick(50.0)
    statistics = bench.sender.statistics()
    assert (statistics.sent, statistics.zeros, statistics.errors) == (1, 0, 2)
    assert statistics.last_error == 'the line broke'


def test_a_hold_that_is_refused_or_fails_is_told(bench: Bench) -> None:
    bench.link.answer = RequestResult(Answer.REFUSED, 'not now')
    bench.sender._hand_over()
    statistics = bench.sender.statistics()
    assert statistics.last_error == f'hold mode: {Answer.REFUSED.value}, not now'
    assert statistics.errors == 0
    assert not bench.sender._handed_over
    bench.link.broken = 'the line broke'
    bench.sender._hand_over()
    statistics = bench.sender.statistics()
    assert (statistics.errors, statistics.last_error) == (1, 'the line broke')
    assert not bench.sender._handed_over
    bench.link.broken, bench.link.answer = '', RequestResult(Answer.ACCEPTED)
    bench.sender._hand_over()
    assert bench.sender._handed_over
    assert bench.sender.statistics().last_error == 'the line broke', 'of before'


@pytest.mark.parametrize('why', ['stopped', 'taken over'])
def test_nothing_is_asked_of_an_autopilot_that_is_no_longer_ours(bench: Bench, why: str) -> None:
    if why == 'stopped':
        bench.sender.halt()
    else:
        bench.link.taken_over = True
    bench.sender._hand_over()
    assert bench.link.holds == 0


def test_resuming_begins_anew(bench: Bench) -> None:
    bench.sender.submit(FORWARD)
    bench.tick(2600.0)
    bench.sender._handed_over = True
    bench.tick(10.0)
    bench.sender.resume()
    assert bench.state is SenderState.IDLE
    assert bench.tick(10.0) == []
    assert bench.state is SenderState.IDLE
    bench.sender.submit(FORWARD)
    assert bench.tick(10.0) == [FORWARD]
    assert bench.sender._hold_asked is False
    assert bench.sender._handed_over is False


@pytest.mark.parametrize(
    ('before', 'after', 'at_once'),
    [
        (None, ZERO, False),
        (FORWARD, ZERO, True),
        (ZERO, ZERO, False),
        (FORWARD, FORWARD, False),
        (ZERO, FORWARD, False),
    ],
)
def test_only_what_stops_the_vehicle_leaves_at_once(
    bench: Bench, before: Setpoint | None, after: Setpoint, at_once: bool
) -> None:
    if before is not None:
        bench.sender.submit(before)
    bench.sender._wake.clear()
    bench.sender.submit(after)
    assert bench.sender._wake.is_set() == at_once


@pytest.mark.parametrize(
    'bad',
    [{'v_north_m_s': float('nan')}, {'v_east_m_s': float('inf')}, {'v_down_m_s': float('nan')}],
)
def test_every_component_must_be_a_number(bench: Bench, bad: dict[str, float]) -> None:
    with pytest.raises(VehicleError, match='all components must be finite'):
        bench.sender.submit(Setpoint(stamp_ns=1, **bad))
    assert bench.tick() == []


def test_a_thread_is_stuck_after_eight_periods_or_when_it_is_dead(bench: Bench) -> None:
    assert not bench.sender.is_stuck, 'there is no thread yet'
    bench.sender._thread = thread = Thread()
    bench.sender._ticked_ns = bench.now_ns
    bench.sender.submit(FORWARD)
    bench.tick()
    bench.now_ns += 400 * MS
    assert not bench.sender.is_stuck
    bench.now_ns += 1
    assert bench.sender.is_stuck
    assert bench.state is SenderState.STUCK
    bench.sender._ticked_ns = bench.now_ns
    assert not bench.sender.is_stuck
    assert bench.state is SenderState.SENDING
    thread.alive = False
    assert bench.sender.is_stuck
    bench.sender.halt()
    assert not bench.sender.is_stuck, 'it is meant to be over'
    assert bench.state is SenderState.STOPPED


def test_three_turns_in_a_row_are_one_too_many(bench: Bench) -> None:
    bench.sender._thread = thread = Thread()
    bench.sender._ticked_ns = bench.now_ns
    for _ in range(3):
        thread.alive = False
        bench.sender.watch()
        bench.sender.watch()
        thread.alive = True
        bench.sender.watch()
    thread.alive = False
    bench.sender.watch()
    bench.sender.watch()
    for _ in range(2):
        with pytest.raises(RuntimeError, match=SenderState.STUCK.value):
            bench.sender.watch()


def test_stopping_waits_for_the_thread_and_is_final(bench: Bench) -> None:
    bench.sender._thread = thread = Thread()
    bench.sender.submit(FORWARD)
    bench.sender._wake.clear()
    bench.sender.stop()
    assert thread.joined == [2.0]
    assert bench.sender._wake.is_set(), 'the thread need not wait for its next turn'
    assert bench.tick() == []
    assert bench.state is SenderState.STOPPED
    with pytest.raises(VehicleError, match='stopped for good: make a new one'):
        bench.sender.start()
    assert bench.sender._sending.acquire(timeout=0.0), 'nobody holds it any more'


def test_a_thread_is_started_once(bench: Bench) -> None:
    bench.sender.start()
    thread = bench.sender._thread
    assert thread is not None
    assert thread.name == 'setpoint_sender'
    bench.sender.start()
    assert bench.sender._thread is thread
    assert thread.is_alive()
    assert bench.sender._ticked_ns == bench.now_ns
    bench.sender.stop()
    assert not thread.is_alive()


def test_a_defect_while_the_autopilot_is_asked_to_hold_is_reported(eventually) -> None:
    defects: list[BaseException] = []
    link, now_ns = Link(), 10**12
    names: list[str] = []

    def fail() -> RequestResult:
        names.append(threading.current_thread().name)
        raise ZeroDivisionError

    link.request_hold = fail
    sender = SetpointSender(link, parameters=P, steady_ns=lambda: now_ns, on_defect=defects.append)
    sender.submit(FORWARD)
    now_ns += 3000 * MS
    sender.tick()
    assert eventually(lambda: [type(each) for each in defects] == [ZeroDivisionError])
    assert names == ['hand_over']


def test_the_thread_goes_on_after_it_was_woken(eventually) -> None:
    link = Link()
    sender = SetpointSender(link, parameters=P)
    sender.start()
    sender.submit(FORWARD)
    assert eventually(lambda: len(link.sent) > 0)
    sender.submit(ZERO)
    count = len(link.sent)
    assert eventually(lambda: len(link.sent) > count + 3)
    assert not sender.is_stuck
    sender.stop()

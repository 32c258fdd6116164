# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The timed sender with the dead-man: no set-point is sent after its age limit.

Fresh set-point -> it is sent; the first that stops the vehicle at once, the others in turn.
Before it is ``limit_s`` old -> zero velocity. Older than ``limit_s`` plus ``handover_s`` -> the
autopilot is asked, once, for its own hold mode. Not in control, or the mode not known after a
silence of the line -> silence.

The state is as fresh as the thread: a thread that no longer runs says so, whatever it did last.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import isfinite

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.motion import Setpoint
from peace_ros.core.threads import GuardedThread, OnDefect
from peace_ros.core.vehicle.link import VehicleLink
from peace_ros.core.vehicle.parameters import SenderParameters

SLACK_S = 0.01
"""How late a tick may be without the dead-man being late."""
JOIN_S = 2.0
STUCK_PERIODS = 8
"""A thread that has not begun a tick for so many periods is stuck or dead."""

STUCK_TURNS = 3


class SenderState(Enum):
    """What the sender does."""

    IDLE = 'nothing submitted yet'
    SENDING = 'sending the newest set-point'
    ZERO = 'the newest set-point is too old: sending zero'
    HANDED_OVER = 'the autopilot holds by itself'
    NOT_IN_CONTROL = 'the autopilot obeys somebody else: silent'
    MODE_UNKNOWN = 'the connection was silent: nothing is sent until the mode is known'
    STOPPED = 'stopped'
    STUCK = 'the thread of the sender does not run'


@dataclass(frozen=True)
class SenderStatistics:
    """What was sent so far."""

    state: SenderState = SenderState.IDLE
    sent: int = 0
    """Set-points of the decision."""
    zeros: int = 0
    """Zero set-points of the dead-man."""
    withheld: int = 0
    """Ticks at which somebody else controlled the autopilot, or perhaps did."""
    errors: int = 0
    last_error: str = ''
    max_gap_s: float = 0.0
    """Longest time between two set-points in a row of sending."""


class SetpointSender:
    """Sends at a fixed rate from its own thread.

    Args:
        link: The vehicle.
        limit_s: Age of a set-point at which zero takes its place; None: of the parameters.
        parameters: Rate and limits.
        steady_ns: Steady clock.
        on_defect: Takes what ended a thread of the sender.
    """

    def __init__(
        self,
        link: VehicleLink,
        limit_s: float | None = None,
        parameters: SenderParameters | None = None,
        steady_ns: Callable[[], int] = time.monotonic_ns,
        on_defect: OnDefect | None = None,
    ) -> None:
        p = parameters or SenderParameters()
        self._link = link
        limit_s = p.limit_s if limit_s is None else limit_s
        self._period_s = 1.0 / p.rate_hz
        # The tick after the last good one must bring the zero, or it would come too late.
        self._limit_ns = int((limit_s - self._period_s - SLACK_S) * 1e9)
        self._handover_ns = int((limit_s + p.handover_s) * 1e9)
        self._steady_ns = steady_ns
        self._on_defect = on_defect
        self._lock = threading.Lock()
        self._sending = threading.Lock()
        """Held while a set-point is chosen and sent; nobody but :meth:`stop` waits for it."""
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._newest: Setpoint | None = None
        self._submitted_ns = 0
        self._state = SenderState.IDLE
        self._hold_asked = False
        self._handed_over = False
        self._sent = self._zeros = self._withheld = self._errors = 0
        self._last_error = ''
        self._last_sent_ns: int | None = None
        self._max_gap_s = 0.0
        self._thread: GuardedThread | None = None
        self._ticked_ns = 0
        self._stuck_turns = 0

    def start(self) -> None:
        """Begin the thread; VehicleError after :meth:`stop`, which is final."""
        if self._stop.is_set():
            raise VehicleError('this sender was stopped for good: make a new one')
        if self._thread is None:
            self._ticked_ns = self._steady_ns()
            self._thread = GuardedThread(self._run, 'setpoint_sender', self._on_defect)
            self._thread.start()

    @property
    def is_stuck(self) -> bool:
        """The thread is dead, or has not begun a tick for ``STUCK_PERIODS``; never blocks."""
        if self._thread is None or self._stop.is_set():
            return False
        limit_ns = STUCK_PERIODS * self._period_s * 1e9
        return not self._thread.is_alive() or self._steady_ns() - self._ticked_ns > limit_ns

    def watch(self) -> None:
        """Find out whether the thread runs; to be called at a steady rate of about 10 Hz.

        It counts turns, not time: in a process that was stopped as a whole nobody missed any.

        Raises:
            RuntimeError: It was found stuck ``STUCK_TURNS`` times in a row.
        """
        self._stuck_turns = self._stuck_turns + 1 if self.is_stuck else 0
        if self._stuck_turns >= STUCK_TURNS:
            raise RuntimeError(SenderState.STUCK.value)

    def submit(self, setpoint: Setpoint) -> None:
        """Replace the set-point that is being sent; one that stops the vehicle leaves at once.

        Raises:
            VehicleError: A component is not finite; the set-point before it goes on ageing.
        """
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(isfinite(each) for each in v):
            raise VehicleError(f'velocity set-point {v} m/s: all components must be finite')
        with self._lock:
            # If this process is killed a moment later, the vehicle must not go on sinking.
            stops = setpoint.is_zero and self._newest is not None and not self._newest.is_zero
            self._newest, self._submitted_ns = setpoint, self._steady_ns()
        if stops:
            self._wake.set()

    def resume(self) -> None:
        """Begin anew after a hand-over or a takeover; nothing is sent until the next submit."""
        with self._lock:
            self._newest = None
            self._hold_asked = self._handed_over = False
            self._last_sent_ns = None
            self._state = SenderState.IDLE

    def stop(self) -> None:
        """Send nothing any more, from now on; final. Waits for a tick under way, 2 s at most."""
        self.halt()
        if self._sending.acquire(timeout=JOIN_S):
            self._sending.release()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=JOIN_S)

    def halt(self) -> None:
        """Begin no further tick; final, and never blocks: one under way may still send."""
        self._stop.set()
        self._wake.set()

    def statistics(self) -> SenderStatistics:
        """Return a snapshot."""
        stopped = SenderState.STOPPED if self._stop.is_set() else None
        stuck = SenderState.STUCK if self.is_stuck else None
        with self._lock:
            return SenderStatistics(
                state=stopped or stuck or self._state,
                sent=self._sent,
                zeros=self._zeros,
                withheld=self._withheld,
                errors=self._errors,
                last_error=self._last_error,
                max_gap_s=self._max_gap_s,
            )

    def tick(self) -> None:
        """Do what is due now; the thread calls it, tests may."""
        # Under the lock of sending, so that nothing leaves once stop() has returned.
        with self._sending:
            told = self._link.telemetry()
            silent: SenderState | None = SenderState.NOT_IN_CONTROL
            if not self._link.taken_over and told.in_control:
                silent = None if told.mode_known else SenderState.MODE_UNKNOWN
            with self._lock:
                setpoint, self._state = self._choose(silent)
                state, ask_hold = self._state, self._is_hold_due()
                if setpoint is None:
                    self._last_sent_ns = None
            if setpoint is not None:
                self._send(setpoint, state)
        if ask_hold:
            # The answer may take seconds, and zero velocity must flow meanwhile.
            GuardedThread(self._hand_over, 'hand_over', self._on_defect).start()

    def _is_hold_due(self) -> bool:
        """Tell, once, that zero has been sent for long enough."""
        if self._state is not SenderState.ZERO or self._hold_asked:
            return False
        self._hold_asked = self._steady_ns() - self._submitted_ns > self._handover_ns
        return self._hold_asked

    def _choose(self, silent: SenderState | None) -> tuple[Setpoint | None, SenderState]:
        """Return what to send, None when ``silent`` or something else speaks against it."""
        if self._stop.is_set():
            return None, SenderState.STOPPED
        if self._newest is None:
            return None, SenderState.IDLE
        if self._handed_over:
            return None, SenderState.HANDED_OVER
        if silent is not None:
            self._withheld += 1
            return None, silent
        age_ns = self._steady_ns() - self._submitted_ns
        if 0 <= age_ns <= self._limit_ns:
            return self._newest, SenderState.SENDING
        return Setpoint(stamp_ns=self._newest.stamp_ns), SenderState.ZERO

    def _send(self, setpoint: Setpoint, state: SenderState) -> None:
        try:
            self._link.send_velocity(setpoint)
        except VehicleError as error:
            self._note_error(str(error))
            return
        now_ns = self._steady_ns()
        with self._lock:
            if self._last_sent_ns is not None:
                self._max_gap_s = max(self._max_gap_s, (now_ns - self._last_sent_ns) / 1e9)
            self._last_sent_ns = now_ns
            if state is SenderState.SENDING:
                self._sent += 1
            else:
                self._zeros += 1

    def _hand_over(self) -> None:
        if self._stop.is_set() or self._link.taken_over:
            return
        try:
            result = self._link.request_hold()
        except VehicleError as error:
            self._note_error(str(error))
            return
        with self._lock:
            self._handed_over = bool(result)
            if not result:
                self._last_error = f'hold mode: {result.answer.value}, {result.reason}'

    def _note_error(self, sentence: str) -> None:
        with self._lock:
            self._errors += 1
            self._last_error = sentence

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            self._ticked_ns = self._steady_ns()
            self._wake.clear()
            self.tick()
            due = max(due + self._period_s, time.monotonic())
            if self._wake.wait(due - time.monotonic()):
                due = time.monotonic()

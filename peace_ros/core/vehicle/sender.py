# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The timed sender with the dead-man: no set-point outlives its age.

Fresh set-point -> it is sent; the first that stops the vehicle at once, the others in turn.
Before it is ``limit_s`` old -> zero velocity. Older than ``limit_s`` plus ``handover_s`` -> the
autopilot is asked, once, for its own hold mode. Not in control -> silence.
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
from peace_ros.core.vehicle.link import VehicleLink
from peace_ros.core.vehicle.parameters import SenderParameters

SLACK_S = 0.01
"""How late a tick may be without the dead-man being late."""


class SenderState(Enum):
    """What the sender did at its last tick."""

    IDLE = 'nothing submitted yet'
    SENDING = 'sending the newest set-point'
    ZERO = 'the newest set-point is too old: sending zero'
    HANDED_OVER = 'the autopilot holds by itself'
    NOT_IN_CONTROL = 'the autopilot obeys somebody else: silent'
    STOPPED = 'stopped'


@dataclass(frozen=True)
class SenderStatistics:
    """What was sent so far."""

    state: SenderState = SenderState.IDLE
    sent: int = 0
    """Set-points of the decision."""
    zeros: int = 0
    """Zero set-points of the dead-man."""
    withheld: int = 0
    """Ticks at which the autopilot was not ours to command."""
    errors: int = 0
    last_error: str = ''
    last_gap_s: float = 0.0
    max_gap_s: float = 0.0
    """Longest time between two set-points in a row of sending."""


class SetpointSender:
    """Sends at a fixed rate from its own thread.

    Args:
        link: The vehicle.
        limit_s: Age of a set-point at which zero takes its place; None: of the parameters.
        parameters: Rate and limits.
        steady_ns: Steady clock.
    """

    def __init__(
        self,
        link: VehicleLink,
        limit_s: float | None = None,
        parameters: SenderParameters | None = None,
        steady_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        p = parameters or SenderParameters()
        self._link = link
        limit_s = p.limit_s if limit_s is None else limit_s
        self._period_s = 1.0 / p.rate_hz
        # The tick after the last good one must bring the zero, or it would come too late.
        self._limit_ns = int((limit_s - self._period_s - SLACK_S) * 1e9)
        self._handover_ns = int((limit_s + p.handover_s) * 1e9)
        self._steady_ns = steady_ns
        self._lock = threading.Lock()
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
        self._last_gap_s = self._max_gap_s = 0.0
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin the thread; VehicleError after :meth:`stop`, which is final."""
        if self._stop.is_set():
            raise VehicleError('this sender was stopped for good: make a new one')
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name='setpoint_sender', daemon=True)
            self._thread.start()

    def submit(self, setpoint: Setpoint) -> None:
        """Replace the set-point that is being sent; one that stops the vehicle leaves at once.

        Raises:
            VehicleError: A component is not finite; the set-point before it goes on ageing.
        """
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(isfinite(each) for each in v):
            raise VehicleError(f'velocity set-point {v} m/s: all components must be finite')
        with self._lock:
            # Whoever kills this process a moment later must not leave the vehicle sinking.
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
        """Send nothing any more, from now on; final."""
        with self._lock:
            self._stop.set()
            self._wake.set()
            self._newest = None
            self._state = SenderState.STOPPED
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)

    abort = stop

    def statistics(self) -> SenderStatistics:
        """Return a snapshot."""
        with self._lock:
            return SenderStatistics(
                self._state,
                self._sent,
                self._zeros,
                self._withheld,
                self._errors,
                self._last_error,
                self._last_gap_s,
                self._max_gap_s,
            )

    def tick(self) -> None:
        """Do what is due now; the thread calls it, tests may."""
        ask_hold = False
        with self._lock:
            setpoint, state = self._choose()
            self._state = state
            if state is SenderState.ZERO and not self._hold_asked:
                ask_hold = self._steady_ns() - self._submitted_ns > self._handover_ns
                self._hold_asked = ask_hold
            if setpoint is None:
                self._last_sent_ns = None
            else:
                # Under the lock, so that nothing leaves once stop() has returned.
                self._send(setpoint, state)
        if ask_hold:
            # The answer may take seconds, and zero velocity must flow meanwhile.
            threading.Thread(target=self._hand_over, name='hand_over', daemon=True).start()

    def _choose(self) -> tuple[Setpoint | None, SenderState]:
        if self._stop.is_set():
            return None, SenderState.STOPPED
        if self._newest is None:
            return None, SenderState.IDLE
        if self._handed_over:
            return None, SenderState.HANDED_OVER
        if self._link.taken_over or not self._link.telemetry().in_control:
            self._withheld += 1
            return None, SenderState.NOT_IN_CONTROL
        age_ns = self._steady_ns() - self._submitted_ns
        if 0 <= age_ns <= self._limit_ns:
            return self._newest, SenderState.SENDING
        return Setpoint(stamp_ns=self._newest.stamp_ns), SenderState.ZERO

    def _send(self, setpoint: Setpoint, state: SenderState) -> None:
        try:
            self._link.send_velocity(setpoint)
        except VehicleError as error:
            self._errors += 1
            self._last_error = str(error)
            return
        now_ns = self._steady_ns()
        if self._last_sent_ns is not None:
            self._last_gap_s = (now_ns - self._last_sent_ns) / 1e9
            self._max_gap_s = max(self._max_gap_s, self._last_gap_s)
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
            with self._lock:
                self._errors += 1
                self._last_error = str(error)
            return
        with self._lock:
            self._handed_over = bool(result)
            if not result:
                self._last_error = f'hold mode: {result.answer.value}, {result.reason}'

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            self._wake.clear()
            self.tick()
            due = max(due + self._period_s, time.monotonic())
            if self._wake.wait(due - time.monotonic()):
                due = time.monotonic()

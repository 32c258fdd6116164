# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands that wait for their COMMAND_ACK, and the reason that STATUSTEXT gives for a refusal."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.result import Answer, RequestResult
from peace_ros.core.vehicle.texts import StatusTexts

RESEND_S = 0.7
REASON_S = 0.4
"""How long the STATUSTEXT with the reason may lag behind its COMMAND_ACK."""


class Requests:
    """One command at a time, sent again until it is answered or the limit is over.

    Args:
        changed: Notified, and held, whenever something was heard.
        limit_s: Longest wait for an answer.
        ours: System and component of this companion.
    """

    def __init__(self, changed: threading.Condition, limit_s: float, ours: tuple[int, int]) -> None:
        self._changed = changed
        self._limit_s = limit_s
        self._ours = ours
        self._one_at_a_time = threading.Lock()
        self._acks: dict[int, int] = {}
        self._values: dict[str, float] = {}
        self._ended = False

    def take(self, message: Any) -> None:
        """Take COMMAND_ACK and PARAM_VALUE; called with ``changed`` held."""
        kind = message.get_type()
        if kind == 'PARAM_VALUE':
            self._values[message.param_id] = message.param_value
        if kind != 'COMMAND_ACK' or message.result == mavlink.MAV_RESULT_IN_PROGRESS:
            return
        # Zero says "to anybody"; older firmware leaves the field out.
        to_us = message.target_system in {0, self._ours[0]}
        if to_us and message.target_component in {0, self._ours[1]}:
            self._acks[message.command] = message.result

    def end(self) -> None:
        """Let nobody wait any more."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def command(
        self,
        send: Callable[[Any], None],
        target: tuple[int, int],
        texts: StatusTexts,
        command: int,
        values: tuple[float, ...],
        wanted: Callable[[], bool] = lambda: True,
    ) -> RequestResult:
        """Send COMMAND_LONG until it is acknowledged, while it is wanted; VehicleError passes."""
        started_ns = time.monotonic_ns()
        padded = (*values, *(0.0,) * (7 - len(values)))

        def ask(attempt: int) -> None:
            send(mavlink.MAVLink_command_long_message(*target, command, min(attempt, 255), *padded))

        code = self._answer(ask, self._acks, command, wanted)
        if code is None and not wanted():
            return RequestResult(
                Answer.NO_ANSWER, 'it was withdrawn, or the mode changed meanwhile'
            )
        if code is None:
            return RequestResult(Answer.NO_ANSWER, f'no COMMAND_ACK within {self._limit_s} s')
        if code == mavlink.MAV_RESULT_ACCEPTED:
            return RequestResult(Answer.ACCEPTED, code=int(code))
        return RequestResult(Answer.REFUSED, self._reason(texts, started_ns, int(code)), int(code))

    def parameter(
        self, send: Callable[[Any], None], target: tuple[int, int], name: str
    ) -> float | None:
        """Return the value of a parameter of the autopilot, None when it does not answer."""

        def ask(_attempt: int) -> None:
            send(mavlink.MAVLink_param_request_read_message(*target, name.encode(), -1))

        return self._answer(ask, self._values, name)

    def _answer(
        self,
        ask: Callable[[int], None],
        answers: dict[Any, Any],
        key: int | str,
        wanted: Callable[[], bool] = lambda: True,
    ) -> float | None:
        deadline = time.monotonic() + self._limit_s
        with self._one_at_a_time:
            with self._changed:
                answers.pop(key, None)
            attempt = 0
            while (left_s := deadline - time.monotonic()) > 0.0 and not self._ended and wanted():
                ask(attempt)
                attempt += 1
                with self._changed:
                    self._changed.wait_for(
                        lambda: key in answers or self._ended or not wanted(),
                        min(RESEND_S, left_s),
                    )
                    if key in answers:
                        return float(answers.pop(key))
        return None

    def _reason(self, texts: StatusTexts, since_ns: int, code: int) -> str:
        def told() -> list[str]:
            return [text for at_ns, text in texts.entries if at_ns >= since_ns]

        with self._changed:
            self._changed.wait_for(lambda: told() or self._ended, REASON_S)
            words = told()
        return words[-1] if words else f'MAV_RESULT {code} without a reason'

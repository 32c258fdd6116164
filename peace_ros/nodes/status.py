# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ``landing/status`` says: the state, a sentence, and everything behind it as pairs."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, TwistStamped
from rclpy.node import Node

from peace_ros.core.domain import Telemetry
from peace_ros.core.landing import CONCERNING_STATES, SILENT_STATES, Decision, State
from peace_ros.core.landing.pairs import decision_pairs
from peace_ros.core.vehicle import VehicleLink
from peace_ros.nodes.messages import (
    ERROR,
    OK,
    WARN,
    diagnostic_array,
    setpoint_to_twist_stamped,
    site_to_message,
)
from peace_ros.nodes.qos import RESULT

FAILED = 'FAILED'
"""In place of a state: a defect ends the node."""
_STATUS_PERIOD_S = 0.1
_LAST_WORDS = 5
"""A subscriber may miss one message of a process that ends."""
_LAST_WORDS_PERIOD_S = 0.04


@dataclass(frozen=True)
class VehicleSituation:
    """What the node knows besides the decision."""

    telemetry: Telemetry | None
    telemetry_age_s: float
    """By the steady clock, infinite before the first."""
    problem: str = ''
    """Why the vehicle cannot be reached, empty when it can."""
    sender: str = ''
    """What the timed sender does."""
    stage: str = ''
    """What happens since the hand-over, empty before it."""
    line: VehicleLink | None = None
    """Once the vehicle is reached: what its line warns of, and what it has not used."""


class DecisionPublisher:
    """Topics ``landing/status``, ``landing/setpoint`` and ``landing/site``."""

    def __init__(self, node: Node) -> None:
        self._status = node.create_publisher(DiagnosticArray, 'landing/status', RESULT)
        self._setpoint = node.create_publisher(TwistStamped, 'landing/setpoint', RESULT)
        self._site = node.create_publisher(PointStamped, 'landing/site', RESULT)
        self._status_due_s = 0.0
        self._has_failed = False

    def publish(self, decision: Decision, situation: VehicleSituation, at_ns: int) -> None:
        """Publish a decision; the set-point always, the rest at 10 Hz of the steady clock."""
        if self._has_failed:
            return
        if decision.state not in SILENT_STATES:
            self._setpoint.publish(setpoint_to_twist_stamped(decision.setpoint, at_ns))
        now_s = time.monotonic()
        if now_s < self._status_due_s:
            return
        self._status_due_s = now_s + _STATUS_PERIOD_S
        self._status.publish(status_message(decision, situation, at_ns))
        told = situation.telemetry
        if decision.site is not None and told is not None and told.pose is not None:
            ground_down_m = told.pose.down_m + told.pose.altitude_agl_m
            self._site.publish(site_to_message(decision.site, at_ns, ground_down_m))

    def publish_failure(self, sentence: str, at_ns: int) -> None:
        """Publish that the node has failed, several times; no decision is published afterwards."""
        self._has_failed = True
        pairs = {'state': FAILED, 'reason': sentence}.items()
        words = f'{FAILED}: {sentence}'
        for _ in range(_LAST_WORDS):
            self._status.publish(diagnostic_array(at_ns, 'landing/status', ERROR, words, pairs))
            time.sleep(_LAST_WORDS_PERIOD_S)


def status_message(decision: Decision, situation: VehicleSituation, at_ns: int) -> DiagnosticArray:
    """Return the status; a vehicle that cannot be reached is a HOLD, whatever was decided."""
    state = State.HOLD if situation.problem else decision.state
    after = f'handed over: {situation.stage}' if situation.stage else ''
    reason = situation.problem or (after if state is State.HANDOVER else '') or decision.reason
    level = ERROR if state is State.ABORTED else WARN if state in CONCERNING_STATES else OK
    told = situation.telemetry
    pairs = {
        **decision_pairs(decision, None if told is None else told.pose),
        'state': state.value,
        'reason': reason,
        'telemetry_age_s': f'{situation.telemetry_age_s:.2f}',
        'sender': situation.sender,
        **({} if told is None else _telemetry_pairs(told)),
        **({} if situation.line is None else _line_pairs(situation.line)),
    }
    sentence = f'{state.value}: {reason}'
    return diagnostic_array(at_ns, 'landing/status', level, sentence, pairs.items())


def _telemetry_pairs(told: Telemetry) -> dict[str, str]:
    return {
        'mode': told.mode,
        'armed': _truth(told.armed),
        'in_control': _truth(told.in_control),
        'landed': _truth(told.landed),
        'status_text': told.status_text,
        'explanation': told.explanation,
    }


def _line_pairs(line: VehicleLink) -> dict[str, str]:
    counts = {f'messages_{name}': str(count) for name, count in asdict(line.counts).items()}
    return {'line_warning': line.warning, **counts}


def _truth(value: bool | None) -> str:
    return 'unknown' if value is None else str(value).lower()

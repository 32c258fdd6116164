# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Beginning and ending a landing: the services, and what speaks against it."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Protocol, cast

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from peace_ros.core.domain import Telemetry, VehicleError
from peace_ros.core.landing import LandingParameters, State
from peace_ros.core.threads import GuardedThread
from peace_ros.core.vehicle import VehicleLink

SILENT_STATES = frozenset({State.IDLE, State.ABORTED})
"""States in which nothing is submitted to the vehicle."""

_JOIN_S = 2.0
_MAY_BEGIN = frozenset({State.IDLE, State.HOLD, State.HANDOVER, State.ABORTED})


class Engageable(Protocol):
    """What the services need of the node; it is an rclpy Node besides."""

    def reason_against(self) -> str:
        """Return what speaks against beginning now, empty when nothing does."""

    def link(self) -> VehicleLink | None:
        """Return the vehicle, None until it is reached."""

    def begin(self) -> str:
        """Begin the landing; return what speaks against it, empty when it began."""

    def hold_level(self) -> str:
        """Hold level without a position where that was chosen; return what became of it."""

    def end_landing(self) -> bool:
        """End the landing; return whether one was flown."""

    def fail(self, error: BaseException) -> None:
        """Take what ended a thread."""


class EngagementServices:
    """``~/engage`` and ``~/disengage``, and engaging once by itself where that is asked for.

    Asking for control may take seconds, in which steps and heatmaps must go on: it has a thread of
    its own, and the services have a callback group in which one waits for the other.
    """

    def __init__(self, node: Engageable, *, auto: bool) -> None:
        self._node = node
        self._auto_due = auto
        self._ros = cast('Node', node)
        self._thread: GuardedThread | None = None
        beside = MutuallyExclusiveCallbackGroup()
        for name, callback in (('engage', self._on_engage), ('disengage', self._on_disengage)):
            self._ros.create_service(Trigger, f'~/{name}', callback, callback_group=beside)

    def engage_when_ready(self) -> None:
        """Engage beside the caller, once, when it was asked for and nothing speaks against it."""
        if self._auto_due and not self._node.reason_against():
            self._auto_due = False
            self._start(lambda: self._engage(by_person=False))

    def close(self) -> None:
        """Wait until nobody engages any more; the link must have been closed before."""
        if self._thread is not None:
            self._thread.join(timeout=_JOIN_S)

    def _start(self, work: Callable[[], object]) -> None:
        self._thread = GuardedThread(work, 'engage', self._node.fail)
        self._thread.start()

    async def _on_engage(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        answer = Future()
        self._start(lambda: answer.set_result(self._engage_for_person()))
        problem: str = await answer
        response.success, response.message = not problem, problem or 'engaged'
        return response

    def _engage_for_person(self) -> str:
        problem = self._engage(by_person=True)
        instead = self._node.hold_level() if problem else ''
        return f'{problem}; {instead}' if instead else problem

    def _engage(self, *, by_person: bool) -> str:
        """Ask for control once; return what speaks against the landing, empty when it began."""
        link = self._node.link()
        problem = self._node.reason_against()
        if not problem and link is not None:
            problem = _ask_for_control(link, by_person=by_person)
        problem = problem or self._node.begin()
        if problem:
            self._ros.get_logger().warning(f'not engaged: {problem}')
        else:
            self._ros.get_logger().info('engaged')
        return problem

    def _on_disengage(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        self._auto_due = False
        was_flying = self._node.end_landing()
        response.success = True
        response.message = 'disengaged: the vehicle stops and holds' if was_flying else 'was idle'
        self._ros.get_logger().info(response.message)
        return response


def _ask_for_control(link: VehicleLink, *, by_person: bool) -> str:
    """Return why the vehicle does not obey, empty when it does."""
    try:
        result = link.request_control(by_person=by_person)
    except VehicleError as error:
        return str(error)
    return '' if result else f'control {result.answer.value}: {result.reason}'


def reason_against(
    state: State,
    told: Telemetry | None,
    telemetry_age_s: float,
    map_age_s: float,
    parameters: LandingParameters,
) -> str:
    """Return a sentence why the landing cannot be engaged, empty when it can.

    Args:
        state: Of the landing so far.
        told: What the vehicle last said.
        telemetry_age_s: Steady clock, since it said it.
        map_age_s: Node clock, since the newest heatmap in the map was taken.
        parameters: Their limits of age hold here too.

    """
    if state not in _MAY_BEGIN:
        return f'a landing is under way already: {state.value}'
    return _against_vehicle(told, telemetry_age_s, parameters) or _against_map(
        map_age_s, parameters
    )


def _against_vehicle(told: Telemetry | None, age_s: float, parameters: LandingParameters) -> str:
    if told is None or told.pose is None:
        silent = 'no telemetry: the autopilot has not said where it is; check its streams'
        return silent if told is None else told.position_problem or silent
    limit_s = parameters.telemetry_age_limit_s
    if not age_s <= limit_s:
        return f'telemetry is {age_s:.1f} s old, limit {limit_s} s: check the line'
    if not told.armed:
        return 'the vehicle is not armed: a landing begins in the air'
    if told.landed:
        return 'the vehicle is on the ground: a landing begins in the air'
    return ''


def _against_map(age_s: float, parameters: LandingParameters) -> str:
    if not isfinite(age_s):
        return 'no heatmap yet: is segmentation running, and do its stamps and ours share a clock?'
    limit_s = parameters.heatmap_age_limit_s
    if age_s > limit_s:
        return (
            f'the newest heatmap is {age_s:.1f} s old, limit {limit_s} s: is segmentation running?'
        )
    return ''

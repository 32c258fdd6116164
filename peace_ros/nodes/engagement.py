# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The services that begin and end a landing."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.task import Future
from std_srvs.srv import Trigger

from peace_ros.core.domain import VehicleError
from peace_ros.core.threads import GuardedThread
from peace_ros.core.vehicle import VehicleLink
from peace_ros.nodes.vehicle_access import VehicleAccess

if TYPE_CHECKING:
    from peace_ros.nodes.landing import LandingNode

_JOIN_S = 2.0


class EngagementServices:
    """``~/engage`` and ``~/disengage``, and engaging once automatically where that is asked for.

    A request for control may take seconds, and steps and heatmaps must go on meanwhile: it has a
    thread of its own, and the services have a callback group in which one waits for the other.
    """

    def __init__(self, node: LandingNode, access: VehicleAccess, *, auto: bool) -> None:
        self._node, self._access = node, access
        self._auto_due = auto
        self._thread: GuardedThread | None = None
        self._lock = threading.Lock()
        """Held while a landing begins or ends."""
        self._disengagements = 0
        beside = MutuallyExclusiveCallbackGroup()
        for name, callback in (('engage', self._on_engage), ('disengage', self._on_disengage)):
            self._node.create_service(Trigger, f'~/{name}', callback, callback_group=beside)

    def engage_when_ready(self) -> None:
        """Engage once, in a thread, when that was asked for and a landing can begin."""
        if self._auto_due and not self._node.check_engagement():
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
        instead = self._access.hold_level() if problem and self._node.is_active else ''
        return f'{problem}; {instead}' if instead else problem

    def _engage(self, *, by_person: bool) -> str:
        """Request control once; return why the landing did not begin, empty when it began."""
        before = self._disengagements
        problem = self._node.check_engagement()
        link = self._access.link
        if not problem and link is not None:
            problem = _request_control(link, by_person=by_person)
        if not problem:
            problem = self._begin(before)
            if problem and link is not None:
                # It obeys us now, and nobody would command it.
                problem = f'{problem}; {_request_hold(link)}'
        if problem:
            self._node.get_logger().warning(f'not engaged: {problem}')
        else:
            self._node.get_logger().info('engaged')
        return problem

    def _begin(self, disengagements: int) -> str:
        """Begin unless somebody has disengaged since; return why not, empty when it began."""
        with self._lock:
            if self._disengagements != disengagements:
                return 'disengaged while control was requested'
            return self._node.begin()

    def _on_disengage(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        self._auto_due = False
        with self._lock:
            self._disengagements += 1
            was_flying = self._node.end_landing()
        response.success = True
        response.message = 'disengaged: the vehicle stops and holds' if was_flying else 'was idle'
        self._node.get_logger().info(response.message)
        return response


def _request_control(link: VehicleLink, *, by_person: bool) -> str:
    """Return why the vehicle does not obey, empty when it does."""
    try:
        result = link.request_control(by_person=by_person)
    except VehicleError as error:
        return str(error)
    return '' if result else f'control {result.answer.value}: {result.reason}'


def _request_hold(link: VehicleLink) -> str:
    """Ask for the autopilot's own hold mode; return the result as a sentence."""
    try:
        result = link.request_hold()
    except VehicleError as error:
        return f'hold mode was not requested: {error}'
    return 'the vehicle holds' if result else f'hold mode {result.answer.value}: {result.reason}'

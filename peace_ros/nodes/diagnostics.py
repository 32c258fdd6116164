# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``/diagnostics``, once per second of the steady clock, also when nothing arrives."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

from peace_ros.core.domain import Health, Level
from peace_ros.core.health import InputWatch
from peace_ros.nodes.messages import header
from peace_ros.nodes.qos import RESULT

if TYPE_CHECKING:
    from peace_ros.nodes.node import PeaceNode

_PERIOD_S = 1.0
_LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
}


class Diagnostics:
    """The tasks of a node and their findings, named ``namespace/node: task``."""

    def __init__(self, node: PeaceNode) -> None:
        self._node = node
        self.hardware_id = socket.gethostname()
        """What the findings are about: this computer, unless the node says otherwise."""
        self.inactive = ''
        """Why the node does not work now, instead of all findings; empty while it works."""
        self._tasks: dict[str, Callable[[], Health]] = {}
        self._out = node.create_publisher(DiagnosticArray, '/diagnostics', RESULT)
        self._timer = node.create_timer(
            _PERIOD_S, self._publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def add(self, task: str, check: Callable[[], Health]) -> None:
        """Ask a task for its finding from now on."""
        self._tasks[task] = check

    def clear(self) -> None:
        """Forget all tasks."""
        self._tasks.clear()

    def watch(
        self, topic: str, unless: Callable[[], str] | None = None, *, periodic: bool = False
    ) -> Callable[[int], None]:
        """Watch an input; return what is to be called with the stamp (ns) of each message.

        Args:
            topic: as it is subscribed to; the last part of its name says what arrives.
            unless: returns why the input is of no use now, empty when it is.
            periodic: a warning, also in the log, when many of its messages are lost.
        """
        name, noun = self._node.resolve_topic_name(topic), topic.rpartition('/')[2]
        watch = InputWatch(noun, name, time.monotonic(), periodic=periodic)

        def check() -> Health:
            if unless is not None and (reason := unless()):
                return Health(Level.OK, reason)
            found = watch.health(time.monotonic(), self._node.count_publishers(name))
            if periodic and found.level is Level.WARN:
                self._node.say(noun, found.sentence)
            return found

        self.add(noun, check)
        return lambda stamp_ns: watch.arrived(stamp_ns, self._node.clock_ns(), time.monotonic())

    def _publish(self) -> None:
        node = self._node.get_fully_qualified_name().lstrip('/')
        message = DiagnosticArray(header=header(self._node.clock_ns()))
        tasks = dict(self._tasks) or {'lifecycle': lambda: Health(Level.OK, 'works')}
        for task, check in tasks.items():
            found = Health(Level.WARN, self.inactive) if self.inactive else check()
            message.status.append(
                DiagnosticStatus(
                    level=_LEVELS[found.level],
                    name=f'{node}: {task}',
                    message=found.sentence,
                    hardware_id=self.hardware_id,
                    values=[KeyValue(key=key, value=value) for key, value in found.values],
                )
            )
        self._out.publish(message)

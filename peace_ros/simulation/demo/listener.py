# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node beside those that fly: it spins in a thread of its own, and engages the landing."""

from __future__ import annotations

import threading
import time

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from peace_ros.core.domain import VehicleError

ENGAGE = '/landing/engage'
_ANSWER_S = 10.0
_AGAIN_S = 0.3
_JOIN_S = 5.0


class Listener:
    """Add subscriptions to :attr:`node`, then :meth:`start`."""

    def __init__(self, name: str, *, use_sim_time: bool = False) -> None:
        rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self.node = Node(name, parameter_overrides=[Parameter('use_sim_time', value=use_sim_time)])
        self.failure: Exception | None = None
        """What ended the thread; without it everything would look as if it stood still."""
        self._engage = self.node.create_client(Trigger, ENGAGE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._executor.shutdown()
        rclpy.try_shutdown()
        self._thread.join(timeout=_JOIN_S)

    def check(self) -> None:
        """Raise what went wrong in the thread, if anything did."""
        if self.failure is not None:
            raise self.failure

    def ask_to_engage(self) -> str:
        """Call the landing node's service; return why it refuses, empty when it began.

        Raises:
            VehicleError: it does not answer in time.
        """
        deadline = time.monotonic() + _ANSWER_S
        if not self._engage.wait_for_service(timeout_sec=_ANSWER_S):
            raise VehicleError(
                f'service {ENGAGE} did not appear within {_ANSWER_S:g} s: see the log'
            )
        future = self._engage.call_async(Trigger.Request())
        while not future.done():
            if time.monotonic() > deadline:
                raise VehicleError(f'service {ENGAGE} did not answer within {_ANSWER_S:g} s')
            time.sleep(0.005)
        answer = future.result()
        if answer is None:
            raise VehicleError(f'service {ENGAGE} gave no answer')
        return '' if answer.success else str(answer.message) or 'without a reason'

    def engage(self, limit_s: float) -> None:
        """Engage; right after a start the map may still be waiting for its first heatmap.

        Raises:
            VehicleError: it refuses for too long, then with its sentence, or does not answer.
        """
        deadline = time.monotonic() + limit_s
        while problem := self.ask_to_engage():
            if time.monotonic() > deadline:
                raise VehicleError(f'the landing node refuses to engage: {problem}')
            time.sleep(_AGAIN_S)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return
        except Exception as error:
            self.failure = self.failure or error

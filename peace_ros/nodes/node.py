# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every node is: parameters, diagnostics, warnings, and an end in order."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.node_parameters import Group
from peace_ros.nodes.diagnostics import Diagnostics
from peace_ros.nodes.failure import Failure
from peace_ros.nodes.parameters import (
    changed_parameters,
    declare_parameters,
    refuse_files_for_others,
    refuse_unknown,
)

_Parameters = TypeVar('_Parameters')

_SAY_AGAIN_S = 5.0
_WATCH_S = 0.1


class PeaceNode(Node):  # type: ignore[misc]
    """A node with dataclasses as parameters, which limits how often it repeats a warning."""

    is_configured = True
    """Its parameters are in use."""

    def __init__(self, name: str, *groups: Group, **options: Any) -> None:
        """Create the node; refuse parameters that none of the dataclasses declares.

        Raises:
            ConfigurationError: a parameter of another type, outside its bounds or unknown, or a
                parameter file for nodes of other names or namespaces.

        """
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        try:
            refuse_files_for_others(self, name)
            refuse_unknown(self, *groups)
            self._filled = {each: declare_parameters(self, each, group) for group, each in groups}
        except PeaceError:
            self.destroy_node()
            raise
        self.diagnostics = Diagnostics(self)
        self._groups = groups
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self._failure = Failure()
        self._endings: SimpleQueue[None] = SimpleQueue()
        """A queue, because a signal handler may put into it wherever it interrupts."""
        self._said: dict[str, float] = {}
        self._said_lock = threading.Lock()

    def declare_parameters(
        self, namespace: str, parameters: Sequence[Any], *arguments: Any, **options: Any
    ) -> list[Parameter]:
        """Declare (name, value, descriptor), as rclpy does, with None for an empty list.

        In ROS an empty list of a parameter file has no type; rclpy hands it over as None, and then
        ends with an exception that does not name the parameter.
        """
        typed = [(name, [] if value is None else value, *rest) for name, value, *rest in parameters]
        return list(super().declare_parameters(namespace, typed, *arguments, **options))

    def filled(self, parameters: type[_Parameters]) -> _Parameters:
        """Return the instance of one of the parameter dataclasses."""
        value = self._filled[parameters]
        if not isinstance(value, parameters):
            raise ConfigurationError(f'{parameters.__name__} is not among the parameters')
        return value

    def _on_set_parameters(self, given: Sequence[Parameter]) -> SetParametersResult:
        """Take all of the new values or none, and answer why not."""
        values = {each.name: each.value for each in given}
        try:
            changed = changed_parameters(self._filled, self._groups, values)
            if changed and self.is_configured:
                self.change({**self._filled, **changed})
        except PeaceError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._filled.update(changed)
        return SetParametersResult(successful=True)

    def change(self, filled: Mapping[type[Any], Any]) -> None:
        """Work with other values of the live parameters from now on.

        Args:
            filled: all parameter dataclasses, with the new values.

        Raises:
            PeaceError: they cannot be used; the node goes on with those before.

        """

    def clock_ns(self) -> int:
        """Return the node clock in nanoseconds (simulated with use_sim_time)."""
        return int(self.get_clock().now().nanoseconds)

    def say(self, subject: str, sentence: str) -> None:
        """Log a warning, at most every few seconds of the steady clock for one subject."""
        now = time.monotonic()
        with self._said_lock:
            if now - self._said.get(subject, -_SAY_AGAIN_S) < _SAY_AGAIN_S:
                return
            self._said[subject] = now
        self.get_logger().warning(sentence)

    @property
    def failure(self) -> BaseException | None:
        """The defect that ended a thread of this node, and with it the node."""
        return self._failure.error

    def fail(self, error: BaseException) -> None:
        """Take a defect that ended a thread, a timer or a callback; never blocks.

        :meth:`last_steps` begin at once, and :func:`run` ends the process soon afterwards.
        """
        try:
            self._failure.begin(error, self.last_steps)
        finally:
            self.end()

    def last_steps(self, sentence: str) -> Sequence[Callable[[], None]]:  # noqa: ARG002
        """Return what a node that has failed must still do at once.

        Args:
            sentence: what has failed.

        """
        return ()

    def watch(self) -> None:
        """Raise when something no longer runs; the main thread calls it every ``_WATCH_S``."""

    def end(self) -> None:
        """Let :meth:`wait_until_ended` return; from any thread or signal handler."""
        self._endings.put(None)

    def wait_until_ended(self, *others: PeaceNode) -> None:
        """Block until the node shall end; a node that has failed ends the process from here.

        Args:
            others: of this process; when one of them ends, all do.

        """
        nodes = (self, *others)
        for each in others:
            each.share_end(self._endings)
        while self._endings.empty():
            with suppress(Empty):
                self._endings.get(timeout=_WATCH_S)
                break
            for each in nodes:
                each.fail_where_watched()
        for each in nodes:
            each.end_if_failed()

    def fail_where_watched(self) -> None:
        """Fail when :meth:`watch` raises."""
        try:
            self.watch()
        except Exception as error:
            self.fail(error)

    def share_end(self, endings: SimpleQueue[None]) -> None:
        """End together with the node whose endings these are."""
        self._endings = endings
        if self.failure is not None:
            self.end()

    def end_if_failed(self) -> None:
        """End the process when this node has failed; the last steps are waited for."""
        if self.failure is not None:
            self._failure.end_process()

    def close(self) -> None:
        """Stop threads and links; the node itself is destroyed by :func:`run`."""

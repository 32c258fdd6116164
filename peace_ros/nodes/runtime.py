# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every node shares: its base class and its main."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.node_parameters import Group
from peace_ros.nodes.diagnostics import Diagnostics
from peace_ros.nodes.failure import EXIT_FAILED, Failure
from peace_ros.nodes.parameters import (
    declare_parameters,
    refuse_files_for_others,
    refuse_unknown,
)
from peace_ros.nodes.spinning import spin_until_ended

_Parameters = TypeVar('_Parameters')

EXIT_OK = 0
EXIT_REFUSED = 2
_SAY_AGAIN_S = 5.0
_WATCH_S = 0.1
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class PeaceNode(Node):  # type: ignore[misc]
    """A node with dataclasses as parameters, which limits how often it repeats a warning."""

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
        self._failure = Failure()
        self._endings: SimpleQueue[None] = SimpleQueue()
        """A queue, because a signal handler may put into it wherever it interrupts."""
        self._said: dict[str, float] = {}
        self._said_lock = threading.Lock()

    def filled(self, parameters: type[_Parameters]) -> _Parameters:
        """Return the instance of one of the parameter dataclasses."""
        value = self._filled[parameters]
        if not isinstance(value, parameters):
            raise ConfigurationError(f'{parameters.__name__} is not among the parameters')
        return value

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

    def wait_until_ended(self) -> None:
        """Block until the node shall end; a node that has failed ends the process from here."""
        while self._endings.empty():
            with suppress(Empty):
                self._endings.get(timeout=_WATCH_S)
                break
            try:
                self.watch()
            except Exception as error:
                self.fail(error)
        if self.failure is not None:
            self._failure.end_process()

    def close(self) -> None:
        """Stop threads and links; the node itself is destroyed by :func:`run`."""


class _Interrupted(BaseException):
    """SIGINT or SIGTERM; no Exception, so that nothing but :func:`run` catches it."""


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise _Interrupted


def run(create: Callable[[], PeaceNode], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until SIGINT or SIGTERM, close it; return the exit status.

    0 after a signal; 2 with one sentence on standard error when the arguments, the
    configuration, a model, a world or the vehicle cannot be used. A defect ends the process with
    status 1 and a traceback within a second, see :meth:`PeaceNode.fail`. rclpy's own signal
    handlers would take the context away from under nodes that still have something to say, so
    they are not installed.
    """
    for number in _SIGNALS:
        signal.signal(number, _interrupt)
    node: PeaceNode | None = None
    try:
        rclpy.init(
            args=None if args is None else list(args),
            signal_handler_options=SignalHandlerOptions.NO,
        )
        node = create()
        _end_on_signals(node)
        spin_until_ended(node)
    except _Interrupted:
        # A node that is not complete can be neither used nor destroyed, and the threads of its
        # middleware would abort an ordinary exit.
        os._exit(EXIT_OK)
    except PeaceError as error:
        return _refused(error)
    except RuntimeError as error:
        if rclpy.ok():
            raise
        return _refused(error)  # what rclpy.init says of arguments or a broken --params-file
    finally:
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return EXIT_OK if node.failure is None else EXIT_FAILED


def _end_on_signals(node: PeaceNode) -> None:
    """Shut down in order from now on: an exception could interrupt anything half done."""

    def end(_number: int, _frame: FrameType | None) -> None:
        node.end()

    for number in _SIGNALS:
        signal.signal(number, end)


def _refused(error: Exception) -> int:
    print(error, file=sys.stderr, flush=True)
    return EXIT_REFUSED

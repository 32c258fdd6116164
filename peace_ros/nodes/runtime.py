# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every node shares: its base class and its main."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import SimpleQueue
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.node_parameters import Group
from peace_ros.nodes.parameters import declare_parameters, refuse_unknown

_Parameters = TypeVar('_Parameters')

EXIT_OK = 0
EXIT_FAILED = 1
EXIT_REFUSED = 2
_SAY_AGAIN_S = 5.0
_SHUTDOWN_S = 2.0
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class PeaceNode(Node):  # type: ignore[misc]
    """A node whose parameters are dataclasses and which knows when to repeat itself."""

    def __init__(self, name: str, *groups: Group, **options: Any) -> None:
        """Create the node; refuse parameters that none of the dataclasses declares.

        Raises:
            ConfigurationError: a parameter of another type, outside its bounds or unknown.

        """
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        try:
            refuse_unknown(self, *groups)
            self._filled = {each: declare_parameters(self, each, group) for group, each in groups}
        except PeaceError:
            self.destroy_node()
            raise
        self.failure: Exception | None = None
        """The defect of ours that ended a thread of this node, and with it the node."""
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

    def fail(self, error: Exception) -> None:
        """Remember a defect of ours and end the process in an orderly way; see :func:`run`."""
        self.failure = self.failure or error
        self.end()

    def end(self) -> None:
        """Let :meth:`wait_until_ended` return; from any thread or signal handler."""
        self._endings.put(None)

    def wait_until_ended(self) -> None:
        """Block until the node shall end."""
        self._endings.get()

    def close(self) -> None:
        """Stop threads and links; the node itself is destroyed by :func:`run`."""


class _Interrupted(BaseException):
    """SIGINT or SIGTERM; no Exception, so that nothing but :func:`run` catches it."""


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise _Interrupted


def run(
    create: Callable[[], PeaceNode], args: Sequence[str] | None = None, threads: int = 1
) -> int:
    """Create a node, spin it until SIGINT or SIGTERM, close it; return the exit status.

    0 after a signal; 2 with one sentence on standard error when the arguments, the
    configuration, a model, a world or the vehicle cannot be used; 1 with a traceback for a
    defect of ours. rclpy's own signal handlers would take the context away from under nodes that
    still have something to say, so they are not installed.
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
        _spin_until_ended(node, threads)
    except _Interrupted:
        # Half a node can be neither used nor destroyed, and the threads of its middleware would
        # abort an ordinary exit.
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
    if node.failure is not None:
        traceback.print_exception(node.failure)
        return EXIT_FAILED
    return EXIT_OK


def _end_on_signals(node: PeaceNode) -> None:
    """End by the front door from now on: an exception could strike in the middle of anything."""

    def end(_number: int, _frame: FrameType | None) -> None:
        node.end()

    for number in _SIGNALS:
        signal.signal(number, end)


class _PatientExecutor(MultiThreadedExecutor):  # type: ignore[misc]
    """Waits for the callbacks under way, which rclpy's own leaves running on a destroyed node."""

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._executor.shutdown(wait=True)
        return bool(super().shutdown(timeout_sec))


class _Enough(Future):  # type: ignore[misc]
    """Ends the spinning; keeps one callback, as rclpy adds another with every turn of its loop."""

    def __init__(self) -> None:
        super().__init__()
        self._is_watched = False

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        """Keep the first: all of them wake the same executor."""
        if not self._is_watched:
            self._is_watched = True
            super().add_done_callback(callback)


def _spin_until_ended(node: PeaceNode, threads: int) -> None:
    """Spin in a thread, because Python runs signal handlers only while its main thread is free."""
    executor = SingleThreadedExecutor() if threads == 1 else _PatientExecutor(threads)
    executor.add_node(node)
    enough = _Enough()

    def spin() -> None:
        try:
            with suppress(ExternalShutdownException):
                executor.spin_until_future_complete(enough)
        except Exception as error:
            node.fail(error)
        node.end()

    spinner = threading.Thread(target=spin, name='spin', daemon=True)
    spinner.start()
    node.wait_until_ended()
    # First no new callbacks, then links closed, so that those under way soon end, and only then
    # may anything be destroyed.
    enough.set_result(None)
    spinner.join(timeout=_SHUTDOWN_S)
    node.close()
    executor.shutdown(timeout_sec=_SHUTDOWN_S)


def _refused(error: Exception) -> int:
    print(error, file=sys.stderr, flush=True)
    return EXIT_REFUSED

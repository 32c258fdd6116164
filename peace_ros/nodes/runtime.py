# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The main of every node: from its arguments to its exit status."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from types import FrameType

import rclpy
from rclpy.signals import SignalHandlerOptions

from peace_ros.core.domain import PeaceError
from peace_ros.nodes.failure import EXIT_FAILED
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.spinning import spin_until_ended

EXIT_OK = 0
EXIT_REFUSED = 2
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _Interrupted(BaseException):
    """SIGINT or SIGTERM; no Exception, so that nothing but :func:`run` catches it."""


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise _Interrupted


def run(
    create: Callable[[], PeaceNode | Sequence[PeaceNode]], args: Sequence[str] | None = None
) -> int:
    """Create nodes, spin them until SIGINT or SIGTERM, close them; return the exit status.

    0 after a signal; 2 with one sentence on standard error when the arguments, the
    configuration, a model, a world or the vehicle cannot be used. A defect ends the process with
    status 1 and a traceback within a second, see :meth:`PeaceNode.fail`. rclpy's own signal
    handlers would take the context away from under nodes that still have something to say, so
    they are not installed.
    """
    for number in _SIGNALS:
        signal.signal(number, _interrupt)
    nodes: Sequence[PeaceNode] = ()
    try:
        rclpy.init(
            args=None if args is None else list(args),
            signal_handler_options=SignalHandlerOptions.NO,
        )
        created = create()
        nodes = (created,) if isinstance(created, PeaceNode) else created
        _end_on_signals(nodes[0])
        spin_until_ended(*nodes)
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
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return EXIT_FAILED if any(node.failure for node in nodes) else EXIT_OK


def _end_on_signals(node: PeaceNode) -> None:
    """Shut down in order from now on: an exception could interrupt anything half done."""

    def end(_number: int, _frame: FrameType | None) -> None:
        node.end()

    for number in _SIGNALS:
        signal.signal(number, end)


def _refused(error: Exception) -> int:
    print(error, file=sys.stderr, flush=True)
    return EXIT_REFUSED

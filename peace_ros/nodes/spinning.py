# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the callbacks of a node in one thread until the node ends; destroys nothing under them."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from typing import TYPE_CHECKING

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from peace_ros.core.threads import GuardedThread
from peace_ros.nodes.failure import EXIT_FAILED

if TYPE_CHECKING:
    from peace_ros.nodes.node import PeaceNode

_SHUTDOWN_S = 2.0


def spin_until_ended(node: PeaceNode, *others: PeaceNode) -> None:
    """Spin in a thread, because Python runs signal handlers only while its main thread is free."""
    executor = SingleThreadedExecutor()
    for each in (node, *others):
        executor.add_node(each)
    ended = threading.Event()

    def spin() -> None:
        with suppress(ExternalShutdownException):
            while not ended.is_set():
                executor.spin_once()
        node.end()

    spinner = GuardedThread(spin, 'spin', node.fail)
    spinner.start()
    node.wait_until_ended(*others)
    # First no new callbacks, then links closed, so that the one under way soon ends, and only then
    # may anything be destroyed.
    ended.set()
    executor.create_task(lambda: None)  # spin_once() returns after it
    spinner.join(timeout=_SHUTDOWN_S)
    for each in (node, *others):
        each.close()
    spinner.join(timeout=_SHUTDOWN_S)
    if spinner.is_alive():
        print('a callback does not end: the process ends without it', file=sys.stderr, flush=True)
        os._exit(EXIT_FAILED)
    for each in (node, *others):
        each.end_if_failed()
    executor.shutdown()

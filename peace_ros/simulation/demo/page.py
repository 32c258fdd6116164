# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live page beside a demo: a process whose end ends nothing else."""

from __future__ import annotations

import threading
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from peace_ros.core.threads import GuardedThread
from peace_ros.simulation.demo.nodes import ros_arguments
from peace_ros.simulation.demo.processes import ProcessGroup

_NAME = 'watch'
_MODULE = 'peace_ros.watch.watch'
_READY_S = 60.0
_POLL_S = 0.2
_JOIN_S = 2.0


@contextmanager
def live_page(run_dir: Path, console: Console) -> Iterator[None]:
    """Serve the page until the demo ends; print its address, and open it from a terminal.

    Args:
        run_dir: Gets ``logs/watch.log``, and ``watch.url`` while the page is served.
        console: Where to print.

    Raises:
        ProcessError: The process cannot be started.
    """
    address, over = run_dir / 'watch.url', threading.Event()
    with ProcessGroup(run_dir / 'logs') as group:
        group.start(_NAME, _MODULE, ros_arguments({'port': 0, 'url_file': str(address.resolve())}))
        waiter = GuardedThread(lambda: _announce(group, address, console, over), 'live page')
        waiter.start()
        try:
            yield
        finally:
            over.set()
            waiter.join(timeout=_JOIN_S)
            address.unlink(missing_ok=True)


def _announce(group: ProcessGroup, address: Path, console: Console, over: threading.Event) -> None:
    deadline = time.monotonic() + _READY_S
    url = ''
    while not url and not over.is_set():
        if group.status(_NAME) is not None or time.monotonic() > deadline:
            log = address.parent / 'logs' / f'{_NAME}.log'
            console.print(f'the live page does not start: see {log}', markup=False)
            return
        over.wait(_POLL_S)
        url = address.read_text(encoding='utf-8').strip() if address.is_file() else ''
    if url:
        console.print(f'live page: {url}', highlight=False, markup=False, soft_wrap=True)
        if console.is_terminal:
            webbrowser.open(url)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes as separate processes: started with a log each, and none left alive at the end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, final

from peace_ros.core.domain import PeaceError

_INTERRUPT_S = 3.0
"""How long a process may take to end after SIGINT, and again after SIGTERM."""
_LOG_TAIL = 8


class ProcessError(PeaceError):
    """A process of the demo could not be started, or ended on its own."""


@dataclass(frozen=True)
class _Running:
    name: str
    process: subprocess.Popen[bytes]
    log: Path
    may_end: bool


@final
class ProcessGroup:
    """Start modules as processes of their own process groups; stop them all on leaving."""

    def __init__(self, log_dir: Path, environment: Mapping[str, str] | None = None) -> None:
        self._log_dir = log_dir
        self._environment = dict(os.environ if environment is None else environment)
        self._running: list[_Running] = []
        self._files = ExitStack()

    def __enter__(self) -> ProcessGroup:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop every process."""
        self.stop_all()

    @property
    def pids(self) -> dict[str, int]:
        """Name -> process id of what was started."""
        return {each.name: each.process.pid for each in self._running}

    def start(
        self, name: str, module: str, arguments: Sequence[str] = (), *, may_end: bool = False
    ) -> None:
        """Run ``python -m module arguments``; its output goes to ``<log_dir>/<name>.log``.

        With ``may_end`` the others go on without it.

        Raises:
            ProcessError: the log or the process cannot be created.
        """
        log = self._log_dir / f'{name}.log'
        command = [
            sys.executable,
            '-m',
            'peace_ros.simulation.demo.guarded',
            str(os.getpid()),
            module,
            *arguments,
        ]
        try:
            self._log_dir.mkdir(parents=True, exist_ok=True)
            output: IO[bytes] = self._files.enter_context(log.open('ab'))
            # A session of its own: Ctrl-C of the terminal reaches only the demo, which then
            # stops the nodes in order, and children of a node end with it.
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**self._environment, 'PYTHONUNBUFFERED': '1'},
                start_new_session=True,
            )
        except OSError as error:
            raise ProcessError(f'{name} cannot be started ({error}): see {log}') from error
        self._running.append(_Running(name, process, log, may_end))

    def check(self) -> None:
        """Do nothing while all processes live.

        Raises:
            ProcessError: one has ended; the sentence holds its exit status and last log lines.
        """
        for each in self._running:
            status = each.process.poll()
            if status is not None and not each.may_end:
                raise ProcessError(
                    f'{each.name} ended by itself with status {status}; the end of {each.log}:\n'
                    + log_tail(each.log)
                )

    def status(self, name: str) -> int | None:
        """Return the exit status of a process, None while it lives or when there is none."""
        found = [each for each in self._running if each.name == name]
        return found[-1].process.poll() if found else None

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal to one process, if it lives."""
        for each in self._running:
            if each.name == name and each.process.poll() is None:
                each.process.send_signal(number)

    def stop(self, name: str) -> None:
        """Stop one process and forget it."""
        chosen = [each for each in self._running if each.name == name]
        self._running = [each for each in self._running if each.name != name]
        _end(chosen)

    def stop_all(self) -> None:
        """Stop all: SIGINT, then SIGTERM, then SIGKILL, each to the whole process group."""
        running, self._running = self._running, []
        try:
            _end(running)
        finally:
            self._files.close()


def _end(running: list[_Running]) -> None:
    for number, limit_s in (
        (signal.SIGINT, _INTERRUPT_S),
        (signal.SIGTERM, _INTERRUPT_S),
        (signal.SIGKILL, _INTERRUPT_S),
    ):
        alive = [each for each in running if each.process.poll() is None]
        for each in alive:
            _signal_group(each.process.pid, number)
        deadline = time.monotonic() + limit_s
        for each in alive:
            with suppress(subprocess.TimeoutExpired):
                each.process.wait(max(0.0, deadline - time.monotonic()))
    for each in running:
        # Children of a node that outlived it share its group.
        _signal_group(each.process.pid, signal.SIGKILL)


def _signal_group(group: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


def log_tail(log: Path, lines: int = _LOG_TAIL) -> str:
    """Return the last lines of a log file, indented."""
    try:
        text = log.read_text(encoding='utf-8', errors='replace')
    except OSError as error:
        return f'  ({error})'
    tail = [line for line in text.splitlines() if line.strip()][-lines:]
    return '\n'.join(f'  {line}' for line in tail) or '  (empty)'

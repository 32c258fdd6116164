# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole matrix: workers, each with its own ROS domain and ports, and what they tell."""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import IO, Any

from peace_ros.lab.faults.fault import Fault
from peace_ros.lab.faults.judge import judge
from peace_ros.lab.faults.record import Record
from peace_ros.lab.faults.worker import read_line
from peace_ros.simulation.demo.processes import ProcessError, log_tail

_STOP_S = 20.0
_FAULT_LIMIT_S = 400.0
"""A worker that is silent for so long hangs."""

Row = dict[str, Any]


@dataclass
class Results:
    """Rows in the order in which they came, and the gaps between set-points of all flights."""

    rows: list[Row] = field(default_factory=list)
    gaps_s: list[float] = field(default_factory=list)
    trouble: str = ''
    """Why faults are missing, empty when none are."""


class _WorkerProcess:
    """One process of :mod:`peace_ros.lab.faults.worker`."""

    def __init__(self, number: int, folder: Path, world_folder: Path) -> None:
        self._folder = folder / f'worker-{number}'
        self._folder.mkdir(parents=True, exist_ok=True)
        self._log = (self._folder / 'worker.log').open('ab')
        self._process = subprocess.Popen(
            [
                *(sys.executable, '-m', 'peace_ros.simulation.demo.guarded', str(os.getpid())),
                *('peace_ros.lab.faults.worker', str(self._folder), str(world_folder)),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            start_new_session=True,
        )
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, name='worker', daemon=True).start()

    def run(self, fault: Fault, stop: threading.Event) -> dict[str, Any]:
        """Run one fault and return what the worker tells.

        Raises:
            ProcessError: the worker ends or hangs.
        """
        self._pipe(self._process.stdin).write(f'{fault.name}\n')
        self._pipe(self._process.stdin).flush()
        deadline = time.monotonic() + _FAULT_LIMIT_S
        while not stop.is_set():
            try:
                line = self._lines.get(timeout=0.2)
            except queue.Empty:
                if time.monotonic() > deadline:
                    raise ProcessError(
                        f'fault {fault.name}: nothing for {_FAULT_LIMIT_S:g} s: see {self._folder}'
                    ) from None
                continue
            if line is None:
                words = log_tail(self._folder / 'worker.log')
                raise ProcessError(f'fault {fault.name}: the worker ended:\n{words}')
            told = read_line(line)
            if told is not None:
                return told
        raise ProcessError('interrupted')

    def close(self) -> None:
        """Let it end, and its processes with it."""
        try:
            self._pipe(self._process.stdin).close()
            self._process.wait(_STOP_S)
        except (OSError, subprocess.TimeoutExpired):
            self._process.terminate()
            self._process.wait(_STOP_S)
        finally:
            self._log.close()

    def _listen(self) -> None:
        for line in self._pipe(self._process.stdout):
            self._lines.put(line)
        self._lines.put(None)

    @staticmethod
    def _pipe(pipe: IO[str] | None) -> IO[str]:
        if pipe is None:
            raise ProcessError('a worker without pipes cannot be spoken to')
        return pipe


def run_faults(
    faults: Sequence[Fault],
    jobs: int,
    folder: Path,
    world_folder: Path,
    tell: Callable[[str, Row | None], None],
) -> Results:
    """Run faults, so many at a time.

    Args:
        faults: In the order in which to run them; those of one setting should be neighbours.
        jobs: Workers; each needs about one core.
        folder: Where logs go.
        world_folder: Prepared worlds.
        tell: Called with a name and None when a fault begins, and with its row when it ends.

    A worker that ends or hangs fails its fault and ends the run; the rows so far are kept.
    """
    waiting: queue.SimpleQueue[Fault] = queue.SimpleQueue()
    for fault in faults:
        waiting.put(fault)
    results, lock, stop = Results(), threading.Lock(), threading.Event()
    # Started from this thread: the kernel ends them when the thread ends that started them.
    workers = [_WorkerProcess(n + 1, folder, world_folder) for n in range(min(jobs, len(faults)))]

    def work(worker: _WorkerProcess) -> None:
        try:
            while not stop.is_set():
                fault = waiting.get_nowait()
                tell(fault.name, None)
                told = _run(worker, fault, stop)
                with lock:
                    results.rows.append(told['row'])
                    results.gaps_s.extend(told['gaps_s'])
                    results.trouble = results.trouble or told.get('trouble', '')
                tell(fault.name, told['row'])
                if results.trouble:
                    stop.set()
        except queue.Empty:
            return

    threads = [threading.Thread(target=work, args=(each,), daemon=True) for each in workers]
    try:
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            time.sleep(0.1)
    finally:
        stop.set()
        for each in workers:
            each.close()
    return results


def _run(worker: _WorkerProcess, fault: Fault, stop: threading.Event) -> dict[str, Any]:
    """Run a fault; when the worker fails, that is the fault's result."""
    try:
        return worker.run(fault, stop)
    except (ProcessError, OSError) as error:
        row = judge(fault, Record(trouble=str(error)))
        return {'row': asdict(replace(row, hangs=1)), 'gaps_s': [], 'trouble': str(error)}

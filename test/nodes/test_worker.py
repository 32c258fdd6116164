# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heavy work happens on the newest input only, and a defect never passes in silence."""

from __future__ import annotations

import threading

from peace_ros.core.domain import ImageError
from peace_ros.nodes.worker import NewestWorker

LIMIT_S = 10.0


class Recorder:
    def __init__(self) -> None:
        self.done: list[int] = []
        self.complaints: list[Exception] = []
        self.failures: list[Exception] = []
        self.gate = threading.Event()
        self.entered = threading.Event()
        self.idle = threading.Event()
        self.worker = NewestWorker(
            self.work, self.complaints.append, self.note_failure, 'under_test'
        )

    def work(self, item: int) -> None:
        self.entered.set()
        self.gate.wait(LIMIT_S)
        if item < 0:
            raise ImageError(f'item {item}')
        if item == 0:
            raise ZeroDivisionError
        self.done.append(item)
        self.idle.set()

    def note_failure(self, error: Exception) -> None:
        self.failures.append(error)
        self.idle.set()


def test_the_oldest_is_dropped():
    recorder = Recorder()
    recorder.worker.offer(1)
    assert recorder.entered.wait(LIMIT_S)
    for item in range(2, 50):
        recorder.worker.offer(item)
    recorder.gate.set()
    while 49 not in recorder.done:
        assert recorder.idle.wait(LIMIT_S)
        recorder.idle.clear()
    recorder.worker.close()
    assert recorder.done == [1, 49]
    assert recorder.worker.dropped == 47


def test_an_error_of_the_input_is_complained_about_and_work_goes_on():
    recorder = Recorder()
    recorder.gate.set()
    recorder.worker.offer(-1)
    while not recorder.complaints:
        recorder.idle.wait(0.01)
    recorder.worker.offer(5)
    assert recorder.idle.wait(LIMIT_S)
    recorder.worker.close()
    assert recorder.done == [5]


def test_a_defect_is_reported_once():
    recorder = Recorder()
    recorder.gate.set()
    recorder.worker.offer(0)
    assert recorder.idle.wait(LIMIT_S)
    recorder.worker.close()
    assert [type(each) for each in recorder.failures] == [ZeroDivisionError]

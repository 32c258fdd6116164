# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Engaging a landing that is not ready at once, and hearing of a defect in the thread."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.simulation.demo import listener
from peace_ros.simulation.demo.listener import Listener


class Asking(Listener):
    """Gets its answers from a list instead of from a service; the last one is repeated."""

    def __init__(self, *answers: str) -> None:
        self.answers = list(answers)
        self.asked = 0
        self.failure = None

    def ask_to_engage(self) -> str:
        self.asked += 1
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener, '_AGAIN_S', 0.001)


def test_a_refusal_is_followed_by_another_try() -> None:
    asking = Asking('no heatmap yet', 'no heatmap yet', '')
    asking.engage(5.0)
    assert asking.asked == 3


def test_a_refusal_that_stays_is_told_with_its_reason() -> None:
    asking = Asking('no heatmap yet')
    with pytest.raises(VehicleError, match='refuses to engage: no heatmap yet'):
        asking.engage(0.01)
    assert asking.asked > 1


def test_what_ended_the_thread_is_raised() -> None:
    asking = Asking('')
    asking.check()
    asking.failure = ZeroDivisionError('a defect')
    with pytest.raises(ZeroDivisionError, match='a defect'):
        asking.check()

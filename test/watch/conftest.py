# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page server without ROS: a ledger that tests fill, and a landing node that only answers."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from peace_ros.watch.ledger import Ledger
from peace_ros.watch.server import PageServer

_SPEC = importlib.util.spec_from_file_location('scenes', Path(__file__).with_name('scenes.py'))
assert _SPEC is not None
assert _SPEC.loader is not None
SCENES = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(SCENES)


class Served:
    """The server, its ledger, and the commands that reached the landing node."""

    def __init__(self) -> None:
        self.ledger = Ledger('/')
        self.commands: list[str] = []
        self.defects: list[BaseException] = []
        self.answer = (True, 'engaged')
        self.server = PageServer(
            self.ledger, self._take, port=0, viewers=3, on_defect=self.defects.append
        )
        self.base = f'http://127.0.0.1:{self.server.port}'

    def _take(self, action: str) -> Future[tuple[bool, str]]:
        self.commands.append(action)
        done: Future[tuple[bool, str]] = Future()
        done.set_result(self.answer)
        return done

    def show(self, scene: str) -> None:
        SCENES.show(self.ledger, scene)
        self.server.news()


@pytest.fixture
def served() -> Iterator[Served]:
    served = Served()
    yield served
    served.server.close()
    assert served.defects == []


@pytest.fixture
def scenes():
    return SCENES

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page server without ROS: a ledger that tests fill, and a landing node that only answers."""

from __future__ import annotations

import importlib.util
import threading
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
        self._over = threading.Event()
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
        """Say once what the landing is in."""
        SCENES.show(self.ledger, scene)
        self.server.news()

    def keep(self, scene: str) -> None:
        """Say it again and again, so that it does not become old."""

        def say() -> None:
            while not self._over.wait(0.1):
                self.show(scene)

        self.show(scene)
        threading.Thread(target=say, daemon=True).start()

    def close(self) -> None:
        self._over.set()
        self.server.close()


@pytest.fixture
def served() -> Iterator[Served]:
    served = Served()
    yield served
    served.close()
    assert served.defects == []


@pytest.fixture
def scenes():
    return SCENES

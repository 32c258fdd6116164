# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The thread that writes: a bounded queue before it, so that a slow disk costs messages only."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, final

import numpy as np

from peace_ros.core.domain import PeaceError
from peace_ros.core.images import rgb_from_message
from peace_ros.core.messages import MessageBuilder, stamp_ns_of
from peace_ros.core.threads import GuardedThread, OnDefect
from peace_ros.recorder.flight_file import DAMAGE, TYPESTORE, Note
from peace_ros.recorder.store import RecordingStore

_FLUSH_S = 0.3
"""So much, and what a flush takes, is lost when the power is cut."""
_MOST_WAITING_BYTES = 64_000_000
_MOST_WAITING = 4000
_JOIN_S = 3.0
_IMAGE, _COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
_BUILD = MessageBuilder(
    lambda package, name: TYPESTORE.types[f'{package}/msg/{name}'],
    lambda data: np.frombuffer(data, np.uint8),
)

_Job = tuple[Callable[[], None], int]
"""What is to be done, and the bytes that it holds."""


@final
class FlightWriter:
    """Writes notes in a thread of its own; :meth:`put` never waits.

    Args:
        store: is used by the thread alone.
        image_quality: of the JPEG of raw images.
        fail: gets what ends the thread.
    """

    def __init__(self, store: RecordingStore, image_quality: int, fail: OnDefect) -> None:
        self._store, self._quality = store, image_quality
        self._jobs: deque[_Job] = deque()
        self._bytes = 0
        self._ready = threading.Condition()
        self._stopping = False
        self.dropped = 0
        """Messages that found the queue full."""
        self.unusable = 0
        """Images that could not be read."""
        self._thread = GuardedThread(self._loop, 'recorder', fail)
        self._thread.start()

    def put(self, note: Note) -> None:
        """Write a message soon, or drop it where too much waits."""
        self._offer(lambda: self._store.add(note), len(note.cdr))

    def put_image(self, note: Note) -> None:
        """Write a raw image as JPEG on ``<topic>/compressed``."""
        self._offer(lambda: self._compress(note), len(note.cdr))

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Write metadata into this file and each later one."""
        self._offer(lambda: self._store.describe(name, values), 0)

    def close(self) -> None:
        """Write what waits and finish the file; waits a few seconds at most."""
        with self._ready:
            self._stopping = True
            self._ready.notify()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=_JOIN_S)

    def _offer(self, job: Callable[[], None], size: int) -> None:
        with self._ready:
            if len(self._jobs) >= _MOST_WAITING or self._bytes + size > _MOST_WAITING_BYTES:
                self.dropped += 1
                return
            self._jobs.append((job, size))
            self._bytes += size

    def _take(self) -> deque[_Job]:
        """Wait for the next flush, and return what has come until then."""
        with self._ready:
            self._ready.wait_for(lambda: self._stopping, timeout=_FLUSH_S)
            jobs, self._jobs = self._jobs, deque()
            return jobs

    def _loop(self) -> None:
        while not self._stopping:
            for job, size in self._take():
                job()
                with self._ready:
                    self._bytes -= size
            self._store.flush()
        for job, _ in self._take():
            job()
        self._store.close()

    def _compress(self, note: Note) -> None:
        try:
            message: Any = TYPESTORE.deserialize_cdr(note.cdr, _IMAGE)
            rgb = rgb_from_message(message)
        except (PeaceError, *DAMAGE):
            self.unusable += 1
            return
        at_ns, frame_id = stamp_ns_of(message), message.header.frame_id
        jpeg = _BUILD.jpeg(rgb, at_ns, self._quality, frame_id)
        cdr = bytes(TYPESTORE.serialize_cdr(jpeg, _COMPRESSED))
        self._store.add(Note(f'{note.topic}/compressed', _COMPRESSED, note.log_ns, cdr))

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The thread that writes: never waited for, and what it drops is counted."""

from __future__ import annotations

import threading
import time

import numpy as np

from peace_ros.core.messages import frame_from_message
from peace_ros.core.node_parameters import RecorderParameters
from peace_ros.recorder import writer as module
from peace_ros.recorder.flight_file import TYPESTORE, Note
from peace_ros.recorder.store import RecordingStore
from peace_ros.recorder.writer import FlightWriter
from peace_ros.recording import BagReader
from peace_ros.recording.messages import image_message

IMAGE = 'sensor_msgs/msg/Image'


def image_note(size: int = 48) -> Note:
    rgb = np.random.default_rng(1).integers(0, 60, (size, size, 3), np.uint8)
    message = image_message(rgb, 'rgb8', 7, 'optical')
    return Note('/image', IMAGE, 9, bytes(TYPESTORE.serialize_cdr(message, IMAGE)))


def never(error: BaseException) -> None:
    raise AssertionError(error)


def test_raw_images_become_jpeg_with_their_stamp_and_frame(tmp_path) -> None:
    store = RecordingStore(tmp_path, RecorderParameters(least_free_mb=0), never)
    writer = FlightWriter(store, 95, never)
    writer.put_image(image_note())
    broken = image_note()
    writer.put_image(broken._replace(cdr=broken.cdr[:20] + bytes(len(broken.cdr) - 20)))
    writer.close()
    (path,) = tmp_path.glob('*.mcap')
    with BagReader(path) as bag:
        ((topic, at_ns, message),) = bag.messages(['/image/compressed'])
    assert (topic, at_ns, message.header.frame_id) == ('/image/compressed', 9, 'optical')
    frame = frame_from_message(message)
    assert (frame.stamp_ns, frame.image_rgb.shape) == (7, (48, 48, 3))
    assert writer.unusable == 1


class SlowStore:
    """A disk that answers nothing until it is let go."""

    def __init__(self) -> None:
        self.go_on, self.notes = threading.Event(), []

    def add(self, note: Note) -> None:
        self.go_on.wait(20.0)
        self.notes.append(note)

    def flush(self) -> None:
        self.go_on.wait(20.0)

    def close(self) -> None:
        pass


def test_a_slow_disk_costs_messages_and_no_time(monkeypatch) -> None:
    monkeypatch.setattr(module, '_MOST_WAITING', 100)
    store = SlowStore()
    writer = FlightWriter(store, 90, never)
    small = Note('/a', IMAGE, 1, b'')
    began_s = time.monotonic()
    for _ in range(1000):
        writer.put(small)
    assert time.monotonic() - began_s < 1.0
    assert 700 <= writer.dropped <= 900
    store.go_on.set()
    writer.close()
    assert len(store.notes) + writer.dropped == 1000


def test_large_messages_are_bounded_by_their_bytes(monkeypatch) -> None:
    monkeypatch.setattr(module, '_MOST_WAITING_BYTES', 1000)
    store = SlowStore()
    writer = FlightWriter(store, 90, never)
    for _ in range(10):
        writer.put(Note('/a', IMAGE, 1, bytes(400)))
    assert writer.dropped >= 6
    store.go_on.set()
    writer.close()


def test_a_disk_that_never_answers_does_not_keep_the_node_from_ending(monkeypatch) -> None:
    monkeypatch.setattr(module, '_JOIN_S', 0.2)
    store = SlowStore()
    writer = FlightWriter(store, 90, never)
    writer.put(Note('/a', IMAGE, 1, b''))
    began_s = time.monotonic()
    writer.close()
    assert time.monotonic() - began_s < 5.0
    store.go_on.set()

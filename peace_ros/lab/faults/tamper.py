# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can happen to an image, a heatmap or a prompt between two nodes."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, Pose
from peace_ros.core.messages import NANOSECONDS, stamp_ns_of
from peace_ros.lab.faults.walker import Walker
from peace_ros.nodes.messages import image_message, time_from_ns

Late = tuple[float, Any]
"""Seconds by which a message is held back, and the message."""
Tamper = Callable[[Any], Iterable[Late]]
"""Takes a message and returns what becomes of it; keeps its own memory."""


def untouched(message: Any) -> Iterable[Late]:
    """Hand on what comes."""
    return ((0.0, message),)


def nothing(_message: Any) -> Iterable[Late]:
    """Lose everything."""
    return ()


def late(seconds: float) -> Tamper:
    """Hold every message back."""
    return lambda message: ((seconds, message),)


def rare(period_s: float, clock_s: Callable[[], float] = time.monotonic) -> Tamper:
    """Let one message through per period."""
    due_s = [-1e9]

    def tamper(message: Any) -> Iterable[Late]:
        if clock_s() < due_s[0]:
            return ()
        due_s[0] = clock_s() + period_s
        return ((0.0, message),)

    return tamper


def frozen(*, new_stamps: bool) -> Tamper:
    """Repeat the first picture, with its old stamp or with the stamps of those that follow."""
    kept: list[Any] = []

    def tamper(message: Any) -> Iterable[Late]:
        if not kept:
            kept.append(message)
        first = kept[0]
        at_ns = stamp_ns_of(message) if new_stamps else stamp_ns_of(first)
        return ((0.0, _with(first, first.data, at_ns)),)

    return tamper


def filled(level: int) -> Tamper:
    """Give every pixel one value."""

    def tamper(message: Any) -> Iterable[Late]:
        data = array('B', bytes([level]) * len(message.data))
        return ((0.0, _with(message, data)),)

    return tamper


def noisy(seed: int = 0) -> Tamper:
    """Give every pixel a random value."""
    random = np.random.default_rng(seed)

    def tamper(message: Any) -> Iterable[Late]:
        return ((0.0, _with(message, array('B', random.bytes(len(message.data))))),)

    return tamper


def flickering() -> Tamper:
    """Turn every second picture into zeros and the others into the highest value."""
    count = [0]

    def tamper(message: Any) -> Iterable[Late]:
        count[0] += 1
        return filled(255 * (count[0] % 2))(message)

    return tamper


def cut_short(message: Any) -> Iterable[Late]:
    """Lose the second half of the bytes."""
    return ((0.0, _with(message, message.data[: len(message.data) // 2])),)


def of_encoding(encoding: str) -> Tamper:
    """Claim another encoding for the same bytes."""

    def tamper(message: Any) -> Iterable[Late]:
        changed = _with(message, message.data)
        changed.encoding = encoding
        return ((0.0, changed),)

    return tamper


def resized(width_px: int, height_px: int) -> Tamper:
    """Cut a window of that shape out of the middle and scale it to that size."""

    def tamper(message: Any) -> Iterable[Late]:
        pixels = pixels_of(message)
        scale = min(message.width / width_px, message.height / height_px)
        width, height = round(width_px * scale), round(height_px * scale)
        left, top = (message.width - width) // 2, (message.height - height) // 2
        window = np.ascontiguousarray(pixels[top : top + height, left : left + width])
        small = np.asarray(cv2.resize(window, (width_px, height_px)), np.uint8)
        header = message.header
        return (
            (0.0, image_message(small, message.encoding, stamp_ns_of(message), header.frame_id)),
        )

    return tamper


def shifted(seconds: float) -> Tamper:
    """Move the stamps."""
    shift_ns = round(seconds * NANOSECONDS)

    def tamper(message: Any) -> Iterable[Late]:
        at_ns = max(0, stamp_ns_of(message) + shift_ns)
        return ((0.0, _with(message, message.data, at_ns)),)

    return tamper


def equal_stamps() -> Tamper:
    """Give every picture the stamp of the first."""
    first_ns: list[int] = []

    def tamper(message: Any) -> Iterable[Late]:
        first_ns.append(stamp_ns_of(message))
        return ((0.0, _with(message, message.data, first_ns[0])),)

    return tamper


def running_back() -> Tamper:
    """Let the stamps run backwards from the first on, as fast as time runs forward."""
    first_ns: list[int] = []

    def tamper(message: Any) -> Iterable[Late]:
        first_ns.append(stamp_ns_of(message))
        return ((0.0, _with(message, message.data, 2 * first_ns[0] - first_ns[-1])),)

    return tamper


def with_walker(walker: Walker, camera: Camera, pose_at: Callable[[int], Pose | None]) -> Tamper:
    """Paint a person who walks over the ground into the camera's picture."""

    def tamper(message: Any) -> Iterable[Late]:
        at_ns = stamp_ns_of(message)
        pose = pose_at(at_ns)
        if pose is None:
            return ((0.0, message),)
        painted = walker.paint(pixels_of(message), camera, pose, at_ns)
        return ((0.0, image_message(painted, 'rgb8', at_ns, message.header.frame_id)),)

    return tamper


def with_walker_seen(
    walker: Walker, camera: Camera, pose_at: Callable[[int], Pose | None]
) -> Tamper:
    """Let the heatmap call the ground around a walking person unsafe, as a good model would."""

    def tamper(message: Any) -> Iterable[Late]:
        at_ns = stamp_ns_of(message)
        pose = pose_at(at_ns)
        if pose is None:
            return ((0.0, message),)
        levels = pixels_of(message)[:, :, 0]
        walker.darken(levels, camera.resized(message.width, message.height), pose, at_ns)
        return ((0.0, image_message(levels, 'mono8', at_ns, message.header.frame_id)),)

    return tamper


def without_term(message: Any) -> Iterable[Late]:
    """Take the place of the term out of a prompt."""
    for status in message.status:
        for pair in status.values:
            pair.value = pair.value.replace('{term}', 'nothing')
    return ((0.0, message),)


def always(what: Tamper) -> Callable[[], Tamper]:
    """Return the factory of a tamper that remembers nothing."""
    return lambda: what


TAMPERS: dict[str, Callable[..., Tamper]] = {
    each.__name__: each
    for each in (
        *(late, rare, frozen, filled, noisy, flickering, of_encoding, resized, shifted),
        *(equal_stamps, running_back),
    )
} | {each.__name__: always(each) for each in (untouched, nothing, cut_short, without_term)}
"""Name -> factory, called when a fault is injected: a tamper may remember."""


def pixels_of(message: Any) -> NDArray[np.uint8]:
    """Return the pixels of a raw image, height x width x channels; a copy."""
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    channels = message.step // message.width
    used = rows[:, : message.width * channels].copy()
    pixels: NDArray[np.uint8] = used.reshape(message.height, message.width, channels)
    return pixels


def _with(message: Any, data: Any, at_ns: int | None = None) -> Any:
    """Return a copy of an image with other bytes and perhaps another stamp."""
    copy = type(message)()
    copy.header.frame_id = message.header.frame_id
    copy.header.stamp = message.header.stamp if at_ns is None else time_from_ns(at_ns)
    copy.height, copy.width = message.height, message.width
    copy.encoding, copy.step, copy.is_bigendian = message.encoding, message.step, 0
    copy.data = data
    return copy

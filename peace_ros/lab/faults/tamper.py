# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can happen to an image, a heatmap or a prompt between two nodes."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Iterable
from itertools import cycle
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


def edited(change: Callable[[Any], Any]) -> Tamper:
    """Hand on what a function makes of each message."""
    return lambda message: ((0.0, change(message)),)


def frozen(*, new_stamps: bool) -> Tamper:
    """Repeat the first picture, with its old stamp or with the stamps of those that follow."""
    kept: list[Any] = []

    def change(message: Any) -> Any:
        kept.append(message)
        del kept[1:]
        at_ns = stamp_ns_of(message if new_stamps else kept[0])
        return _with(kept[0], kept[0].data, at_ns)

    return edited(change)


def filled(level: int) -> Tamper:
    """Give every pixel one value."""
    return edited(lambda message: _with(message, array('B', [level]) * len(message.data)))


def noisy(seed: int = 0) -> Tamper:
    """Give every pixel a random value."""
    random = np.random.default_rng(seed)
    return edited(lambda message: _with(message, array('B', random.bytes(len(message.data)))))


def flickering() -> Tamper:
    """Turn every second picture into zeros and the others into the highest value."""
    fills = cycle((filled(255), filled(0)))

    def tamper(message: Any) -> Iterable[Late]:
        return next(fills)(message)

    return tamper


def cut_short(message: Any) -> Iterable[Late]:
    """Lose the second half of the bytes."""
    return ((0.0, _with(message, message.data[: len(message.data) // 2])),)


def of_encoding(encoding: str) -> Tamper:
    """Claim another encoding for the same bytes."""

    def change(message: Any) -> Any:
        changed = _with(message, message.data)
        changed.encoding = encoding
        return changed

    return edited(change)


def resized(width_px: int, height_px: int) -> Tamper:
    """Cut a window of that shape out of the middle and scale it to that size."""

    def change(message: Any) -> Any:
        scale = min(message.width / width_px, message.height / height_px)
        width, height = round(width_px * scale), round(height_px * scale)
        left, top = (message.width - width) // 2, (message.height - height) // 2
        window = np.ascontiguousarray(pixels_of(message)[top : top + height, left : left + width])
        small = np.asarray(cv2.resize(window, (width_px, height_px)), np.uint8)
        return image_message(small, message.encoding, stamp_ns_of(message), message.header.frame_id)

    return edited(change)


def restamped(stamp: Callable[[int, int], int]) -> Tamper:
    """Give every picture the stamp (ns) that a function makes of the first stamp and its own."""
    first_ns: list[int] = []

    def change(message: Any) -> Any:
        first_ns.append(stamp_ns_of(message))
        return _with(message, message.data, stamp(first_ns[0], first_ns[-1]))

    return edited(change)


def shifted(seconds: float) -> Tamper:
    """Move the stamps."""
    return restamped(lambda _, own_ns: max(0, own_ns + round(seconds * NANOSECONDS)))


def equal_stamps() -> Tamper:
    """Give every picture the stamp of the first."""
    return restamped(lambda first_ns, _: first_ns)


def running_back() -> Tamper:
    """Let the stamps run backwards from the first on, as fast as time runs forward."""
    return restamped(lambda first_ns, own_ns: 2 * first_ns - own_ns)


def _where_posed(
    pose_at: Callable[[int], Pose | None], change: Callable[[Any, Pose, int], NDArray[np.uint8]]
) -> Tamper:
    """Hand on the pixels that a function makes of a message, where the true pose is known."""

    def with_pose(message: Any) -> Any:
        at_ns = stamp_ns_of(message)
        pose = pose_at(at_ns)
        if pose is None:
            return message
        pixels, frame_id = change(message, pose, at_ns), message.header.frame_id
        return image_message(pixels, 'mono8' if pixels.ndim == 2 else 'rgb8', at_ns, frame_id)

    return edited(with_pose)


def with_walker(walker: Walker, camera: Camera, pose_at: Callable[[int], Pose | None]) -> Tamper:
    """Paint a person who walks over the ground into the camera's picture."""
    return _where_posed(
        pose_at,
        lambda message, pose, at_ns: walker.paint(pixels_of(message), camera, pose, at_ns),
    )


def with_walker_seen(
    walker: Walker, camera: Camera, pose_at: Callable[[int], Pose | None]
) -> Tamper:
    """Let the heatmap call the ground around a walking person unsafe, as a good model would."""

    def darken(message: Any, pose: Pose, at_ns: int) -> NDArray[np.uint8]:
        levels = pixels_of(message)[:, :, 0]
        walker.darken(levels, camera.resized(message.width, message.height), pose, at_ns)
        return levels

    return _where_posed(pose_at, darken)


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

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink telemetry logs (``.tlog``): before each message the time of its receipt.

The times are microseconds of Unix time, 8 bytes, the highest first. pymavlink's own reader takes
the 8 bytes after a damaged message for a time, wherever they stand, and finds nothing more in some
files. Here the search goes on byte by byte until a time and a message fit together.
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import RecordingError

_STAMP_BYTES = 8
_APART_US = 86_400 * 1_000_000
"""Neighbours that are received further apart than this are not two messages of one flight."""
_MAVLINK_1, _MAVLINK_2 = 0xFE, 0xFD
_START = re.compile(b'[\xfd\xfe]')
_LONGEST_HEADER = 10
_SIGNED = 1
_SIGNATURE_BYTES = 13
_MOST_DAMAGED_BYTES = 1 << 20
"""Of a file that is damaged in more than half; searching in it takes seconds per MiB."""


class TelemetryLog:
    """The messages of some kinds in a log.

    Args:
        path: of the file, which is not empty.
        kinds: Numbers of the messages that are wanted.
    """

    def __init__(self, path: Path, kinds: Collection[int]) -> None:
        self._path = path
        self._kinds = kinds
        self._codec = mavlink.MAVLink(None)
        self._bytes_left_out = 0
        self._places = 0

    @property
    def remark(self) -> str:
        """What was left out so far, empty when nothing."""
        if not self._places:
            return ''
        return (
            f'{self._bytes_left_out} bytes of {self._path.name} in {self._places} places are '
            'damaged messages or none: left out'
        )

    def messages(self) -> Iterator[tuple[float, Any]]:
        """Yield (time of receipt in s, message) in the order of the file.

        Raises:
            RecordingError: most of it is damaged or something else.
            ValueError: it is empty.
        """
        with (
            self._path.open('rb') as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
        ):
            yield from self._found(data)

    def _found(self, data: mmap.mmap) -> Iterator[tuple[float, Any]]:
        at, last_us, searches = 0, None, False
        while at < len(data):
            end = _end_of_message(data, at)
            found = None if end is None else self._message(data, at, end, last_us)
            if end is not None and found is not None:
                last_us, message = found
                at, searches = end, False
                if message is not None:
                    yield last_us * 1e-6, message
                continue
            start = _START.search(data, at + 1 + _STAMP_BYTES)
            following = len(data) if start is None else start.start() - _STAMP_BYTES
            self._places += not searches
            self._bytes_left_out += following - at
            at, searches = following, True
            if self._bytes_left_out > max(_MOST_DAMAGED_BYTES, at // 2):
                raise RecordingError(
                    f'{self._path}: {self._bytes_left_out} of the first {at} bytes are no MAVLink '
                    'with times of receipt: give a .tlog'
                )

    def _message(
        self, data: mmap.mmap, at: int, end: int, last_us: int | None
    ) -> tuple[int, Any] | None:
        """Return time and message, None in its place when it is not wanted; None for neither."""
        stamp_us = _stamp_us(data, at)
        following_us = None
        if end < len(data) and _end_of_message(data, end) is not None:
            following_us = _stamp_us(data, end)
        # A clock that is set during the flight changes both neighbours, damage only one.
        follows = following_us is not None and abs(following_us - stamp_us) <= _APART_US
        continues = last_us is not None and abs(stamp_us - last_us) <= _APART_US
        if not (follows or continues or (end == len(data) and last_us is None)):
            return None
        packet = data[at + _STAMP_BYTES : end]
        wanted = _kind(packet) in self._kinds
        if not wanted and (follows or end == len(data)):
            return stamp_us, None  # Where the next one fits to it, its checksum is not needed.
        try:
            message = self._codec.decode(bytearray(packet))
        except mavlink.MAVError:
            return None
        if message.get_msgId() < 0:  # of a kind that the dialect does not know
            return None
        return stamp_us, message if wanted else None


def _stamp_us(data: mmap.mmap, at: int) -> int:
    return int.from_bytes(data[at : at + _STAMP_BYTES], 'big')


def _end_of_message(data: mmap.mmap, at: int) -> int | None:
    """Return where a message with its time would end, None when none begins here."""
    header = data[at + _STAMP_BYTES : at + _STAMP_BYTES + _LONGEST_HEADER]
    if len(header) < _LONGEST_HEADER:
        return None
    if header[0] == _MAVLINK_1:
        size = 8 + header[1]
    elif header[0] == _MAVLINK_2:
        size = 12 + header[1] + _SIGNATURE_BYTES * (header[2] & _SIGNED)
    else:
        return None
    end = at + _STAMP_BYTES + size
    return end if end <= len(data) else None


def _kind(packet: bytes) -> int:
    return packet[5] if packet[0] == _MAVLINK_1 else int.from_bytes(packet[7:10], 'little')

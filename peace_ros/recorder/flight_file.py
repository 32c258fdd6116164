# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One MCAP file that is whole up to its last flush, whenever the power is cut."""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, final

from mcap.writer import CompressionType, Writer
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
"""Definitions of the messages, which MCAP carries so that every viewer can read it."""
DAMAGE = (SerdeError, ValueError, IndexError, struct.error)
"""What reading a message of damaged bytes raises."""
LIBRARY = 'peace_ros recorder'
"""By which a replay recognises these files."""
_CHUNK_BYTES = 512 * 1024
_QOS = {
    False: '- {history: 1, depth: 10, reliability: 1, durability: 2}\n',
    True: '- {history: 1, depth: 1, reliability: 1, durability: 1}\n',
}
"""Latched or not -> profile in the form of rosbag2, so that players offer it: keep last, reliable,
volatile (2) or transient local (1)."""


class Note(NamedTuple):
    """One serialised message."""

    topic: str
    type: str
    """As ``sensor_msgs/msg/Image``."""
    log_ns: int
    """When it was received, by the node clock."""
    cdr: bytes
    latched: bool = False


@final
class FlightFile:
    """An MCAP file under its final name from the beginning.

    Args:
        path: must not exist.

    Raises:
        OSError: the place cannot be written to, also by every method below.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream = path.open('xb')
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._holds_messages = False
        self._writer.start('ros2', LIBRARY)

    @property
    def size_bytes(self) -> int:
        """What the file has on disk."""
        return self._stream.tell()

    def add(self, note: Note) -> None:
        """Add a message; it is on disk after the next :meth:`flush`."""
        channel = self._channels.get(note.topic)
        if channel is None:
            channel = self._channels[note.topic] = self._writer.register_channel(
                note.topic,
                'cdr',
                self._schema(note.type),
                {'offered_qos_profiles': _QOS[note.latched]},
            )
        self._writer.add_message(channel, note.log_ns, note.cdr, note.log_ns)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a record of texts that is no message."""
        self._writer.add_metadata(name, dict(values))

    def flush(self) -> None:
        """Put everything so far on the disk itself, beyond the buffers of the system."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        os.fdatasync(self._stream.fileno())
        self._holds_messages = bool(self._channels)

    def close(self) -> None:
        """Write the index and close the file; without it the file can be read nevertheless."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.flush()
            os.fdatasync(self._stream.fileno())
        finally:
            self._stream.close()

    def abandon(self) -> None:
        """Close the file as it is, after an error; remove it where it holds nothing."""
        with suppress(OSError):
            self._stream.close()
        if not self._holds_messages:
            self.path.unlink(missing_ok=True)

    def _schema(self, kind: str) -> int:
        if kind not in self._schemas:
            definition, _ = TYPESTORE.generate_msgdef(kind, ros_version=2)
            self._schemas[kind] = self._writer.register_schema(kind, 'ros2msg', definition.encode())
        return self._schemas[kind]

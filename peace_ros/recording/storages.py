# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files of recordings: MCAP, sqlite3 and ROS 1 bags, as topics and raw messages.

The metadata of a bag folder tells which files belong to it and nothing else: what it says of
topics, services and the kind of storage may be missing or older than the files.
"""

from __future__ import annotations

import shutil
import struct
import tempfile
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from heapq import merge
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader

from peace_ros.core.domain import ConfigurationError, RecordingError
from peace_ros.core.yaml_files import read_yaml

STORAGES = ('.mcap', '.db3', '.bag')
COMPRESSED = ('.zstd', '.zst')
_ZSTD = b'\x28\xb5\x2f\xfd'
"""First bytes of a message that was compressed by itself; CDR begins with 0."""
_LARGEST_RECORD = 1 << 30
MCAP_ERRORS: tuple[type[Exception], ...] = (
    McapError,
    zstandard.ZstdError,
    RuntimeError,  # of lz4
    struct.error,
    EOFError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    MemoryError,
)
"""What mcap lets out on files that are cut short or overwritten, beside its own errors."""


class TopicOfFile(NamedTuple):
    """Messages of one kind."""

    name: str
    type: str
    """As ``sensor_msgs/msg/Image``."""
    is_ros1: bool
    """Serialised as ROS 1 does, otherwise CDR."""
    messages: int


class RawMessage(NamedTuple):
    """One message as it was recorded."""

    stamp_ns: int
    """Of its receipt."""
    topic: TopicOfFile
    data: bytes


class RecordingFile(ABC):
    """One file of a recording."""

    topics: list[TopicOfFile]
    """Those whose messages can be deserialised; others do not matter."""
    remark: str = ''
    """What the user has to know about the file."""

    @abstractmethod
    def messages(self, names: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in order of receipt."""

    @abstractmethod
    def close(self) -> None:
        """Close the file."""


class McapStorage(RecordingFile):
    """An MCAP of any profile; read up to where it breaks off, when it was cut short."""

    def __init__(self, path: Path) -> None:
        self._file = path.open('rb')
        try:
            self._reader: SeekingReader | None = SeekingReader(
                self._file, validate_crcs=True, record_size_limit=_LARGEST_RECORD
            )
            counted = self._by_summary(self._reader)
            if counted is None:
                self._reader = None
                counted = self._by_scan()
        except BaseException:
            self._file.close()
            raise
        channels, counts = counted
        self.topics = [
            TopicOfFile(channel.topic, kind, channel.message_encoding == 'ros1', counts[channel.id])
            for channel, kind in channels
            if channel.message_encoding in {'cdr', 'ros1'}
        ]

    def messages(self, names: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics; where there is no index, in the order of the file."""
        of_name = {each.name: each for each in self.topics if each.name in names}
        for channel, message in self._found(names):
            topic = of_name.get(channel.topic)
            if topic is not None and channel.message_encoding in {'cdr', 'ros1'}:
                yield RawMessage(message.log_time, topic, _decompressed(message.data))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _found(self, names: Collection[str]) -> Iterator[tuple[Channel, Message]]:
        if self._reader is not None:
            for _, channel, message in self._reader.iter_messages(topics=list(names)):
                yield channel, message
            return
        channels: dict[int, Channel] = {}
        for record in self._records():
            if isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and record.channel_id in channels:
                yield channels[record.channel_id], record

    def _by_summary(
        self, reader: SeekingReader
    ) -> tuple[list[tuple[Channel, str]], Counter[int]] | None:
        """Return channels with their types and counts; None where the file has to be scanned."""
        try:
            summary = reader.get_summary()
        except MCAP_ERRORS:
            return None
        if summary is None or summary.statistics is None or not summary.channels:
            return None
        kinds = [(each, _kind(each, summary.schemas)) for each in summary.channels.values()]
        return kinds, Counter(summary.statistics.channel_message_counts)

    def _by_scan(self) -> tuple[list[tuple[Channel, str]], Counter[int]]:
        channels: dict[int, Channel] = {}
        schemas: dict[int, Schema] = {}
        counts: Counter[int] = Counter()
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                counts[record.channel_id] += 1
        return [(each, _kind(each, schemas)) for each in channels.values()], counts

    def _records(self) -> Iterator[Any]:
        self._file.seek(0)
        whole = 0
        try:
            reader = StreamReader(self._file, validate_crcs=True, record_size_limit=_LARGEST_RECORD)
            for record in reader.records:
                whole += isinstance(record, Message)
                yield record
        except MCAP_ERRORS as error:
            if not whole:
                raise
            self.remark = (
                f'it breaks off after {whole} messages ({type(error).__name__}): what comes later '
                'is missing; "mcap recover" writes a whole file'
            )


class RosbagsStorage(RecordingFile):
    """A sqlite3 file of ROS 2 or a bag of ROS 1."""

    def __init__(self, path: Path) -> None:
        is_ros1 = path.suffix.lower() == '.bag'
        self._reader: Any = Ros1Reader(path) if is_ros1 else Reader(path)
        self._reader.open()
        self._known = {
            each.id: (each, TopicOfFile(each.topic, each.msgtype, is_ros1, each.msgcount))
            for each in self._reader.connections
            if is_ros1 or getattr(each.ext, 'serialization_format', '') == 'cdr'
        }
        self.topics = [topic for _, topic in self._known.values()]

    def messages(self, names: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in order of receipt."""
        chosen = [each for each, topic in self._known.values() if topic.name in names]
        if chosen:
            for connection, stamp_ns, data in self._reader.messages(connections=chosen):
                yield RawMessage(stamp_ns, self._known[connection.id][1], _decompressed(data))

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


class Storages:
    """All files of a recording, as one."""

    def __init__(self, path: Path) -> None:
        """Open them.

        Args:
            path: bag folder, or one file of :data:`STORAGES`, maybe compressed as a whole.

        Raises:
            RecordingError: the folder does not tell its files, or one is of another kind.
            Exception: whatever the readers let out on a damaged file.
        """
        self._stack = ExitStack()
        self._opened: list[RecordingFile] = []
        try:
            for each in files_of(path):
                storage = self._open(each)
                self._stack.callback(storage.close)
                self._opened.append(storage)
        except BaseException:
            self._stack.close()
            raise
        self.topics = [topic for each in self._opened for topic in each.topics]

    @property
    def remarks(self) -> list[str]:
        """What the user has to know about the files."""
        return [each.remark for each in self._opened if each.remark]

    def messages(self, names: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of some topics in order of receipt."""
        yield from merge(
            *(each.messages(names) for each in self._opened), key=lambda raw: raw.stamp_ns
        )

    def close(self) -> None:
        """Close all files."""
        self._stack.close()

    def _open(self, path: Path) -> RecordingFile:
        if path.suffix.lower() in COMPRESSED:
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
            whole = folder / path.stem
            _unpack(path, whole)
            path = whole
        return McapStorage(path) if path.suffix.lower() == '.mcap' else RosbagsStorage(_plain(path))


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording.

    Raises:
        RecordingError: there is none, or the metadata of the folder cannot be used.
    """
    if not path.is_dir():
        if not path.is_file():
            raise RecordingError(f'{path} is a device or a pipe: give a file')
        return [path]
    metadata = path / 'metadata.yaml'
    if not metadata.is_file():
        raise RecordingError(
            f'folder {path} holds no metadata.yaml: give a bag folder, or its .mcap or .db3'
        )
    try:
        content = read_yaml(metadata, 'give the .mcap or .db3 itself')
        listed = content['rosbag2_bagfile_information']['relative_file_paths']
        files = [path / Path(str(each)).name for each in listed]
    except ConfigurationError as error:
        raise RecordingError(str(error)) from error
    except (KeyError, TypeError, ValueError) as error:  # ValueError: a name with a NUL
        raise RecordingError(
            f'{metadata} does not tell the files of the bag ({type(error).__name__}): '
            'give the .mcap or .db3 itself'
        ) from error
    missing = [each.name for each in files if not each.is_file()]
    if missing or not files:
        raise RecordingError(
            f'{metadata} names {", ".join(missing) or "no files"}, which the folder lacks: '
            'give the .mcap or .db3 itself'
        )
    return files


def _unpack(packed: Path, whole: Path) -> None:
    """Unpack a file into at most half of the room that is free."""
    most = left = shutil.disk_usage(whole.parent).free // 2
    with packed.open('rb') as source, whole.open('wb') as target:
        for part in zstandard.ZstdDecompressor().read_to_iter(source):
            left -= len(part)
            if left < 0:
                raise RecordingError(
                    f'{packed} is larger than {most >> 20} MiB when unpacked, half of what '
                    f'{whole.parent.parent} has free: unpack it elsewhere and give the .mcap'
                )
            target.write(part)


def is_recording(path: Path) -> bool:
    """Tell whether a path looks like one: a folder, or a file named as a recording."""
    suffixes = [each.lower() for each in path.suffixes[-2:]]
    if suffixes and suffixes[-1] in COMPRESSED:
        suffixes.pop()
    return path.is_dir() or bool(suffixes and suffixes[-1] in STORAGES)


def _plain(path: Path) -> Path:
    """Refuse what rosbags would not know by its suffix."""
    if path.suffix.lower() not in STORAGES:
        raise RecordingError(f'{path} is no file of a bag: give {", ".join(STORAGES)}')
    if path.suffix not in STORAGES:
        raise RecordingError(f'{path}: rename it to {path.stem}{path.suffix.lower()}')
    return path


def _kind(channel: Channel, schemas: dict[int, Schema]) -> str:
    name = schemas[channel.schema_id].name if channel.schema_id in schemas else ''
    package, _, kind = name.rpartition('/')
    return name if '/' in package or not package else f'{package}/msg/{kind}'


def _decompressed(data: bytes) -> bytes:
    if data[:4] == _ZSTD:
        return zstandard.ZstdDecompressor().decompressobj().decompress(data)
    return data

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS 2 bags: read MCAP and sqlite3, write MCAP that appears under its name only when whole."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, final

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.typesys import Stores, TypesysError, get_typestore

from peace_ros.core.domain import RecordingError
from peace_ros.recording.storages import (
    STORAGES,
    Storages,
    TopicOfFile,
    files_of,
    is_recording,
)

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
"""Message classes of ROS 2 Jazzy, shared by all readers and writers of the package."""

_ROS1 = get_typestore(Stores.ROS1_NOETIC)


@final
class BagReader:
    """A bag folder, an ``.mcap`` or ``.db3`` file of it, or a ``.bag`` of ROS 1.

    Use it as a context manager; messages come out deserialised, with the attributes of the ROS 2
    message and arrays as numpy arrays.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.exists():
            raise RecordingError(f'bag {path} does not exist: give a bag folder, .mcap or .db3')
        if not is_recording(path):
            raise RecordingError(f'{path} is no bag: give a folder, {", ".join(STORAGES)}')
        files_of(path)
        self._storages: Storages | None = None

    def __enter__(self) -> BagReader:
        """Open the file.

        Raises:
            RecordingError: it is not a bag, is damaged, or is of an unknown kind.
        """
        try:
            self._storages = Storages(self.path)
        except RecordingError:
            raise
        except Exception as error:  # of the readers, their databases and codecs
            raise self._unreadable(error) from error
        return self

    def __exit__(self, *_error: object) -> None:
        """Close the file."""
        storages, self._storages = self._storages, None
        if storages is not None:
            storages.close()

    @property
    def remarks(self) -> list[str]:
        """What the user has to know about the file, such as where it breaks off."""
        return self._opened().remarks

    @property
    def topics(self) -> dict[str, str]:
        """TopicOfFile -> message type (``sensor_msgs/msg/Image``), in alphabetical order."""
        return {each.name: each.type for each in self._topics()}

    def count(self, topic: str) -> int:
        """Return how many messages of a topic the bag holds."""
        return sum(each.messages for each in self._topics() if each.name == topic)

    def require(self, topic: str, types: Collection[str]) -> str:
        """Return the type of a topic that must exist and have one of some types.

        Raises:
            RecordingError: no such topic, or it has another type; lists the topics that would do.
        """
        there = self.topics
        if topic not in there:
            listed = ', '.join(f'{name} ({_short(kind)})' for name, kind in there.items())
            raise RecordingError(
                f'bag {self.path} has no topic {topic}: it has {listed or "no topics at all"}'
            )
        if there[topic] not in types:
            wanted = ' or '.join(sorted(_short(kind) for kind in types))
            raise RecordingError(f'topic {topic} is a {_short(there[topic])}: give a {wanted}')
        return there[topic]

    def find(self, types: Collection[str]) -> list[str]:
        """Return the topics that have one of some message types."""
        return [topic for topic, kind in self.topics.items() if kind in types]

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """Yield (topic, receipt stamp in ns, message) in order of receipt.

        Raises:
            RecordingError: the file ends early or holds bytes that are no such message.
        """
        for topic in topics:
            self.require(topic, tuple(self.topics.values()))
        try:
            for raw in self._opened().messages(topics):
                yield raw.topic.name, raw.stamp_ns, _deserialised(raw.data, raw.topic)
        except RecordingError:
            raise
        except Exception as error:  # of the readers, their databases, codecs and type stores
            raise self._unreadable(error) from error

    def _opened(self) -> Storages:
        if self._storages is None:
            raise RecordingError(f'bag {self.path} is not open: use it in a with statement')
        return self._storages

    def _topics(self) -> list[TopicOfFile]:
        return sorted(self._opened().topics, key=lambda each: each.name)

    def _unreadable(self, error: Exception) -> RecordingError:
        remedy = {
            '.mcap': '"mcap recover" may save a part of it',
            '.bag': '"rosbag reindex" may save a part of it',
        }.get(self.path.suffix.lower(), '"ros2 bag reindex" may repair its metadata')
        return RecordingError(
            f'bag {self.path} cannot be read ({type(error).__name__}: {error}): give an intact '
            f'one; {remedy}'
        )


def _deserialised(data: bytes, topic: TopicOfFile) -> Any:
    if not topic.is_ros1:
        return TYPESTORE.deserialize_cdr(data, topic.type)
    message: Any = _ROS1.deserialize_ros1(data, topic.type)
    if topic.type == 'sensor_msgs/msg/CameraInfo':
        # ROS 1 writes the matrices with capital letters.
        fields = {name.lower(): value for name, value in vars(message).items()}
        return SimpleNamespace(**fields)
    return message


@final
class BagWriter:
    """Write one ``.mcap`` file.

    Everything goes to a hidden folder beside the file, which is renamed into place on a clean
    exit of the context and removed on an error: there is never half a bag under the name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.suffix != '.mcap':
            raise RecordingError(f'bag {path} is written as MCAP: give a name that ends in .mcap')
        if path.exists():
            raise RecordingError(f'bag {path} exists already: give another name or remove it')
        self._folder: Path | None = None
        self._writer: Writer | None = None
        self._connections: dict[str, Connection] = {}
        self.counts: dict[str, int] = {}
        """TopicOfFile -> messages written so far."""

    def __enter__(self) -> BagWriter:
        """Create the hidden folder.

        Raises:
            RecordingError: the place cannot be written to.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = Path(
                tempfile.mkdtemp(prefix=f'.{self.path.stem}-', dir=self.path.parent)
            )
            writer = Writer(
                self._folder / 'bag',
                version=Writer.VERSION_LATEST,
                storage_plugin=StoragePlugin.MCAP,
            )
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            writer.open()
        except (OSError, WriterError) as error:
            self._discard()
            raise self._unwritable(error) from error
        self._writer = writer
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        """Put the file in its place, or remove every trace of it after an error."""
        writer, self._writer = self._writer, None
        try:
            if writer is None or self._folder is None:
                return
            if error_type is not None:
                with suppress(Exception):
                    writer.abort()
                return
            writer.close()
            (self._folder / 'bag' / 'bag.mcap').replace(self.path)
        except (OSError, WriterError) as failure:
            raise self._unwritable(failure) from failure
        finally:
            self._discard()

    def add_topic(self, topic: str, message_type: str, *, latched: bool = False) -> None:
        """Make a topic known, so that it is in the bag even when no message comes.

        Raises:
            RecordingError: the type is not one of ROS 2 Jazzy.
        """
        if topic in self._connections:
            return
        try:
            self._connections[topic] = self._opened().add_connection(
                topic,
                message_type,
                typestore=TYPESTORE,
                offered_qos_profiles=[_qos(latched=latched)],
            )
        except (WriterError, TypesysError, KeyError) as error:
            raise RecordingError(
                f'topic {topic} of type {message_type} cannot be recorded: {error}'
            ) from error
        self.counts[topic] = 0

    def write_raw(self, topic: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Write one message as it came from the wire (CDR), on a topic added before.

        Raises:
            RecordingError: the topic was not added, or the disk refuses.
        """
        if topic not in self._connections:
            raise RecordingError(f'topic {topic} was not added to bag {self.path}: add it first')
        try:
            self._opened().write(self._connections[topic], stamp_ns, cdr)
        except (OSError, WriterError) as error:
            raise self._unwritable(error) from error
        self.counts[topic] += 1

    def write(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Serialise and write one message of :data:`TYPESTORE`; adds the topic at need."""
        self.add_topic(topic, message.__msgtype__)
        self.write_raw(topic, stamp_ns, TYPESTORE.serialize_cdr(message, message.__msgtype__))

    def _opened(self) -> Writer:
        if self._writer is None:
            raise RecordingError(f'bag {self.path} is not open: use it in a with statement')
        return self._writer

    def _discard(self) -> None:
        folder, self._folder = self._folder, None
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def _unwritable(self, error: Exception) -> RecordingError:
        return RecordingError(
            f'bag {self.path} cannot be written ({error}): give a folder that is writable and '
            'has room'
        )


def _short(message_type: str) -> str:
    return message_type.replace('/msg/', '/')


def _qos(*, latched: bool) -> Qos:
    """Return reliable, volatile or latched quality of service, so that players can offer it."""
    unlimited = QosTime(9223372036, 854775807)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=unlimited,
        lifespan=unlimited,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=unlimited,
        avoid_ros_namespace_conventions=False,
    )

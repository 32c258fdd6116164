# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of the recordings: files that can be read, bounds that hold, disks that fail."""

from __future__ import annotations

import errno
import random
import shutil
import string
from collections import namedtuple
from pathlib import Path

import pytest
from mcap.reader import make_reader

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.node_parameters import RecorderParameters
from peace_ros.recorder.flight_file import LIBRARY, TYPESTORE, FlightFile, Note
from peace_ros.recorder.store import RecordingStore
from peace_ros.recording import BagReader
from peace_ros.recording.messages import diagnostic_array

KIND = 'diagnostic_msgs/msg/DiagnosticArray'
SMALL = RecorderParameters(file_mb=1, total_mb=3, least_free_mb=0)
Usage = namedtuple('Usage', 'total used free')  # noqa: PYI024 (as shutil has it)


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def note(number: int, size: int = 10, *, topic: str = '/prompt', latched: bool = False) -> Note:
    # Letters that zstd cannot make smaller by much.
    text = ''.join(random.Random(number).choices(string.printable, k=size))
    message = diagnostic_array(number, 'x', 0, text, [])
    return Note(topic, KIND, number, bytes(TYPESTORE.serialize_cdr(message, KIND)), latched)


def stamps(path: Path, topic: str = '/prompt') -> list[int]:
    with BagReader(path) as bag:
        return [at_ns for _, at_ns, _ in bag.messages([topic])]


def files(folder: Path) -> list[Path]:
    return sorted(folder.glob('*.mcap'), key=lambda each: each.stat().st_mtime_ns)


@pytest.fixture
def said() -> list[str]:
    return []


def test_what_was_flushed_can_be_read_although_the_file_was_never_closed(tmp_path) -> None:
    file = FlightFile(tmp_path / 'a.mcap')
    file.add_metadata('peace_ros', {'version': '1'})
    for number in range(1, 6):
        file.add(note(number))
    file.flush()
    file.add(note(6))
    shutil.copy(tmp_path / 'a.mcap', tmp_path / 'cut.mcap')
    assert stamps(tmp_path / 'cut.mcap') == [1, 2, 3, 4, 5]
    file.close()
    assert stamps(tmp_path / 'a.mcap') == [1, 2, 3, 4, 5, 6]


def test_a_file_says_what_others_need_to_read_it(tmp_path) -> None:
    file = FlightFile(tmp_path / 'a.mcap')
    file.add(note(1))
    file.add(note(2, topic='/tf_static', latched=True))
    file.close()
    with (tmp_path / 'a.mcap').open('rb') as stream:
        reader = make_reader(stream)
        assert (reader.get_header().profile, reader.get_header().library) == ('ros2', LIBRARY)
        found = {c.topic: (s, c) for s, c, _ in reader.iter_messages()}
    schema, channel = found['/prompt']
    assert (schema.name, schema.encoding) == (KIND, 'ros2msg')
    assert b'MSG: diagnostic_msgs/DiagnosticStatus' in schema.data
    assert channel.message_encoding == 'cdr'
    assert 'durability: 1' in found['/tf_static'][1].metadata['offered_qos_profiles']
    assert 'durability: 2' in channel.metadata['offered_qos_profiles']


def test_files_and_folder_stay_within_their_bounds(tmp_path, said) -> None:
    (tmp_path / 'mine.mcap').write_bytes(bytes(5_000_000))
    (tmp_path / '20200101T000000Z.txt').write_text('not ours')
    store = RecordingStore(tmp_path, SMALL, said.append)
    store.describe('peace_ros', {'version': '1'})
    store.add(note(1, topic='/tf_static', latched=True))
    for number in range(2, 60):
        store.add(note(number, 200_000))
        store.flush()
    store.close()
    ours = [each for each in files(tmp_path) if each.name != 'mine.mcap']
    assert len(ours) >= 2
    assert sum(each.stat().st_size for each in ours) <= 3_300_000
    assert all(each.stat().st_size < 1_500_000 for each in ours)
    assert (tmp_path / 'mine.mcap').exists()
    assert (tmp_path / '20200101T000000Z.txt').exists()
    assert stamps(ours[-1])[-1] == 59, 'the newest are kept'
    assert stamps(ours[-1], '/tf_static') == [1], 'each file has what is latched'
    with ours[-1].open('rb') as stream:
        assert [each.name for each in make_reader(stream).iter_metadata()] == ['peace_ros']
    assert said == []


def test_a_disk_that_is_full_is_said_once_and_recording_goes_on_later(
    tmp_path, said, monkeypatch
) -> None:
    clock = Clock()
    store = RecordingStore(tmp_path, SMALL, said.append, clock)
    store.add(note(1))
    store.flush()
    first = store.path

    def full(_file, _note) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(FlightFile, 'add', full)
        for number in range(2, 7):
            store.add(note(number))
            store.flush()
            clock.now_s += 0.1
        assert store.lost == 5
        assert 'No space left' in store.problem
        clock.now_s += 60.0
        store.add(note(7))
    assert len(said) == 1
    assert 'the landing is not affected' in said[0]
    clock.now_s += 60.0
    store.add(note(8))
    store.flush()
    assert store.problem == ''
    assert said[1].startswith('recording goes on in')
    assert said[1].endswith('6 messages were lost')
    store.close()
    assert stamps(first) == [1]
    assert len(files(tmp_path)) == 2, 'tries that wrote nothing leave nothing'
    assert stamps(files(tmp_path)[-1]) == [8]


def test_a_file_that_may_not_grow_loses_what_comes_later_and_nothing_else(tmp_path, said) -> None:
    resource = pytest.importorskip('resource')
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    store = RecordingStore(tmp_path, SMALL, said.append, Clock())
    store.add(note(1))
    store.flush()
    path = store.path
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 1000, hard))
    try:
        store.add(note(2, 100_000))
        store.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert store.path is None
    assert 'File too large' in said[0]
    assert stamps(path) == [1]


def test_nothing_is_recorded_while_the_disk_has_too_little_room(
    tmp_path, said, monkeypatch
) -> None:
    clock = Clock()
    store = RecordingStore(tmp_path, RecorderParameters(least_free_mb=500), said.append, clock)
    store.add(note(1))
    free = {'mb': 400}
    monkeypatch.setattr(
        'peace_ros.recorder.store.shutil.disk_usage',
        lambda _folder: Usage(0, 0, free['mb'] * 1_000_000),
    )
    path = store.path
    store.flush()
    assert store.path is None
    assert stamps(path) == [1], 'the file was finished in order'
    clock.now_s += 60.0
    store.add(note(2))
    assert (store.lost, len(said)) == (1, 1)
    free['mb'] = 600
    clock.now_s += 60.0
    store.add(note(3))
    store.flush()
    assert store.path is not None
    assert store.problem == ''


def test_a_folder_that_cannot_be_made_is_said(tmp_path, said) -> None:
    (tmp_path / 'file').write_text('in the way')
    store = RecordingStore(tmp_path / 'file' / 'recordings', SMALL, said.append)
    store.add(note(1))
    store.flush()
    store.close()
    assert 'Not a directory' in said[0]
    assert store.lost == 1


def test_bounds_in_which_no_file_has_room_are_refused() -> None:
    with pytest.raises(ConfigurationError, match='at least twice file_mb'):
        RecorderParameters(file_mb=100, total_mb=150)


def test_a_folder_that_goes_away_stops_the_recording_until_it_can_be_made_again(
    tmp_path, said
) -> None:
    clock, folder = Clock(), tmp_path / 'stick'
    store = RecordingStore(folder, SMALL, said.append, clock)
    store.add(note(1))
    store.flush()
    shutil.rmtree(folder)
    store.flush()
    assert 'stick' in store.problem
    clock.now_s = 11.0
    store.add(note(2))
    store.flush()
    assert store.problem == ''
    store.close()
    assert [stamps(each) for each in files(folder)] == [[2]]

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Embeddings outlive the process; damaged files never reach the network."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.inference.text_cache import TextCache

CHECKSUM = 'ab' * 32
VALUE = np.arange(4, dtype=np.float32)


def cache_file(folder: Path) -> Path:
    (path,) = folder.rglob('*.npz')
    return path


def test_what_was_put_is_got(tmp_path: Path) -> None:
    for folder in (None, tmp_path):
        cache = TextCache(CHECKSUM, 4, folder)
        assert cache.get('grass') is None
        cache.put('grass', VALUE)
        np.testing.assert_array_equal(cache.get('grass'), VALUE)


def test_the_next_process_reads_the_disk(tmp_path: Path) -> None:
    TextCache(CHECKSUM, 4, tmp_path).put('grass', VALUE)
    np.testing.assert_array_equal(TextCache(CHECKSUM, 4, tmp_path).get('grass'), VALUE)
    assert not list(tmp_path.rglob('*.part'))


def test_another_bundle_finds_nothing(tmp_path: Path) -> None:
    TextCache(CHECKSUM, 4, tmp_path).put('grass', VALUE)
    assert TextCache('cd' * 32, 4, tmp_path).get('grass') is None


def test_without_a_folder_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    TextCache(CHECKSUM, 4).put('grass', VALUE)
    assert not list(tmp_path.iterdir())


def test_a_damaged_file_is_ignored_and_rewritten(tmp_path: Path) -> None:
    TextCache(CHECKSUM, 4, tmp_path).put('grass', VALUE)
    path = cache_file(tmp_path)
    whole = path.read_bytes()
    for damaged in (b'', whole[:10], whole[:-30], b'\x00' * len(whole)):
        path.write_bytes(damaged)
        cache = TextCache(CHECKSUM, 4, tmp_path)
        assert cache.get('grass') is None
        cache.put('grass', VALUE)
        np.testing.assert_array_equal(TextCache(CHECKSUM, 4, tmp_path).get('grass'), VALUE)


def test_no_flipped_bit_changes_an_embedding(tmp_path: Path) -> None:
    TextCache(CHECKSUM, 4, tmp_path).put('grass', VALUE)
    path = cache_file(tmp_path)
    whole = path.read_bytes()
    for position in range(len(whole)):
        damaged = bytearray(whole)
        damaged[position] ^= 0x10
        path.write_bytes(damaged)
        got = TextCache(CHECKSUM, 4, tmp_path).get('grass')
        assert got is None or np.array_equal(got, VALUE), position


def test_a_file_of_another_width_or_text_is_ignored(tmp_path: Path) -> None:
    cache = TextCache(CHECKSUM, 4, tmp_path)
    cache.put('grass', VALUE)
    path = cache_file(tmp_path)
    assert TextCache(CHECKSUM, 5, tmp_path).get('grass') is None
    np.savez(path, embedding=VALUE, text=np.array('water'))
    assert TextCache(CHECKSUM, 4, tmp_path).get('grass') is None
    np.savez(path, embedding=VALUE * np.nan, text=np.array('grass'))
    assert TextCache(CHECKSUM, 4, tmp_path).get('grass') is None


def test_a_folder_that_cannot_be_written_is_reported_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    blocked = tmp_path / 'file'
    blocked.write_text('in the way')
    cache = TextCache(CHECKSUM, 4, blocked)
    with caplog.at_level(logging.WARNING):
        cache.put('grass', VALUE)
        cache.put('lawn', VALUE)
    assert [record.getMessage().count('cannot be written') for record in caplog.records] == [1]
    np.testing.assert_array_equal(cache.get('lawn'), VALUE)


def test_memory_is_bounded() -> None:
    cache = TextCache(CHECKSUM, 4, most_in_memory=2)
    for text in ('a', 'b'):
        cache.put(text, VALUE)
    assert cache.get('a') is not None
    cache.put('c', VALUE)
    assert cache.get('b') is None
    assert cache.get('a') is not None


def test_what_is_got_cannot_be_changed() -> None:
    cache = TextCache(CHECKSUM, 4)
    cache.put('grass', VALUE)
    with pytest.raises(ValueError, match='read-only'):
        cache.get('grass')[0] = 9.0

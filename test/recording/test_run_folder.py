# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Results never land on those of another run."""

from __future__ import annotations

from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError, RecordingError
from peace_ros.recording.run_folder import create_run_folder, write_whole


def test_a_chosen_folder_may_be_new_or_empty(tmp_path) -> None:
    for _ in range(2):
        assert create_run_folder(tmp_path / 'a' / 'b', 'name', '--out') == tmp_path / 'a' / 'b'
    assert (tmp_path / 'a' / 'b').is_dir()


def test_a_chosen_folder_with_results_is_refused(tmp_path) -> None:
    (tmp_path / 'summary.json').write_text('{}')
    with pytest.raises(ConfigurationError, match=r'not empty: give another --out'):
        create_run_folder(tmp_path, 'name', '--out')
    with pytest.raises(ConfigurationError, match=r'cannot be used .* give --out DIR'):
        create_run_folder(tmp_path / 'summary.json', 'name', '--out')


def test_without_a_choice_every_run_gets_a_folder_of_its_own(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = [create_run_folder(None, 'v1.2', '--out').name for _ in range(3)]
    assert names == ['v1.2', 'v1.2_2', 'v1.2_3']


def test_a_place_without_room_for_runs_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('runs').write_text('no folder')
    with pytest.raises(ConfigurationError, match=r'runs/name cannot be used'):
        create_run_folder(None, 'name', '--out')


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch) -> None:
    write_whole(tmp_path / 'new' / 'a.json', 'old', 'figures')

    def full(path: Path, _content: bytes) -> None:
        path.touch()
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(Path, 'write_bytes', full)
    with pytest.raises(RecordingError, match=r'figures .*a\.json cannot be written .*No space'):
        write_whole(tmp_path / 'new' / 'a.json', 'new', 'figures')
    assert (tmp_path / 'new' / 'a.json').read_text() == 'old'
    assert [each.name for each in (tmp_path / 'new').iterdir()] == ['a.json']

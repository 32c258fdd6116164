# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Damaged files are used or refused; the command finds those that are neither."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.lab.damage import run
from peace_ros.lab.damage.mutations import damaged
from peace_ros.recording import BagWriter
from peace_ros.recording.messages import jpeg_message, pose_stamped

PICTURE = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)


@pytest.fixture
def files(tmp_path) -> list[Path]:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        for k in range(1, 4):
            stamp_ns = k * 500_000_000
            bag.write('/pose', stamp_ns, pose_stamped(stamp_ns, (0, 0, 50), (1.0, 0.0, 0.0, 0.0)))
            bag.write('/image', stamp_ns, jpeg_message(PICTURE, stamp_ns))
    cv2.imwrite(str(tmp_path / 'a.png'), PICTURE)
    cv2.imwrite(str(tmp_path / 'a.jpg'), PICTURE)
    (tmp_path / 'a.yaml').write_text('landing:\n  ros__parameters: {safety_threshold: 0.7}\n')
    (tmp_path / 'a.csv').write_text('image,label\na.jpg,a.png\n')
    return sorted(tmp_path.iterdir())


def test_the_same_seed_damages_alike_and_another_differently() -> None:
    content = bytes(range(256)) * 4
    first, again, other = (
        [damaged(content, np.random.default_rng([seed, k])) for k in range(40)]
        for seed in (1, 1, 2)
    )
    assert first == again != other
    assert len({name for name, _ in first}) == 6
    assert sum(data != content for _, data in first) > 30
    assert damaged(b'', np.random.default_rng(1))[1] == b''


def test_damaged_files_are_used_or_refused(files) -> None:
    found = list(run.read_damaged(files, 25, seed=5))
    assert [each for each in found if each.result not in run.GOOD] == []
    assert {each.result for each in found} == set(run.GOOD)


def test_what_is_neither_is_told_with_its_number(tmp_path, monkeypatch) -> None:
    def read(path: Path, out: Path) -> None:
        if path.name == 'half':
            out.mkdir()
            (out / '.a.partial').write_text('')
            raise RecordingError('no')
        raise ZeroDivisionError(path.name)

    monkeypatch.setitem(run.READERS, '', read)
    for name, result in (('other', 'traceback'), ('half', 'half-written')):
        found, detail = run._read(tmp_path / name, tmp_path / f'{name}_out')
        assert found == result
        assert ('ZeroDivisionError: other' if name == 'other' else '.a.partial') in detail


def test_a_file_of_an_unknown_kind_is_refused(tmp_path, capsys) -> None:
    (tmp_path / 'a.txt').write_text('')
    assert run.main([str(tmp_path / 'a.txt')]) == 2
    assert 'a.txt: give a file of' in capsys.readouterr().err

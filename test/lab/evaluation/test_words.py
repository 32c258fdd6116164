# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace words``: figures of the ranking of condition words."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from peace_ros.cli.main import app
from peace_ros.core.domain import ConfigurationError, Frame
from peace_ros.lab.evaluation.words import CONDITIONS, load_frames, measure
from peace_ros.simulation.drawing import draw_scene
from peace_ros.simulation.picture_files import RasterError


class _Reader:
    """Tells night by its darkness and takes all else for clear."""

    def text_embeddings(self, texts: list[str]) -> np.ndarray:
        return np.eye(len(texts), dtype=np.float32)

    def image_embedding(self, frame: Frame) -> np.ndarray:
        out = np.zeros(len(CONDITIONS), dtype=np.float32)
        dark = frame.image_rgb.mean() < 50
        out[list(CONDITIONS).index('night' if dark else 'clear')] = 1.0
        return out


def test_a_word_counts_when_it_comes_first_under_its_own_condition() -> None:
    images = [draw_scene(seed, 64, 0.3).image_rgb for seed in range(3)]
    figures = measure(images, _Reader())  # type: ignore[arg-type]
    assert figures.right_by_word['night'] == 1.0
    assert figures.right_by_word['fog'] == 0.0
    assert figures.right == pytest.approx(0.2)
    assert figures.counts.sum() == 3 * len(CONDITIONS)


def test_the_same_seed_gives_the_same_figures() -> None:
    images = [draw_scene(1, 64, 0.3).image_rgb]
    first, second = (measure(images, _Reader(), seed=4) for _ in range(2))  # type: ignore[arg-type]
    np.testing.assert_array_equal(first.counts, second.counts)


def test_the_command_prints_and_writes_what_it_measured(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / 'a.png'), draw_scene(2, 400, 0.2).image_rgb[:, :300])
    file = tmp_path / 'words.json'
    result = CliRunner().invoke(app, ['words', str(tmp_path), '--json', str(file)])
    assert result.exit_code == 0, result.output
    written = json.loads(file.read_text())
    assert written['frames'] == len(CONDITIONS)
    assert set(written['right_by_word']) == set(CONDITIONS)
    assert 'right word first' in result.output


def test_a_folder_without_images_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match='no image'):
        load_frames(tmp_path)


def test_an_unreadable_image_is_named(tmp_path: Path) -> None:
    (tmp_path / 'broken.jpg').write_bytes(b'no image')
    with pytest.raises(RasterError, match=r'broken\.jpg'):
        load_frames(tmp_path)

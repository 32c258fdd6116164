# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Views of photographs that training leaves out, in the layout that `peace evaluate` reads."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip('torch')

from peace_ros.core.domain import Label, WorldError
from peace_ros.lab.training import held_out, sources
from peace_ros.lab.training.annotations import load_annotations


def test_what_is_kept_for_validation_is_written_and_never_a_source(tmp_path: Path) -> None:
    kept = [each.name for each in load_annotations() if each.is_validation]
    assert kept
    (tmp_path / 'ortho').mkdir()
    for name in kept:
        cv2.imwrite(str(tmp_path / 'ortho' / f'{name}.jpg'), np.zeros((1408, 2000, 3), np.uint8))
    assert sources.load_drone(tmp_path) == []
    assert held_out.write_held_out(tmp_path, tmp_path / 'out') == len(kept)
    for name in kept:
        image = cv2.imread(str(tmp_path / 'out' / 'images' / f'{name}.png'))
        labels = cv2.imread(str(tmp_path / 'out' / 'labels' / f'{name}.png'), cv2.IMREAD_GRAYSCALE)
        assert image.shape == (704, 1000, 3)
        assert labels.shape == (704, 1000)
        seen = set(np.unique(labels).tolist())
        assert seen <= set(Label)
        assert seen & {Label.GRASS, Label.BARE_GROUND}


def test_a_folder_without_them_says_where_to_get_them(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match='config/annotations say where to get them'):
        held_out.write_held_out(tmp_path, tmp_path / 'out')

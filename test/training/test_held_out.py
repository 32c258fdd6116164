# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Views of photographs that training leaves out, in the layout that `peace evaluate` reads."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip('torch')

from peace_ros.domain import Label, WorldError
from peace_ros.training import held_out, sources
from peace_ros.training.annotations import load_annotations


def test_what_is_kept_for_validation_becomes_views_and_never_a_source(tmp_path: Path) -> None:
    kept = [each.name for each in load_annotations() if each.is_validation]
    assert kept
    (tmp_path / 'ortho').mkdir()
    for name in kept:
        cv2.imwrite(str(tmp_path / 'ortho' / f'{name}.jpg'), np.zeros((600, 900, 3), np.uint8))
    assert sources.load_drone(tmp_path) == []
    # One of 600 px and six of 300 px each.
    assert held_out.write_views(tmp_path, tmp_path / 'out') == 7 * len(kept)
    for name in kept:
        paths = sorted((tmp_path / 'out' / 'labels').glob(f'{name}_*.png'))
        labels = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]
        assert {each.shape for each in labels} == {(512, 512), (300, 300)}
        seen = set(np.unique(np.concatenate([each.ravel() for each in labels])).tolist())
        assert seen <= set(Label)
        assert seen & {Label.GRASS, Label.BARE_GROUND}


def test_a_folder_without_them_says_where_to_get_them(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match='config/annotations say where to get them'):
        held_out.write_views(tmp_path, tmp_path / 'out')

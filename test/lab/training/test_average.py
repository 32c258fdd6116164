# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means of two bundles of one training line."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('onnx')

from peace_ros.core.domain import ConfigurationError, Frame  # noqa: E402
from peace_ros.core.inference import Bundle  # noqa: E402
from peace_ros.core.resources import models_dir  # noqa: E402
from peace_ros.lab.training import export  # noqa: E402
from peace_ros.lab.training.average import average  # noqa: E402
from peace_ros.lab.training.measure import PROMPT, open_segmenter  # noqa: E402
from peace_ros.lab.training.segmenter import create_segmenter  # noqa: E402


@pytest.fixture(scope='module')
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folders = []
    for seed in (0, 1):
        folder = tmp_path_factory.mktemp(f'seed{seed}') / 'clipseg-small'
        model = create_segmenter(seed).eval()
        export.export_segmenter(
            model, folder, provenance=f'Seed {seed}.', recommended={'threshold': 0.5}
        )
        folders.append(folder)
    return folders[0], folders[1]


def _safety(bundle: Path, image: np.ndarray) -> np.ndarray:
    segmenter = open_segmenter(bundle, 'peace_cs', threads=1)
    return segmenter.segment(Frame(image, 0), PROMPT).safety


def test_the_ends_are_the_bundles_and_the_middle_is_neither(
    two: tuple[Path, Path], tmp_path: Path
) -> None:
    image = np.random.default_rng(0).integers(0, 255, (352, 352, 3)).astype(np.uint8)
    heatmaps = {}
    for share in (0.0, 0.5, 1.0):
        average(*two, tmp_path / f'{share}', share)
        heatmaps[share] = _safety(tmp_path / f'{share}', image)
    for share, folder in zip((0.0, 1.0), two, strict=True):
        given = _safety(folder, image)
        assert np.abs(heatmaps[share] - given).max() < 1e-5
        assert np.abs(heatmaps[share] - heatmaps[0.5]).max() > 1e-3


def test_the_bundle_is_whole_says_what_it_is_and_recommends_nothing_old(
    two: tuple[Path, Path], tmp_path: Path
) -> None:
    average(*two, tmp_path / 'mean', 0.9)
    manifest = Bundle.load(tmp_path / 'mean').manifest
    assert 'Seed 1.' in manifest.provenance
    assert '0.9 of these weights and 0.1 of those it went on from' in manifest.provenance
    assert 'threshold' not in manifest.recommended


def test_bundles_of_other_architectures_and_shares_beyond_one_are_refused(
    two: tuple[Path, Path], tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match='not bundles of one family'):
        average(models_dir() / 'clip-small', two[0], tmp_path / 'out', 0.5)
    with pytest.raises(ConfigurationError, match=r'--share 1\.5'):
        average(*two, tmp_path / 'out', 1.5)
    assert not (tmp_path / 'out').exists()

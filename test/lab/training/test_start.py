# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A training that goes on from a bundle begins where the bundle is."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('onnx')

from peace_ros.core.domain import BundleError, ConfigurationError, Frame  # noqa: E402
from peace_ros.core.inference import Bundle  # noqa: E402
from peace_ros.core.resources import models_dir  # noqa: E402
from peace_ros.lab.export.staging import change_manifest  # noqa: E402
from peace_ros.lab.training import recipe  # noqa: E402
from peace_ros.lab.training.export import export_segmenter  # noqa: E402
from peace_ros.lab.training.measure import PROMPT, open_segmenter  # noqa: E402
from peace_ros.lab.training.segmenter import create_segmenter  # noqa: E402
from peace_ros.lab.training.start import start_from  # noqa: E402


def _pixels(seed: int = 0) -> torch.Tensor:
    return torch.randn(2, 3, 128, 128, generator=torch.Generator().manual_seed(seed))


def _shipped() -> Path:
    return models_dir() / 'clipseg-small'


def _uncalibrated(bundle: Path, folder: Path) -> Path:
    """Copy a bundle without its recommended threshold, so that the network's own score shows."""
    copied = folder / f'plain-{bundle.name}'
    shutil.copytree(bundle, copied)
    change_manifest(copied, recommended={})
    return copied


def test_it_computes_what_the_bundle_computes(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    model = create_segmenter(3)
    start_from(model, _shipped(), [_pixels()])
    export_segmenter(model.eval(), tmp_path / 'again', provenance='test')
    image = np.random.default_rng(0).integers(0, 255, (352, 352, 3)).astype(np.uint8)
    given, got = (
        open_segmenter(_uncalibrated(each, tmp_path), 'peace_cs', threads=1)
        .segment(Frame(image, 0), PROMPT)
        .safety
        for each in (_shipped(), tmp_path / 'again')
    )
    assert given.std() > 0.001
    np.testing.assert_allclose(got, given, atol=2e-3)


def test_its_norms_expect_what_they_will_see() -> None:
    torch.set_num_threads(1)
    model = create_segmenter(3)
    start_from(model, _shipped(), [_pixels(0), _pixels(1)])
    with torch.no_grad():
        calm = model.encoder.eval()(_pixels())
        learning = model.encoder.train()(_pixels())
    # Other statistics than the stored ones would throw the features far off.
    assert (calm - learning).abs().mean() < 0.25 * calm.abs().mean()


def test_the_bundle_says_what_it_went_on_from(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    shipped = Bundle.load(_shipped()).manifest.provenance
    recipe.Recipe(
        out=tmp_path / 'models', work=tmp_path / 'work', steps=1, scenes=2, seed=3,
        validation_scenes=1, batch_size=2, view_px=64, scene_px=256, start=_shipped(),
        with_ranker=False,
    ).run(lambda *_: None)  # fmt: skip
    told = Bundle.load(tmp_path / 'models/clipseg-small').manifest.provenance
    assert told.startswith(f'{shipped} From there, the segmenter (')
    assert 'seed 3, 1 steps' in told
    assert not (tmp_path / 'models/clip-small').exists()


def test_a_bundle_of_another_kind_or_other_words_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match='its words are not the'):
        start_from(create_segmenter(0), _with_word(tmp_path / 'other'), [_pixels()])
    with pytest.raises(ConfigurationError, match='not a segmenter of this architecture'):
        start_from(create_segmenter(0), models_dir() / 'clip-small', [_pixels()])
    with pytest.raises(BundleError):
        start_from(create_segmenter(0), tmp_path / 'nothing', [_pixels()])


def _with_word(folder: Path) -> Path:
    export_segmenter(create_segmenter(0).eval(), folder, provenance='test')
    path = folder / 'tokenizer.json'
    tokenizer = json.loads(path.read_text())
    words = tokenizer['model']['vocab']
    words['zeppelin'] = len(words)
    _replace(folder, path, json.dumps(tokenizer))
    return folder


def _replace(folder: Path, path: Path, text: str) -> None:
    from hashlib import sha256

    path.write_text(text)
    manifest = json.loads((folder / 'manifest.json').read_text())
    content = path.read_bytes()
    manifest['files'][path.name] = {
        'sha256': sha256(content).hexdigest(),
        'bytes': len(content),
    }
    (folder / 'manifest.json').write_text(json.dumps(manifest))

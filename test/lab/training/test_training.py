# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The whole recipe in miniature: a few steps, two bundles, and ONNX that says what torch says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('onnx')

from peace_ros.core.domain import ConfigurationError, Label  # noqa: E402
from peace_ros.core.inference import Bundle, Session, open_sessions  # noqa: E402
from peace_ros.lab.training import annotations, batches, export, losses, recipe, sources  # noqa: E402
from peace_ros.lab.training.loop import TimeBudget, learning_rate  # noqa: E402
from peace_ros.lab.training.ranker import create_ranker  # noqa: E402
from peace_ros.lab.training.segmenter import create_segmenter  # noqa: E402

TEXTS = ['grass', 'A rendered image of road in night.', 'zzz, water']


@pytest.fixture(scope='module')
def tiny(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[str, float]]]:
    folder = tmp_path_factory.mktemp('training')
    stages: list[tuple[str, float]] = []
    torch.set_num_threads(1)
    tiny = recipe.Recipe(
        out=folder / 'models', work=folder / 'work', steps=3, scenes=3, validation_scenes=1,
        batch_size=2, view_px=64, scene_px=256, text_steps=3,
    )  # fmt: skip
    tiny.run(lambda stage, share, line: stages.append((stage, share)))
    return folder, stages


def _tokens() -> tuple[Any, Any]:
    return batches.encode(TEXTS)


def test_the_recipe_writes_two_bundles_that_the_runtime_accepts(
    tiny: tuple[Path, list[tuple[str, float]]],
) -> None:
    folder, stages = tiny
    for name, roles in (
        ('clip-small', ('image_encoder', 'text_encoder')),
        ('clipseg-small', ('image_encoder', 'text_encoder', 'decoder')),
    ):
        bundle = Bundle.load(folder / 'models' / name)
        assert set(open_sessions(bundle, roles, threads=1)) == set(roles)
        assert 'seed 0' in bundle.manifest.provenance
    assert {stage for stage, _ in stages} == {'scenes', 'text', 'segmenter', 'ranker', 'threshold'}
    assert (
        0.0 < Bundle.load(folder / 'models/clipseg-small').manifest.recommended['threshold'] < 1.0
    )


def test_curves_are_kept_and_a_finished_run_continues_without_another_step(
    tiny: tuple[Path, list[tuple[str, float]]],
) -> None:
    folder, _ = tiny
    before = torch.load(folder / 'work/segmenter.pt', weights_only=True)
    assert before['step'] == 3
    assert (folder / 'work/segmenter.csv').read_text().startswith('step,elapsed_s,class,prompt')


def test_onnx_says_what_torch_says(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    model = create_segmenter(1).eval()
    model.to(memory_format=torch.contiguous_format)
    export.export_segmenter(model, tmp_path / 'clipseg-small', provenance='test', halve=False)
    bundle = Bundle.load(tmp_path / 'clipseg-small')
    sessions = open_sessions(bundle, ('image_encoder', 'text_encoder', 'decoder'), threads=1)
    pixels = torch.randn(1, 3, 352, 352, generator=torch.Generator().manual_seed(0))
    ids, mask = _tokens()
    side = torch.tensor([1.0, 0.0, 0.0])
    with torch.no_grad():
        features, embedding = model.encoder(pixels), model.text(ids, mask)
        wanted = export.DecoderGraph(model.decoder)(features, embedding, side)
    (got_features,) = sessions['image_encoder'].run(['features'], {'pixel_values': pixels.numpy()})
    (got_embedding,) = sessions['text_encoder'].run(
        ['text_embedding'], {'input_ids': ids.numpy(), 'attention_mask': mask.numpy()}
    )
    np.testing.assert_allclose(got_features, features.numpy(), atol=1e-4, rtol=1e-4)
    np.testing.assert_allclose(got_embedding, embedding.numpy(), atol=1e-4)
    got = sessions['decoder'].run(
        ['positive', 'negative', 'softmax_positive', 'term_logits'],
        {'features': got_features, 'text_embedding': got_embedding, 'is_positive': side.numpy()},
    )
    for mine, theirs in zip(got, wanted, strict=True):
        np.testing.assert_allclose(mine, theirs.numpy(), atol=1e-3)
    assert [each.shape for each in got] == [(352, 352)] * 3 + [(3, 352, 352)]


def test_the_ranker_in_onnx_says_what_torch_says_also_with_halved_weights(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    model = create_ranker(1).eval()
    pixels = torch.randn(1, 3, 224, 224, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        wanted = model.image(pixels).numpy()
    for halve, tolerance in ((False, 1e-4), (True, 1e-2)):
        folder = tmp_path / f'clip-{halve}'
        export.export_ranker(model, folder, provenance='test', halve=halve)
        session = Session(folder / 'image_encoder.onnx', threads=1)
        (got,) = session.run(['image_embedding'], {'pixel_values': pixels.numpy()})
        np.testing.assert_allclose(got, wanted, atol=tolerance)


def test_a_side_without_terms_scores_zero() -> None:
    graph = export.DecoderGraph(create_segmenter(0).decoder)
    features, embedding = torch.rand(1, 48, 4, 4), torch.randn(2, 64)
    positive, negative, softmax, _ = graph(features, embedding, torch.zeros(2))
    assert positive.max() == 0.0
    assert softmax.max() == 0.0
    assert negative.min() > 0.0


def test_pixels_known_in_part_punish_only_what_they_exclude() -> None:
    table, weights = batches.pixel_class_table(), losses.class_weights()
    share = losses.shares(torch.full((1, 4, 4), annotations.VEGETATION))
    zero = torch.zeros(1, 1, 1, 1)

    def loss(*labels: Label) -> float:
        wanted = torch.zeros(1, 1, 9)
        for label in labels:
            wanted[0, 0, label - 1] = 1.0
        return float(losses.prompt_loss(zero + 3.0, share, wanted, table, weights))

    assert loss(Label.GRASS) == 0.0
    assert loss(Label.WATER) > 1.0
    assert loss(Label.GRASS, Label.TREE) < 0.2


def test_calling_a_hazard_safe_costs_more_than_missing_safe_ground() -> None:
    table, weights = batches.pixel_class_table(), losses.class_weights()
    logits = torch.tensor([[[[2.0, 0.0]]]])
    classes = torch.tensor([[Label.WATER, Label.GRASS]]).repeat_interleave(4, 1)
    share = losses.shares(classes.repeat(4, 1)[None])
    wanted = torch.zeros(1, 1, 9)
    wanted[0, 0, Label.GRASS - 1] = 1.0
    false_safe = losses.prompt_loss(logits, share, wanted, table, weights)
    missed = losses.prompt_loss(-logits.flip(3), share, wanted, table, weights)
    assert false_safe > missed


def test_annotated_images_have_safe_ground_or_hazards_and_together_every_class() -> None:
    allowed = {'MIT', 'BSD-2-Clause', 'Apache-2.0', 'CC0-1.0', 'CC-BY-3.0', 'CC-BY-4.0'}
    together: set[int] = set()
    for annotation in annotations.load_annotations():
        kinds = set(np.unique(annotations.rasterise(annotation, 320, 240)).tolist())
        assert kinds - {Label.UNLABELED}, annotation.name
        assert annotation.origin
        assert annotation.licence in allowed
        together |= kinds
    assert set(Label) <= together


def test_the_learning_rate_rises_then_falls_and_budgets_end() -> None:
    rates = [learning_rate(1.0, share) for share in (0.0, 0.02, 0.5, 1.0)]
    assert rates[0] < rates[1] > rates[2] > rates[3] > 0.0
    assert TimeBudget(10.0, steps=4).progress(4, 0.0) == 1.0
    assert TimeBudget(1.0).progress(99999, 30.0) == 0.5


def test_people_weigh_more_than_what_they_hide_and_reach_a_cell_farther() -> None:
    logits = torch.zeros(1, 9, 5, 5)
    logits[0, Label.GRASS - 1] = 1.0
    logits[0, Label.PERSON - 1] = -4.0
    logits[0, Label.PERSON - 1, 2, 2] = 0.5
    chosen = export.widen_people(logits).argmax(dim=1)[0] + 1
    assert (chosen[1:4, 1:4] == Label.PERSON).all()
    assert (chosen == Label.PERSON).sum() == 9
    assert (chosen[0] == Label.GRASS).all()


def test_only_annotated_photographs_that_are_there_are_trained_on(tmp_path: Path) -> None:
    folder = tmp_path / 'ortho'
    folder.mkdir()
    picture = np.full((600, 800, 3), 90, np.uint8)
    for name in ('caliterra_9413', 'of_nobody'):
        cv2.imwrite(str(folder / f'{name}.jpg'), picture)
    (source,) = sources.load_drone(tmp_path)
    assert source.name == 'caliterra_9413'
    assert source.origin == 'odm_data_caliterra, Dennis Baldwin (CC0-1.0)'
    assert set(np.unique(source.classes[0])) > {Label.GRASS, Label.BARE_GROUND}


def test_an_annotation_that_cannot_be_read_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / 'annotations'
    folder.mkdir()
    monkeypatch.setattr(annotations, 'config_dir', lambda: tmp_path)
    good = 'origin: a\nlicence: CC0-1.0\ngsd_m: 0.1\nframe_px: [200, 400]\npolygons: |\n  '
    (folder / 'place.yaml').write_text(good + 'grass 0,0 9,0 9,9\n')
    (read,) = annotations.load_annotations()
    assert annotations.rasterise(read, 100, 100)[2, 5] == Label.GRASS
    for polygon in ('grass 0,0 9,0', 'moss 0,0 9,0 9,9', 'grass 0,0 9,zero 9,9'):
        (folder / 'place.yaml').write_text(good + polygon + '\n')
        with pytest.raises(ConfigurationError, match=r'place\.yaml: not an annotation'):
            annotations.load_annotations()

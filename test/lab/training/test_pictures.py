# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the networks are shown: degradations, borrowed materials, pasted things."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('torch')

from peace_ros.core.domain import Label
from peace_ros.lab.training import pasting
from peace_ros.lab.training.batches import BatchMaker
from peace_ros.lab.training.degradations import WAYS, degrade
from peace_ros.lab.training.sources import TrainingSource, build_source
from peace_ros.lab.training.textures import cover, gather_materials, match_look, tint
from peace_ros.simulation.drawing import draw_scene

SUN = np.array([0.5, 0.5])


def _source(kind: str, colour: tuple[int, int, int], label: Label) -> TrainingSource:
    noise = np.random.default_rng(0).integers(-20, 20, (300, 300, 1))
    image = np.clip(np.array(colour) + noise, 0, 255).astype(np.uint8)
    classes = np.full((300, 300), label, dtype=np.uint8)
    return build_source('a', kind, image, classes, 0.1, (100.0, 250.0))


@pytest.mark.parametrize('name', sorted(WAYS))
def test_every_way_of_a_condition_changes_the_image_and_keeps_its_form(name: str) -> None:
    image = draw_scene(3, 128, 0.2).image_rgb
    seen = set()
    for seed in range(12):
        changed = degrade(image, name, np.random.default_rng(seed))
        assert changed.shape == image.shape
        assert changed.dtype == np.uint8
        assert (changed != image).any()
        seen.add(changed.tobytes())
    assert len(seen) >= 3


def test_the_same_seed_degrades_in_the_same_way() -> None:
    image = draw_scene(3, 128, 0.2).image_rgb
    first, second = (degrade(image, 'rainy', np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_drawn_ground_takes_the_texture_of_real_ground_of_the_same_label() -> None:
    materials = gather_materials(
        [_source('drone', (200, 40, 40), Label.GRASS)], np.random.default_rng(0)
    )
    assert set(materials.textures) == {Label.GRASS}
    image = np.full((64, 64, 3), (40, 200, 40), dtype=np.uint8)
    classes = np.full((64, 64), Label.GRASS, dtype=np.uint8)
    classes[:, 32:] = Label.BUILDING
    rng = np.random.default_rng(1)
    reddest = max((cover(image, classes, rng, materials) for _ in range(8)), key=_redness)
    assert reddest[:, :32, 0].mean() > reddest[:, :32, 1].mean()
    np.testing.assert_array_equal(reddest[:, 32:], image[:, 32:])


def _redness(image: np.ndarray) -> float:
    return float(image[..., 0].mean() - image[..., 1].mean())


def test_a_look_moves_brightness_towards_that_of_a_real_image() -> None:
    materials = gather_materials(
        [_source('drone', (230, 230, 230), Label.PAVED)], np.random.default_rng(0)
    )
    dark = np.random.default_rng(2).integers(20, 60, (64, 64, 3)).astype(np.uint8)
    assert match_look(dark, np.random.default_rng(3), materials).mean() > dark.mean() + 5


def test_drawn_sources_lend_nothing() -> None:
    materials = gather_materials(
        [_source('drawn', (1, 2, 3), Label.GRASS)], np.random.default_rng(0)
    )
    assert not materials.textures
    assert not materials.looks


@pytest.mark.parametrize('paste', [pasting.paste_person, pasting.paste_standing_person])
def test_pasted_people_are_labelled_and_seen(paste: object) -> None:
    image = np.full((128, 128, 3), 128, dtype=np.uint8)
    classes = np.full((128, 128), Label.GRASS, dtype=np.uint8)
    for seed in range(5):
        paste(image, classes, np.random.default_rng(seed), 0.05, SUN)  # type: ignore[operator]
    people = classes == Label.PERSON
    assert 20 < people.sum() < 4000
    assert (image[people] != 128).any(axis=1).mean() > 0.5


def test_people_are_widened_in_what_training_asks_for() -> None:
    source = _source('drone', (100, 120, 90), Label.GRASS)
    source.classes[0][150, 150] = Label.PERSON
    maker = BatchMaker([source], {'drone': 1.0}, 0, batch_size=8, view_px=192, prompts=0)
    for batch in (maker.make(number) for number in range(4)):
        for view, wanted in zip(batch.views, batch.classes.numpy(), strict=True):
            people = view.classes == Label.PERSON
            assert (wanted[people] == Label.PERSON).all()
            if people.any():
                assert (wanted == Label.PERSON).sum() > people.sum()


def test_labels_of_a_drawn_view_take_other_tones_each_by_itself() -> None:
    image = np.full((40, 40, 3), 120, dtype=np.uint8)
    classes = np.full((40, 40), Label.PAVED, dtype=np.uint8)
    classes[20:] = Label.PERSON
    tones = [tint(image, classes, np.random.default_rng(seed)) for seed in range(20)]
    assert all((each[20:] == 120).all() for each in tones)
    changed = {tuple(each[0, 0].tolist()) for each in tones}
    assert len(changed) > 4
    assert (120, 120, 120) in changed


def test_a_pasted_court_is_paved_smooth_and_lined() -> None:
    image = np.full((160, 160, 3), 128, dtype=np.uint8)
    classes = np.full((160, 160), Label.GRASS, dtype=np.uint8)
    pasting.paste_court(image, classes, np.random.default_rng(2), 0.15)
    court = classes == Label.PAVED
    assert 0.02 < court.mean() < 0.9
    assert set(np.unique(classes)) == {Label.GRASS, Label.PAVED}
    assert (image[~court] == 128).all(axis=1).mean() > 0.98
    bright = image[court].min(axis=1) > 190
    assert 0.01 < bright.mean() < 0.4


def test_some_pasted_waters_look_like_the_lawn_around_them() -> None:
    lawn = np.array([60, 140, 40])
    greens = 0
    for seed in range(40):
        image = np.full((96, 96, 3), lawn, dtype=np.uint8)
        classes = np.full((96, 96), Label.GRASS, dtype=np.uint8)
        pasting.paste_water(image, classes, np.random.default_rng(seed))
        water = classes == Label.WATER
        if water.any():
            colour = image[water].mean(axis=0)
            greens += abs(colour / colour.sum() - lawn / lawn.sum()).max() < 0.05
    assert 6 <= greens <= 30

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bundles in models/: within their size, honouring the contract, and learned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from peace_ros.core.domain import Frame, Label, is_safe
from peace_ros.core.inference import Bundle, ClipEncoder, Preprocessor, TextEncoder, open_sessions
from peace_ros.simulation.drawing import apply_condition, draw_scene

MODELS = Path(__file__).resolve().parents[3] / 'models'
SAFE = ('grass', 'bare ground')
HAZARDS = ('building', 'road', 'tree', 'water', 'car')
SCENES = tuple(range(20_000_000, 20_000_008))
"""Seeds that training never draws."""


class _Segmenter:
    def __init__(self) -> None:
        bundle = Bundle.load(MODELS / 'clipseg-small')
        self.sessions = open_sessions(
            bundle, ('image_encoder', 'text_encoder', 'decoder'), threads=1
        )
        self.text = TextEncoder(bundle, self.sessions['text_encoder'])
        self.preprocess = Preprocessor(bundle.manifest.input)

    def __call__(
        self, image: np.ndarray, texts: list[str], positives: int, *outputs: str
    ) -> list[np.ndarray]:
        feeds = {'pixel_values': self.preprocess(image)}
        (features,) = self.sessions['image_encoder'].run(['features'], feeds)
        return list(
            self.sessions['decoder'].run(
                outputs,
                {
                    'features': features,
                    'text_embedding': self.text(texts),
                    'is_positive': (np.arange(len(texts)) < positives).astype(np.float32),
                },
            )
        )


@pytest.fixture(scope='module')
def segmenter() -> _Segmenter:
    return _Segmenter()


@pytest.fixture(scope='module')
def scenes() -> list[tuple[np.ndarray, np.ndarray]]:
    drawn = [draw_scene(seed, 352, 0.2) for seed in SCENES]
    return [(scene.image_rgb, scene.labels) for scene in drawn]


def test_all_models_together_stay_below_ten_megabytes() -> None:
    total = sum(path.stat().st_size for path in MODELS.rglob('*') if path.is_file())
    assert 100_000 < total <= 10_000_000


def test_the_maps_have_the_size_of_the_input_and_lie_between_zero_and_one(
    segmenter: _Segmenter, scenes: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    names = ('positive', 'negative', 'softmax_positive', 'term_logits')
    *maps, logits = segmenter(scenes[0][0], [*SAFE, *HAZARDS], len(SAFE), *names)
    for each in maps:
        assert each.shape == (352, 352)
        assert each.dtype == np.float32
        assert each.min() >= 0.0
        assert each.max() <= 1.0
    assert logits.shape == (7, 352, 352)
    (alone,) = segmenter(scenes[0][0], ['water'], 0, 'positive')
    assert alone.max() == 0.0


@pytest.mark.parametrize(
    ('label', 'word'),
    [
        (Label.GRASS, 'grass'),
        (Label.BARE_GROUND, 'bare ground'),
        (Label.PAVED, 'road'),
        (Label.BUILDING, 'building'),
        (Label.VEHICLE, 'car'),
    ],
)
def test_a_prompt_scores_its_own_class_above_everything_else(
    label: Label,
    word: str,
    segmenter: _Segmenter,
    scenes: list[tuple[np.ndarray, np.ndarray]],
) -> None:
    inside, outside = [], []
    for image, labels in scenes:
        (logits,) = segmenter(image, [f'A rendered image of {word} in spring.'], 1, 'term_logits')
        inside.append(logits[0][labels == label])
        outside.append(logits[0][labels != label])
    assert np.concatenate(inside).mean() > np.concatenate(outside).mean() + 1.0


def test_safe_ground_scores_above_hazards_on_scenes_never_seen(
    segmenter: _Segmenter, scenes: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    safe, unsafe = [], []
    for image, labels in scenes:
        texts = [*SAFE, *HAZARDS]
        positive, negative = segmenter(image, texts, len(SAFE), 'positive', 'negative')
        safety = np.minimum(positive, 1.0 - negative)
        safe.append(safety[is_safe(labels)])
        unsafe.append(safety[~is_safe(labels)])
    assert np.concatenate(safe).mean() > np.concatenate(unsafe).mean() + 0.25


@pytest.mark.parametrize(
    ('condition', 'words'),
    [('night', {'night', 'dark'}), ('fog', {'fog', 'smog'}), ('snowy', {'snowy', 'winter'})],
)
def test_the_ranker_names_the_light_and_weather(
    condition: str, words: set[str], scenes: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    encoder = ClipEncoder(Bundle.load(MODELS / 'clip-small'), threads=1)
    vocabulary = ['summer', 'winter', 'night', 'dark', 'sunny', 'rainy', 'snowy', 'fog', 'smog']
    texts = encoder.text_embeddings([f'A {word} image' for word in vocabulary])
    rng = np.random.default_rng(0)
    right = 0
    for image, labels in scenes:
        changed = apply_condition(image, condition, rng, strength=0.8, labels=labels)
        embedding = encoder.image_embedding(Frame(changed, 0))
        right += vocabulary[int((texts @ embedding).argmax())] in words
    assert right >= 6

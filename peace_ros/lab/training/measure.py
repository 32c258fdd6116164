# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of exported bundles: what is called safe, class IoU, word ranking, speed."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from peace_ros.core.domain import Frame, Label
from peace_ros.core.inference import Bundle, ClipEncoder, Preprocessor, TextEncoder, open_sessions
from peace_ros.lab.training.annotations import VEGETATION
from peace_ros.lab.training.conditions import all_conditions, apply, complete
from peace_ros.lab.training.sources import FRAME_PX, VALIDATION_SEED, load_drawn, load_dubai
from peace_ros.lab.training.text import ENVIRONMENT_WORDS, FRAME_WORDS, RESOLUTION_WORDS
from peace_ros.lab.training.views import cut

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from peace_ros.lab.training.sources import TrainingSource

POSITIVE_TERMS = ('grass', 'lawn', 'field', 'park', 'bare ground')
NEGATIVE_TERMS = ('building', 'roof', 'road', 'car', 'person', 'tree', 'water', 'fence')
"""The terms that the package ships as its default."""
TEMPLATE = 'A {resolution} {frame} of {term} in {environment}.'
THRESHOLDS = (0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9)
_CLASS_TERMS = {
    Label.GRASS: 'grass', Label.BARE_GROUND: 'bare ground', Label.PAVED: 'road',
    Label.BUILDING: 'building', Label.TREE: 'tree', Label.WATER: 'water', Label.VEHICLE: 'car',
    Label.PERSON: 'person', Label.OBSTACLE: 'fence',
}  # fmt: skip


class SafetyModel:
    """A clipseg bundle run as the segmentation node does, without its node."""

    def __init__(self, folder: Path, threads: int = 2) -> None:
        bundle = Bundle.load(folder)
        roles = ('image_encoder', 'text_encoder', 'decoder')
        self._sessions = open_sessions(bundle, roles, threads=threads)
        self._text = TextEncoder(bundle, self._sessions['text_encoder'])
        self._preprocess = Preprocessor(bundle.manifest.input)

    def _decode(
        self, image_rgb: NDArray[np.uint8], texts: list[str], positives: int, outputs: list[str]
    ) -> list[NDArray[np.float32]]:
        encoder = self._sessions['image_encoder']
        names = [each.name for each in encoder.graph.outputs]
        arrays = encoder.run(names, {'pixel_values': self._preprocess(image_rgb)})
        feeds = dict(zip(names, arrays, strict=True))
        feeds['text_embedding'] = self._text(texts)
        feeds['is_positive'] = (np.arange(len(texts)) < positives).astype(np.float32)
        return self._sessions['decoder'].run(outputs, feeds)

    def safety(
        self, image_rgb: NDArray[np.uint8], template: str = 'A view of {term} in summer.'
    ) -> NDArray[np.float32]:
        """Return Sf = min(Sp, 1 - Sn) of the default terms, 352 x 352."""
        texts = [template.replace('{term}', term) for term in POSITIVE_TERMS + NEGATIVE_TERMS]
        outputs = ['positive', 'negative']
        positive, negative = self._decode(image_rgb, texts, len(POSITIVE_TERMS), outputs)
        return np.asarray(np.minimum(positive, 1.0 - negative), dtype=np.float32)

    def classes(self, image_rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the label whose one-word prompt scores highest, 352 x 352."""
        texts = [f'A view of {term} in summer.' for term in _CLASS_TERMS.values()]
        (logits,) = self._decode(image_rgb, texts, 1, ['term_logits'])
        return np.asarray(logits.argmax(axis=0) + 1, dtype=np.uint8)


@dataclass(frozen=True)
class Example:
    """A whole frame with pixel classes, 352 x 352."""

    image_rgb: NDArray[np.uint8]
    classes: NDArray[np.uint8]


def drawn_examples(cache: Path, count: int) -> list[Example]:
    """Return frames of scenes that training never sees."""
    seeds = range(VALIDATION_SEED, VALIDATION_SEED + count)
    return _frames(load_drawn(cache, seeds, size_px=FRAME_PX, workers=1), 1)


def dubai_examples(folder: Path) -> list[Example]:
    """Return frames of the validation tile at three scales."""
    return _frames(load_dubai(folder, 'val'), 3)


def _frames(sources: list[TrainingSource], each: int) -> list[Example]:
    rng = np.random.default_rng(3)
    examples = []
    for source in sources:
        whole = source.kind == 'drawn'
        for _ in range(each):
            if whole:
                examples.append(Example(source.images_rgb[0], source.classes[0]))
            else:
                examples.append(Example(*cut(source, rng, FRAME_PX)[:2]))
    return examples


def safety_report(model: SafetyModel, examples: list[Example]) -> dict[str, dict[str, float]]:
    """Return, by threshold, recall and precision of safe, safe/unsafe IoU and share per class.

    ``VEHICLE`` in a row is the share of vehicle pixels that were called safe, and so on;
    unlabeled pixels and those that may be either do not count.
    """
    counts = np.zeros((len(THRESHOLDS), 2, 16))
    for example in examples:
        safety = model.safety(example.image_rgb)
        for row, threshold in enumerate(THRESHOLDS):
            called = (safety >= threshold).ravel()
            kinds = example.classes.ravel()
            counts[row, 1] += np.bincount(kinds[called], minlength=16)
            counts[row, 0] += np.bincount(kinds[~called], minlength=16)
    return {
        f'{threshold:.2f}': _safety_row(counts[row])
        for row, threshold in enumerate(THRESHOLDS)
    }  # fmt: skip


def _safety_row(counts: NDArray[np.float64]) -> dict[str, float]:
    safe, unsafe = [1, 2], list(range(3, 10))
    hit, missed = counts[1, safe].sum(), counts[0, safe].sum()
    false, right = counts[1, unsafe].sum(), counts[0, unsafe].sum()
    row = {
        'recall': hit / max(hit + missed, 1),
        'precision': hit / max(hit + false, 1),
        'false_safe': false / max(false + right, 1),
        'iou_safe': hit / max(hit + missed + false, 1),
        'iou_unsafe': right / max(right + missed + false, 1),
        'called_safe': (hit + false) / max(counts[:, 1:10].sum(), 1),
    }
    for label in Label:
        total = counts[:, label].sum()
        if label != Label.UNLABELED and total > 0:
            row[label.name] = counts[1, label] / total
    total = counts[:, VEGETATION].sum()
    if total > 0:
        row['VEGETATION'] = counts[1, VEGETATION] / total
    return {key: round(float(value), 4) for key, value in row.items()}


def choose_threshold(model: SafetyModel, examples: list[Example]) -> float:
    """Return the threshold of the highest recall of safe ground minus twice the false-safe share.

    Calling a hazard safe counts double; a threshold that calls nothing safe would score zero.
    """
    rows = safety_report(model, examples)
    return float(max(rows, key=lambda name: rows[name]['recall'] - 2.0 * rows[name]['false_safe']))


def class_iou(model: SafetyModel, examples: list[Example]) -> dict[str, float]:
    """Return the IoU of each class, one-word prompts, highest logit wins."""
    confusion = np.zeros((16, 16))
    for example in examples:
        pairs = example.classes.astype(int).ravel() * 16 + model.classes(example.image_rgb).ravel()
        confusion += np.bincount(pairs, minlength=256).reshape(16, 16)
    confusion = confusion[1:10, 1:10]
    out = {}
    for label in Label:
        if label == Label.UNLABELED or confusion[label - 1].sum() == 0:
            continue
        hit = confusion[label - 1, label - 1]
        union = confusion[label - 1].sum() + confusion[:, label - 1].sum() - hit
        out[label.name] = round(float(hit / union), 3)
    out['mean'] = round(float(np.mean(list(out.values()))), 3)
    return out


def ranking_report(folder: Path, sources: list[TrainingSource], each: int = 1) -> dict[str, float]:
    """Return, by look, how often the first word of its category is a true one."""
    encoder = ClipEncoder(Bundle.load(folder))
    rng = np.random.default_rng(11)
    out = {}
    for look in all_conditions():
        right = []
        for source in sources:
            for _ in range(each):
                image, classes, _ = cut(source, rng, FRAME_PX)
                image = apply(look, image, classes, rng)
                full = complete(look, source)
                embedding = encoder.image_embedding(Frame(image, 0))
                for words, true in (
                    (RESOLUTION_WORDS, look.resolution),
                    (FRAME_WORDS, look.frame),
                    (ENVIRONMENT_WORDS, look.environment and full.environment),
                ):
                    if true:
                        best = int(np.argmax(encoder.text_embeddings(list(words)) @ embedding))
                        right.append(words[best] in true)
        if right:
            out[look.name] = round(float(np.mean(right)), 3)
    out['mean'] = round(float(np.mean(list(out.values()))), 3)
    return out


def speed_report(clipseg: Path, clip: Path, frames: int = 60) -> dict[str, float]:
    """Return median milliseconds per frame of 13 terms, and of the image embedding."""
    model, encoder = SafetyModel(clipseg), ClipEncoder(Bundle.load(clip))
    image = np.random.default_rng(0).integers(0, 255, (FRAME_PX, FRAME_PX, 3)).astype(np.uint8)
    spans: dict[str, list[float]] = {'clipseg_13_terms_ms': [], 'clip_image_ms': []}
    for _ in range(frames):
        start = time.perf_counter()
        model.safety(image)
        middle = time.perf_counter()
        encoder.image_embedding(Frame(image, 0))
        spans['clipseg_13_terms_ms'].append((middle - start) * 1e3)
        spans['clip_image_ms'].append((time.perf_counter() - middle) * 1e3)
    return {name: round(float(np.median(values)), 1) for name, values in spans.items()}

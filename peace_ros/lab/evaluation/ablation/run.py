# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every variant over every labelled image, with one encoding of each image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.prompting import PromptGenerator, load_vocabularies
from peace_ros.core.segmentation import FUSIONS
from peace_ros.core.segmentation.fusion import calibrated
from peace_ros.lab.evaluation.ablation.features import (
    FeatureSegmenter,
    OppositeEncoder,
    SharedEncoder,
)
from peace_ros.lab.evaluation.ablation.variants import Variant
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError, SampleError
from peace_ros.lab.evaluation.segmentation.histograms import BINS, LABELS, count_labels
from peace_ros.lab.evaluation.segmentation.samples import Pair, SampleSource, Skipped
from peace_ros.lab.evaluation.segmentation.tiles import tiles_of

Key = tuple[str, str, str]
"""Group and name of a variant, and fusion."""


@dataclass(frozen=True)
class Counted:
    """What every variant did on every frame."""

    counts: dict[Key, NDArray[np.uint32]]
    """[frames, LABELS, BINS]; with the set difference the bundle's threshold stands at one half."""
    frames: tuple[str, ...]
    skipped: tuple[Skipped, ...]
    image_encodings: int
    """Of the segmenter, each look one."""


class _Bench:
    """The networks of a configuration, and a prompt generator for each variant."""

    def __init__(self, cores: Cores, variants: Sequence[Variant]) -> None:
        if cores.segmentation.family != 'clipseg':
            raise ConfigurationError(
                f'{cores.name} is of family {cores.segmentation.family}: an ablation encodes each '
                'image once, which clipseg alone allows; choose a preset of that family'
            )
        threads = cores.segmentation.threads
        self.segmenter = FeatureSegmenter(
            cores.bundle, cores.segmenter.terms, threads, cores.own.clipseg_max_looks
        )
        clip = ClipEncoder(Bundle.load(cores.prompting.bundle), threads=threads)
        self._encoder = SharedEncoder(clip)
        opposite = OppositeEncoder(self._encoder)
        vocabularies = load_vocabularies(cores.prompting.vocabularies)
        self.generators = [
            (
                variant,
                PromptGenerator(
                    opposite if variant.fits_least else self._encoder,
                    vocabularies,
                    replace(
                        cores.prompting,
                        template=variant.template,
                        environment_words=variant.environment_words,
                    ),
                ),
            )
            for variant in variants
        ]
        # The bundle's threshold was measured with the set difference, and holds only there.
        recommended = float(cores.bundle.manifest.recommended.get('threshold', 0.5))
        self._standing = dict.fromkeys(FUSIONS, 0.5) | {'set_difference': recommended}

    def look(self, frame: Frame, labels: NDArray[np.uint8]) -> dict[Key, NDArray[np.uint32]]:
        """Return the counts of every variant and fusion on one image."""
        features = self.segmenter.encode(frame)
        height, width = labels.shape
        found = {}
        by_template: dict[str, dict[str, NDArray[np.uint32]]] = {}
        for variant, generator in self.generators:
            generator.reset()
            prompt = generator.generate(frame)
            # Variants often come to the same prompt; it is decoded once.
            if prompt.template not in by_template:
                scores = self.segmenter.scores(features, prompt, tuple(FUSIONS))
                by_template[prompt.template] = {
                    name: count_labels(labels, self._sized(name, each, width, height))
                    for name, each in scores.items()
                }
            for name, counts in by_template[prompt.template].items():
                found[variant.group, variant.name, name] = counts
        return found

    def _sized(
        self, fusion: str, scores: NDArray[np.float32], width: int, height: int
    ) -> NDArray[np.float32]:
        safety = calibrated(scores, self._standing[fusion])
        if safety.shape == (height, width):
            return safety
        resized = cv2.resize(safety, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(resized, np.float32)


def ablate(
    source: SampleSource,
    cores: Cores,
    variants: Sequence[Variant],
    *,
    tile_px: int | None = None,
    strict: bool = False,
    report: Callable[[int], None] | None = None,
) -> Counted:
    """Run every variant, with every fusion, over every image of a source.

    Args:
        source: labelled images.
        cores: of the family clipseg; its terms, bundles and vocabularies are used.
        variants: ways to write prompts.
        tile_px: see :func:`tiles_of`; None also takes what the source suggests.
        strict: refuse the first image that cannot be scored instead of skipping it.
        report: is called with the number of images that are done.

    Raises:
        DatasetError: nothing could be scored, or ``strict`` and something could not.
        ConfigurationError: the configuration is of another family.
    """
    bench = _Bench(cores, variants)
    tile_px = source.tile_px if tile_px is None else tile_px
    skipped = list(source.skipped)
    if strict and skipped:
        raise DatasetError(f'{skipped[0].name}: {skipped[0].reason} (--strict)')
    names: list[str] = []
    counts: dict[Key, list[NDArray[np.uint32]]] = {}
    for done, sample in enumerate(source.samples, start=1):
        try:
            pair = sample.load()
        except SampleError as error:
            if strict:
                raise DatasetError(f'{sample.name}: {error} (--strict)') from error
            skipped.append(Skipped(sample.name, str(error)))
        else:
            names.append(sample.name)
            for key, each in _frame_counts(bench, pair, tile_px).items():
                counts.setdefault(key, []).append(each)
        if report is not None:
            report(done)
    if not names:
        raise DatasetError(f'{source.title}: no image could be scored')
    stacked = {key: np.stack(each) for key, each in counts.items()}
    return Counted(stacked, tuple(names), tuple(skipped), bench.segmenter.encodings)


def _frame_counts(bench: _Bench, pair: Pair, tile_px: int | None) -> dict[Key, NDArray[np.uint32]]:
    image, labels = pair
    height_px, width_px = labels.shape
    sums: dict[Key, NDArray[np.uint32]] = {}
    for tile in tiles_of(height_px, width_px, tile_px):
        frame = Frame(np.ascontiguousarray(image[tile.rows, tile.columns]), 0)
        for key, counts in bench.look(frame, tile.labels_of(labels)).items():
            sums[key] = sums.get(key, np.zeros((LABELS, BINS), np.uint32)) + counts
    return sums

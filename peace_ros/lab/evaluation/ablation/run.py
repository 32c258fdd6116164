# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every variant over every labelled image, with one encoding of each image."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import ConfigurationError, Frame, ImageError
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.prompting import PromptGenerator, load_vocabularies
from peace_ros.core.segmentation import FUSIONS, CameraWatch
from peace_ros.core.segmentation.fusion import calibrated
from peace_ros.lab.evaluation.ablation.features import (
    FeatureSegmenter,
    OppositeEncoder,
    SharedEncoder,
)
from peace_ros.lab.evaluation.ablation.variants import Variant
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.histograms import BINS, LABELS, count_labels
from peace_ros.lab.evaluation.segmentation.run import Watch, cut, fitted, readable
from peace_ros.lab.evaluation.segmentation.samples import SampleSource, Skipped

Key = tuple[str, str, str]
"""Group and name of a variant, and fusion."""
Counts = NDArray[np.uint32]
"""[LABELS, BINS]."""


@dataclass(frozen=True)
class Counted:
    """The counts of every variant on every frame."""

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
            cores.bundle, cores.segmenter.terms, cores.segmentation, cores.own
        )
        encoder = SharedEncoder(ClipEncoder(Bundle.load(cores.prompting.bundle), threads=threads))
        opposite = OppositeEncoder(encoder)
        vocabularies = load_vocabularies(cores.prompting.vocabularies)
        self._generators: list[tuple[Variant, PromptGenerator]] = []
        for variant in variants:
            parameters = replace(
                cores.prompting,
                template=variant.template,
                environment_words=variant.environment_words,
            )
            ranking = opposite if variant.fits_least else encoder
            generator = PromptGenerator(ranking, vocabularies, parameters)
            self._generators.append((variant, generator))
        # The bundle's threshold was measured with the set difference, and holds only there.
        recommended = float(cores.bundle.manifest.recommended.get('threshold', 0.5))
        self._standing = dict.fromkeys(FUSIONS, 0.5) | {'set_difference': recommended}

    def look(self, frame: Frame, labels: NDArray[np.uint8]) -> Iterator[tuple[Key, Counts]]:
        """Yield the counts of every variant and fusion on one image."""
        by_template: dict[str, dict[str, Counts]] = {}
        for variant, generator in self._generators:
            generator.reset()
            prompt = generator.generate(frame)
            # Variants often come to the same prompt; it is decoded once.
            if prompt.template not in by_template:
                scores = self.segmenter.scores(frame, prompt)
                by_template[prompt.template] = {
                    name: count_labels(
                        labels, fitted(calibrated(each, self._standing[name]), labels.shape)
                    )
                    for name, each in scores.items()
                }
            for name, counts in by_template[prompt.template].items():
                yield (variant.group, variant.name, name), counts


def ablate(
    source: SampleSource,
    cores: Cores,
    variants: Sequence[Variant],
    *,
    tile_px: int | None = None,
    strict: bool = False,
    watch: Watch = iter,
) -> Counted:
    """Run every variant, with every fusion, over every image of a source.

    Pictures that a flight refuses, such as those of a covered lens, are skipped here too.

    Args:
        source: labelled images.
        cores: of the family clipseg; its terms, bundles and vocabularies are used.
        variants: ways to write prompts.
        tile_px: see :func:`tiles_of`; None also takes what the source suggests.
        strict: see :func:`readable`.
        watch: yields the samples, and may show the progress.

    Raises:
        DatasetError: see :func:`readable`; a flight would refuse a tile and ``strict`` is given.
        ConfigurationError: the configuration is of another family.
    """
    bench = _Bench(cores, variants)
    tile_px = source.tile_px if tile_px is None else tile_px
    skipped: list[Skipped] = []
    names: list[str] = []
    counts: dict[Key, list[Counts]] = defaultdict(list)
    for name, (image, labels) in readable(source, skipped, strict=strict, watch=watch):
        sums: dict[Key, Counts] = defaultdict(lambda: np.zeros((LABELS, BINS), np.uint32))
        refused: list[str] = []
        for tile, frame in cut(image, tile_px):
            try:
                CameraWatch().check(frame)
            except ImageError as error:
                refused.append(str(error))
                continue
            for key, each in bench.look(frame, tile.labels_of(labels)):
                sums[key] += each
        if refused and strict:
            raise DatasetError(f'{name}: {refused[0]} (--strict)')
        if refused:
            skipped.append(Skipped(name, f'{len(refused)} tiles refused: {refused[0]}'))
        if sums:
            names.append(name)
        for key, each in sums.items():
            counts[key].append(each)
    if not names:
        raise DatasetError(
            f'{source.title}: no image could be scored; the first of {len(skipped)}: '
            f'{skipped[0].name}: {skipped[0].reason}'
        )
    stacked = {key: np.stack(each) for key, each in counts.items()}
    return Counted(stacked, tuple(names), tuple(skipped), bench.segmenter.calls['image_encoder'])

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pipeline of a preset, with what a user sets in place of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, log
from typing import Any

from peace_ros.core.domain import Frame, Heatmap, Prompt
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.bundle import user_models_dir
from peace_ros.core.pipeline import Pipeline, create_generator, segmentation_of
from peace_ros.core.presets import load_preset
from peace_ros.core.prompting import PromptingParameters
from peace_ros.core.resources import models_dir
from peace_ros.core.segmentation import SegmentationParameters, Segmenter, create_segmenter

BUNDLED_FASTSAM = 'fastsam-small'


@dataclass(frozen=True)
class Overrides:
    """What a user sets in place of what the presets say; empty: as they say."""

    clip: str = ''
    clipseg: str = ''
    fastsam: str = ''
    fusion: str = ''
    terms: str = ''
    vocabularies: str = ''
    max_looks: int = 0
    threads: int = 2


@dataclass(frozen=True)
class Cores:
    """The pipeline of one configuration, and what it was made from."""

    name: str
    pipeline: Pipeline
    bundle: Bundle
    prompting: PromptingParameters
    segmentation: SegmentationParameters
    own: Any
    """Parameters of the segmentation's family."""

    @property
    def segmenter(self) -> Segmenter:
        """What makes heatmaps."""
        return self.pipeline.segmenter

    @property
    def standing(self) -> float:
        """The network's own score that stands at one half of the heatmap."""
        return self.segmenter.threshold

    def prompt(self, frame: Frame) -> Prompt:
        """Return the prompt of a frame on its own, whatever came before."""
        self.pipeline.reset()
        return self.pipeline.prompt(frame)

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the heatmap of a frame; ImageError where a flight would refuse it."""
        return self.pipeline.heatmap(frame, prompt)

    def own_score(self, score: float) -> float:
        """Return the network's own score of a heatmap's score."""
        return shifted(score, _log_odds(self.standing))

    def heatmap_score(self, own: float) -> float:
        """Return the heatmap's score of a network's own score; 0 < own < 1."""
        return shifted(own, -_log_odds(self.standing))


def _log_odds(score: float) -> float:
    return log(score) - log(1.0 - score)


def shifted(score: float, log_odds: float) -> float:
    """Return a score, 0 < score < 1, moved in log-odds."""
    return 1.0 / (1.0 + exp(-(_log_odds(score) + log_odds)))


def build_cores(config: str, overrides: Overrides) -> Cores | str:
    """Make the cores of a preset, or say in a sentence which model it lacks.

    Raises:
        ConfigurationError: the preset or a parameter cannot be used.
        BundleError: a model that is there cannot be used.
    """
    preset = load_preset(config)
    given = {'threads': overrides.threads, 'fusion': overrides.fusion, 'terms': overrides.terms}
    segmentation, own = segmentation_of(preset, **given, clipseg_max_looks=overrides.max_looks)
    name = overrides.fastsam if segmentation.family == 'fastsam' else overrides.clipseg
    name = name or segmentation.bundle
    if name == segmentation.bundle and segmentation.family == 'fastsam' and not _is_there(name):
        if not _is_there(BUNDLED_FASTSAM):
            names = ' or '.join(repr(each) for each in dict.fromkeys((name, BUNDLED_FASTSAM)))
            return f'{preset.name} is left out: there is no bundle {names}; give one with --fastsam'
        name = BUNDLED_FASTSAM
    segmentation, bundle = replace(segmentation, bundle=name), Bundle.load(name)
    prompting = preset.fill(
        'prompt_generator',
        PromptingParameters,
        threads=overrides.threads,
        bundle=overrides.clip,
        vocabularies=overrides.vocabularies,
    )
    segmenter = create_segmenter(segmentation, own, bundle=bundle)
    pipeline = Pipeline(segmenter, create_generator(prompting))
    return Cores(preset.name, pipeline, bundle, prompting, segmentation, own)


def _is_there(name: str) -> bool:
    return any((place / name).is_dir() for place in (models_dir(), user_models_dir()))

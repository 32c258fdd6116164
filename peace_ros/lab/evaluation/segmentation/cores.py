# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The two perception cores of a preset, as the nodes make them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, log

from peace_ros.core.domain import Frame, Heatmap, Prompt
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.inference.bundle import user_models_dir
from peace_ros.core.presets import load_preset
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies
from peace_ros.core.prompting.templates import categories_of, resolve_template
from peace_ros.core.resources import models_dir
from peace_ros.core.segmentation import (
    SegmentationParameters,
    Segmenter,
    create_segmenter,
    load_terms,
)

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
    """Prompt generator and segmenter of one configuration."""

    name: str
    generator: PromptGenerator
    segmenter: Segmenter
    bundle: Bundle
    prompting: PromptingParameters
    segmentation: SegmentationParameters
    standing: float
    """The network's own score that stands at one half of the heatmap."""

    def prompt(self, frame: Frame) -> Prompt:
        """Return the prompt of a frame on its own, whatever came before."""
        self.generator.reset()
        return self.generator.generate(frame)

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the heatmap of a frame."""
        return self.segmenter.segment(frame, prompt)

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
    threads = overrides.threads
    segmentation = preset.fill('segmentation', SegmentationParameters, threads=threads)
    given = overrides.fastsam if segmentation.family == 'fastsam' else overrides.clipseg
    bundle_name = given or segmentation.bundle
    if not given and segmentation.family == 'fastsam' and not _is_there(bundle_name):
        if not _is_there(BUNDLED_FASTSAM):
            names = ' or '.join(
                repr(each) for each in dict.fromkeys((bundle_name, BUNDLED_FASTSAM))
            )
            return f'{preset.name} is left out: there is no bundle {names}; give one with --fastsam'
        bundle_name = BUNDLED_FASTSAM
    segmentation = replace(
        segmentation,
        bundle=bundle_name,
        fusion=overrides.fusion or segmentation.fusion,
        terms=overrides.terms or segmentation.terms,
        clipseg_max_looks=overrides.max_looks or segmentation.clipseg_max_looks,
    )
    bundle = Bundle.load(bundle_name)
    segmenter = create_segmenter(
        segmentation.family, bundle, load_terms(segmentation.terms), segmentation
    )
    prompting = preset.fill('prompt_generator', PromptingParameters, threads=threads)
    prompting = replace(
        prompting,
        bundle=overrides.clip or prompting.bundle,
        vocabularies=overrides.vocabularies or prompting.vocabularies,
    )
    return Cores(
        preset.name,
        create_generator(prompting),
        segmenter,
        bundle,
        prompting,
        segmentation,
        standing_score(bundle, segmentation),
    )


def create_generator(parameters: PromptingParameters) -> PromptGenerator:
    """Make the prompt generator; a static template needs no network."""
    if not categories_of(resolve_template(parameters.template)):
        return PromptGenerator(None, None, parameters)
    encoder = ClipEncoder(
        Bundle.load(parameters.bundle), threads=parameters.threads, providers=parameters.providers
    )
    return PromptGenerator(encoder, load_vocabularies(parameters.vocabularies), parameters)


def standing_score(bundle: Bundle, parameters: SegmentationParameters) -> float:
    """Return the network's score that its segmenter puts at one half of the heatmap.

    The bundle's recommendation holds for CLIPSeg and the set difference, with which it was
    measured; everything else publishes its scores as they are.
    """
    if parameters.family != 'clipseg' or parameters.fusion != 'set_difference':
        return 0.5
    return float(bundle.manifest.recommended.get('threshold', 0.5))


def _is_there(name: str) -> bool:
    return any((place / name).is_dir() for place in (models_dir(), user_models_dir()))

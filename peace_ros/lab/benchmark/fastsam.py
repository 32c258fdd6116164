# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""This project's way with FastSAM: segments once a frame, all of them through CLIP in one batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from peace_ros.core.domain import Prompt
from peace_ros.core.inference import Bundle, ClipEncoder, open_sessions
from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies
from peace_ros.core.segmentation import FastSamParameters, FastSamSegmenter, SegmentationParameters
from peace_ros.core.segmentation.fastsam import Letterbox, assemble, detect
from peace_ros.core.segmentation.fastsam.crops import Cutter
from peace_ros.core.segmentation.fastsam.selection import select
from peace_ros.lab.benchmark.clipseg import RANKING_INTERVAL_S, TimedCores
from peace_ros.lab.benchmark.measure import Measured, Spread, Stopwatch, peak_rss_mb
from peace_ros.lab.benchmark.scene import TERMS_13, TERMS_39, draw_frames

if TYPE_CHECKING:
    from peace_ros.core.domain import Frame
    from peace_ros.core.segmentation import Terms

_STATIC = Prompt('A photo of {term}.', 0)
_STEADY_FRAMES = 3


@dataclass(frozen=True)
class FastSamSetup:
    """What is run, and with what."""

    fastsam: str
    """Bundle, a folder or a name."""
    clip: str
    """Bundle that ranks the words."""
    provider: str
    threads: int = 2
    frames: int = 20
    parts: int = 5
    """Frames whose parts are timed one by one, and on which 13 and 39 terms are compared."""


def measure_fastsam(**setup_values: Any) -> Measured:
    """Rank at an interval, segment, score in one batch. Takes the fields of FastSamSetup."""
    setup = FastSamSetup(**setup_values)
    segmenter = _segmenter(setup, TERMS_13)
    encoder = ClipEncoder(
        Bundle.load(setup.clip), threads=setup.threads, providers=(setup.provider,)
    )
    parameters = PromptingParameters(interval_s=RANKING_INTERVAL_S, margin=0.0)
    generator = PromptGenerator(encoder, load_vocabularies(), parameters)
    frames = draw_frames(setup.frames)
    line = TimedCores(generator, segmenter)
    line.run(frames[0], Stopwatch())
    line.settle()
    generator.reset()
    watch = Stopwatch()
    for frame in frames:
        with watch.stage('frame'):
            line.run(frame, watch)
    line.settle()
    times = watch.times_ms
    extra = {
        'dynamic_prompt_share': float(np.sum(times['prompt']) / np.sum(times['frame'])),
        'segments_per_frame': float(
            np.mean([len(segmenter.segments(each).scored) for each in frames[:_STEADY_FRAMES]])
        ),
        'steady_calls': _steady_calls(segmenter, frames[:_STEADY_FRAMES], line.prompt or _STATIC),
    }
    peak = peak_rss_mb()
    extra['cost_39_over_13_terms'] = _cost_of_terms(setup, segmenter, frames[: setup.parts])
    spreads = watch.spreads() | _parts_of(setup, frames[: setup.parts])
    manifest = Bundle.load(setup.fastsam).manifest
    how = f'{manifest.provenance}; {setup.provider}'
    busy = watch.processor_p50('frame')
    return Measured('peace_ros, FastSAM', how, spreads, len(frames), peak, busy, extra)


def _segmenter(setup: FastSamSetup, terms: Terms) -> FastSamSegmenter:
    parameters = SegmentationParameters(
        family='fastsam', threads=setup.threads, providers=(setup.provider,)
    )
    return FastSamSegmenter(setup.fastsam, terms, parameters)


def _steady_calls(
    segmenter: FastSamSegmenter, frames: list[Frame], prompt: Prompt
) -> dict[str, float]:
    """Return role -> calls per frame while the prompt stays."""
    segmenter.prepare(prompt)
    before = dict(segmenter.calls)
    for frame in frames:
        segmenter.segment(frame, prompt)
    after = segmenter.calls
    return {role: (after[role] - before[role]) / len(frames) for role in before}


def _cost_of_terms(setup: FastSamSetup, thirteen: FastSamSegmenter, frames: list[Frame]) -> float:
    """Time 13 and 39 terms in turn, so that whatever slows the machine slows both."""
    many = _segmenter(setup, TERMS_39)
    watch = Stopwatch()
    for index, frame in enumerate([frames[0], *frames]):
        for name, segmenter in (('13', thirteen), ('39', many)):
            with watch.stage(name if index else 'warm-up'):
                segmenter.segment(frame, _STATIC)
    spreads = watch.spreads()
    return spreads['39'].p50 / spreads['13'].p50


def _parts_of(setup: FastSamSetup, frames: list[Frame]) -> dict[str, Spread]:
    """Time the steps within a segmentation, with its own parts."""
    bundle, parameters = Bundle.load(setup.fastsam), FastSamParameters()
    sessions = open_sessions(
        bundle,
        ('segmenter', 'image_encoder'),
        threads=setup.threads,
        providers=(setup.provider,),
    )
    letterbox = Letterbox(bundle.manifest.input)
    cutter = Cutter(bundle.manifest.encoder_input, parameters.fastsam_max_segments)
    warm, watch = Stopwatch(), Stopwatch()
    for index, frame in enumerate([frames[0], *frames]):
        clock = watch if index else warm
        with clock.stage('preprocessing'):
            pixels, place = letterbox(frame.image_rgb)
        with clock.stage('segmenter'):
            predictions, prototypes = sessions['segmenter'].run(
                [PREDICTIONS, PROTOTYPES], {PIXEL_VALUES: pixels}
            )
        with clock.stage('boxes and masks'):
            found = detect(
                predictions[0],
                min_confidence=parameters.fastsam_min_confidence,
                max_overlap=parameters.fastsam_max_overlap,
            )
            cell_px = pixels.shape[-1] // prototypes.shape[-1]
            segments = assemble(found, prototypes[0], cell_px, place)
            chosen = select(segments, place.width_px * place.height_px, parameters)
        with clock.stage('crops'):
            crops = cutter(frame.image_rgb, chosen.scored, place)
        if len(crops):
            with clock.stage('CLIP, all segments'):
                sessions['image_encoder'].run([IMAGE_EMBEDDING], {PIXEL_VALUES: crops})
    return watch.spreads()

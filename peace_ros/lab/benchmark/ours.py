# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""This project's way with CLIPSeg and FastSAM, and BlabberSeg's with CLIPSeg."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Prompt
from peace_ros.core.inference import (
    Bundle,
    ClipEncoder,
    Preprocessor,
    Session,
    TextEncoder,
    open_sessions,
)
from peace_ros.core.inference.contract import (
    IMAGE_EMBEDDING,
    IS_POSITIVE,
    PIXEL_VALUES,
    PREDICTIONS,
    PROTOTYPES,
    TERM_LOGITS,
    TEXT_EMBEDDING,
)
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies
from peace_ros.core.segmentation import (
    ClipSegParameters,
    ClipSegSegmenter,
    FastSamParameters,
    FastSamSegmenter,
    SegmentationParameters,
    Terms,
    set_difference,
)
from peace_ros.core.segmentation.fastsam.crops import Cutter
from peace_ros.core.segmentation.fastsam.letterbox import Letterbox
from peace_ros.core.segmentation.fastsam.masks import assemble, detect
from peace_ros.core.segmentation.fastsam.selection import select
from peace_ros.lab.benchmark.measure import Measured, Spread, Stopwatch
from peace_ros.lab.benchmark.scene import IS_POSITIVE_13, TERMS_13, TERMS_39, draw_frames

RANKING_INTERVAL_S = 2.0
_STATIC = Prompt('A photo of {term}.', 0)
_STEADY_FRAMES = 3


@dataclass(frozen=True)
class Setup:
    """What is run, and with what."""

    bundle: str
    """CLIPSeg or FastSAM, a folder or a name."""
    clip: str
    """Bundle that ranks the words."""
    provider: str
    threads: int = 2
    frames: int = 30
    parts: int = 10
    """Frames whose stages are timed one by one, and on which 13 and 39 terms are compared."""

    def segmenter(self, terms: Terms) -> ClipSegSegmenter | FastSamSegmenter:
        """Return the segmenter; CLIPSeg looks once, as the ways do that it is compared with."""
        bundle = Bundle.load(self.bundle)
        parameters = SegmentationParameters(
            family=bundle.manifest.family, threads=self.threads, providers=(self.provider,)
        )
        if parameters.family == 'fastsam':
            return FastSamSegmenter(bundle, terms, parameters)
        return ClipSegSegmenter(bundle, terms, parameters, ClipSegParameters(1))

    def sessions(self, *roles: str) -> tuple[Bundle, list[Session]]:
        """Return the bundle and some of its graphs."""
        bundle = Bundle.load(self.bundle)
        opened = open_sessions(bundle, roles, threads=self.threads, providers=(self.provider,))
        return bundle, [opened[role] for role in roles]


def measure_ours(**setup_values: Any) -> Measured:
    """Rank at an interval, segment with all terms in one batch; new texts are embedded beside.

    Takes the fields of :class:`Setup`, as the other measurements do.
    """
    setup = Setup(**setup_values)
    segmenter = setup.segmenter(TERMS_13)
    encoder = ClipEncoder(
        Bundle.load(setup.clip), threads=setup.threads, providers=(setup.provider,)
    )
    generator = PromptGenerator(
        encoder, load_vocabularies(), PromptingParameters(interval_s=RANKING_INTERVAL_S, margin=0.0)
    )
    frames = draw_frames(setup.frames)
    line = TimedCores(generator, segmenter)
    line.run(frames[0], Stopwatch())
    line.settle()
    generator.reset()
    watch = Stopwatch()
    before = {**segmenter.calls, 'ranking': encoder.calls['image_encoder']}
    for frame in frames:
        with watch.stage('frame'):
            line.run(frame, watch)
    line.settle()
    after = {**segmenter.calls, 'ranking': encoder.calls['image_encoder']}
    times = watch.times_ms
    extra: dict[str, Any] = {
        'calls_per_frame': {name: (after[name] - before[name]) / len(frames) for name in after},
        'dynamic_prompt_share': float(np.sum(times['prompt']) / np.sum(times['frame'])),
        'ranking_ms': _ranking_of_every_frame(encoder, frames[:5]),
        'prompts': line.prompts,
        'steady_calls': _steady_calls(segmenter, frames[:_STEADY_FRAMES], line.prompt or _STATIC),
    }
    manifest = Bundle.load(setup.bundle).manifest
    if isinstance(segmenter, FastSamSegmenter):
        found = [len(segmenter.segments(each).scored) for each in frames[:_STEADY_FRAMES]]
        extra['segments_per_frame'] = float(np.mean(found))
        stages = _fastsam_stages(setup, frames[: setup.parts])
        name, what = 'peace_ros, FastSAM', manifest.provenance
    else:
        stages = _clipseg_stages(setup, frames[: setup.parts])
        name, what = 'peace_ros', manifest.precision
    measured = watch.measured(name, f'{what}, {setup.provider}', **extra)
    measured.stages_ms.update(stages)
    measured.extra.update(_cost_of_terms(setup, segmenter, frames[: setup.parts]))
    return measured


class TimedCores:
    """Prompt generator and segmenter as the nodes join them: a new prompt waits for its texts."""

    def __init__(
        self, generator: PromptGenerator, segmenter: ClipSegSegmenter | FastSamSegmenter
    ) -> None:
        self._generator = generator
        self._segmenter = segmenter
        self._worker = ThreadPoolExecutor(1)
        self._pending: tuple[Prompt, Future[None]] | None = None
        self.prompt: Prompt | None = None
        self.prompts = 0

    def run(self, frame: Frame, watch: Stopwatch) -> None:
        """Describe and segment a frame."""
        with watch.stage('prompt'):
            newest = self._generator.generate(frame)
        self._take(newest)
        with watch.stage('segment'):
            self._segmenter.segment(frame, self.prompt or newest)

    def _take(self, newest: Prompt) -> None:
        if self.prompt is None:
            self._segmenter.prepare(newest)
            self.prompt, self.prompts = newest, 1
        if self._pending is not None and self._pending[1].done():
            self.prompt, self._pending = self._pending[0], None
            self.prompts += 1
        if self._pending is None and newest.template != self.prompt.template:
            self._pending = newest, self._worker.submit(self._segmenter.prepare, newest)

    def settle(self) -> None:
        """Wait for the texts of a new prompt."""
        if self._pending is not None:
            self._pending[1].result()


def _ranking_of_every_frame(encoder: ClipEncoder, frames: Sequence[Frame]) -> float:
    watch = Stopwatch()
    for frame in frames:
        with watch.stage('ranking'):
            encoder.image_embedding(frame)
    return watch.spreads()['ranking'].p50


def _steady_calls(
    segmenter: ClipSegSegmenter | FastSamSegmenter, frames: Sequence[Frame], prompt: Prompt
) -> dict[str, float]:
    """Return role -> calls per frame while the prompt stays."""
    segmenter.prepare(prompt)
    before = dict(segmenter.calls)
    for frame in frames:
        segmenter.segment(frame, prompt)
    after = segmenter.calls
    return {role: (after[role] - before[role]) / len(frames) for role in before}


def _cost_of_terms(
    setup: Setup, thirteen: ClipSegSegmenter | FastSamSegmenter, frames: Sequence[Frame]
) -> dict[str, float]:
    """Time 13 and 39 terms in turn, so that whatever slows the machine slows both."""
    many, watch = setup.segmenter(TERMS_39), Stopwatch()
    for frame, stage in watch.warmed(frames):
        for name, segmenter in (('13', thirteen), ('39', many)):
            with stage(name):
                segmenter.segment(frame, _STATIC)
    spreads = watch.spreads()
    few, more = spreads['13'].p50, spreads['39'].p50
    return {
        'cost_39_over_13_terms': more / few,
        'cost_per_term': (more - few) / (len(TERMS_39) - len(TERMS_13)) / few,
    }


def _clipseg_stages(setup: Setup, frames: Sequence[Frame]) -> dict[str, Spread]:
    """Time the steps within a segmentation."""
    bundle, (encoder, decoder, texts) = setup.sessions('image_encoder', 'decoder', 'text_encoder')
    preprocess, embed = Preprocessor(bundle.manifest.input), TextEncoder(bundle, texts)
    sentences = [_STATIC.text_for(term) for term in TERMS_13.all]
    names = [each.name for each in encoder.graph.outputs]
    embed(sentences)
    watch = Stopwatch()
    for frame, stage in watch.warmed(frames):
        with stage('preprocessing'):
            pixels = preprocess(frame.image_rgb)
        with stage('image encoder'):
            features = encoder.run(names, {PIXEL_VALUES: pixels})
        feeds = dict(zip(names, features, strict=True))
        feeds.update({TEXT_EMBEDDING: embed(sentences), IS_POSITIVE: IS_POSITIVE_13})
        with stage('decoder, 13 terms'):
            decoder.run(['positive', 'negative'], feeds)
    with watch.stage('13 new texts, off the path'):
        embed([_STATIC.text_for(f'{term} in autumn') for term in TERMS_13.all])
    return watch.spreads()


def _fastsam_stages(setup: Setup, frames: Sequence[Frame]) -> dict[str, Spread]:
    """Time the steps within a segmentation, with its own parts."""
    bundle, (segmenter, encoder) = setup.sessions('segmenter', 'image_encoder')
    parameters = FastSamParameters()
    letterbox = Letterbox(bundle.manifest.input)
    cutter = Cutter(bundle.manifest.encoder_input, parameters.fastsam_max_segments)
    watch = Stopwatch()
    for frame, stage in watch.warmed(frames):
        with stage('preprocessing'):
            pixels, place = letterbox(frame.image_rgb)
        with stage('segmenter'):
            outputs = [PREDICTIONS, PROTOTYPES]
            predictions, prototypes = segmenter.run(outputs, {PIXEL_VALUES: pixels})
        with stage('boxes and masks'):
            found = detect(
                predictions[0],
                min_confidence=parameters.fastsam_min_confidence,
                max_overlap=parameters.fastsam_max_overlap,
            )
            cell_px = pixels.shape[-1] // prototypes.shape[-1]
            segments = assemble(found, prototypes[0], cell_px, place)
            chosen = select(segments, place.width_px * place.height_px, parameters)
        with stage('crops'):
            crops = cutter(frame.image_rgb, chosen.scored, place)
        if len(crops):
            with stage('CLIP, all segments'):
                encoder.run([IMAGE_EMBEDDING], {PIXEL_VALUES: crops})
    return watch.spreads()


def measure_memory(**setup_values: Any) -> Measured:
    """Run a few frames and tell the peak memory."""
    setup = Setup(**setup_values)
    segmenter, watch = setup.segmenter(TERMS_13), Stopwatch()
    for frame in draw_frames(setup.frames):
        with watch.stage('frame'):
            segmenter.segment(frame, _STATIC)
    precision = Bundle.load(setup.bundle).manifest.precision
    return watch.measured('peace_ros', f'{precision}, {setup.provider}')


def measure_blabberseg(**setup_values: Any) -> Measured:
    """Encode the image once with 10 layers, run the decoder per term, prompts static."""
    setup = Setup(**setup_values)
    bundle, (encoder, decoder, texts) = setup.sessions('image_encoder', 'decoder', 'text_encoder')
    names = [each.name for each in encoder.graph.outputs]
    embeddings = TextEncoder(bundle, texts)([_STATIC.text_for(term) for term in TERMS_13.all])
    preprocess, one = Preprocessor(bundle.manifest.input), np.ones(1, np.float32)
    count, watch = len(TERMS_13.positive), Stopwatch()
    for frame, stage in watch.warmed(draw_frames(setup.frames)):
        with stage('frame'):
            feeds: dict[str, NDArray[Any]] = {PIXEL_VALUES: preprocess(frame.image_rgb)}
            features = dict(zip(names, encoder.run(names, feeds), strict=True))
            maps = []
            for row in embeddings:
                feeds = {**features, TEXT_EMBEDDING: row[None], IS_POSITIVE: one}
                (logits,) = decoder.run([TERM_LOGITS], feeds)
                maps.append(0.5 * np.tanh(0.5 * logits[0]) + 0.5)
            set_difference(np.max(maps[:count], axis=0), np.max(maps[count:], axis=0))
    return watch.measured('BlabberSeg', f'{bundle.manifest.precision}, {setup.provider}')

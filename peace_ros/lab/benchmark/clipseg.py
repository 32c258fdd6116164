# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""This project's way with CLIPSeg, and BlabberSeg's, over the same bundle contract."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from peace_ros.core.domain import Frame, Prompt
from peace_ros.core.inference import Bundle, ClipEncoder, Preprocessor, TextEncoder, open_sessions
from peace_ros.core.inference.contract import IS_POSITIVE, PIXEL_VALUES, TERM_LOGITS, TEXT_EMBEDDING
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies
from peace_ros.core.segmentation import (
    ClipSegParameters,
    ClipSegSegmenter,
    SegmentationParameters,
    Segmenter,
    set_difference,
)
from peace_ros.lab.benchmark.measure import Measured, Stopwatch, peak_rss_mb
from peace_ros.lab.benchmark.scene import TERMS_13, TERMS_39, draw_frames

if TYPE_CHECKING:
    from concurrent.futures import Future

    from numpy.typing import NDArray

RANKING_INTERVAL_S = 2.0
_STATIC = Prompt('A photo of {term}.', 0)


@dataclass(frozen=True)
class Setup:
    """What is run, and with what."""

    clipseg: str
    """Bundle, a folder or a name."""
    clip: str
    """Bundle that ranks the words."""
    provider: str
    threads: int = 2
    frames: int = 30


def measure_ours(**setup_values: Any) -> Measured:
    """Rank, encode once, decode all terms in one batch; new texts are embedded on the side.

    Takes the fields of :class:`Setup`, as the other measurements do.
    """
    setup = Setup(**setup_values)
    segmenter = _segmenter(setup, TERMS_13)
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
    stages = watch.times_ms
    share = float(np.sum(stages['prompt']) / np.sum(stages['frame']))
    every_frame = _ranking_of_every_frame(encoder, frames[:5])
    extra = {
        'calls_per_frame': {name: (after[name] - before[name]) / len(frames) for name in after},
        'dynamic_prompt_share': share,
        'ranking_ms': every_frame,
        'prompts': line.prompts,
        **_calls_of_steady_frames(segmenter, frames[:3], line.prompt),
    }
    spreads = watch.spreads()
    spreads.update(_stages_of(setup, frames[:10]))
    peak = peak_rss_mb()
    extra.update(_cost_of_terms(setup, segmenter, frames[:10]))
    how = f'{Bundle.load(setup.clipseg).manifest.precision}, {setup.provider}'
    busy = watch.processor_p50('frame')
    return Measured('peace_ros', how, spreads, len(frames), peak, busy, extra)


class TimedCores:
    """Prompt generator and segmenter as the nodes join them: a new prompt waits for its texts."""

    def __init__(self, generator: PromptGenerator, segmenter: Segmenter) -> None:
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
        """Wait for texts under way."""
        if self._pending is not None:
            self._pending[1].result()


def _segmenter(setup: Setup, terms: Any) -> ClipSegSegmenter:
    # The reference sees a frame once, so one look is what is compared.
    parameters = SegmentationParameters(threads=setup.threads, providers=(setup.provider,))
    return ClipSegSegmenter(setup.clipseg, terms, parameters, ClipSegParameters(1))


def _ranking_of_every_frame(encoder: ClipEncoder, frames: list[Frame]) -> float:
    watch = Stopwatch()
    for frame in frames:
        with watch.stage('ranking'):
            encoder.image_embedding(frame)
    return watch.spreads()['ranking'].p50


def _calls_of_steady_frames(
    segmenter: ClipSegSegmenter, frames: list[Frame], prompt: Prompt | None
) -> dict[str, Any]:
    prompt = prompt or _STATIC
    segmenter.prepare(prompt)
    before = dict(segmenter.calls)
    for frame in frames:
        segmenter.segment(frame, prompt)
    calls = segmenter.calls
    return {'steady_calls': {name: (calls[name] - before[name]) / len(frames) for name in calls}}


def _cost_of_terms(
    setup: Setup, thirteen: ClipSegSegmenter, frames: list[Frame]
) -> dict[str, float]:
    """Time 13 and 39 terms in turn, so that whatever slows the machine slows both."""
    many = _segmenter(setup, TERMS_39)
    watch = Stopwatch()
    for index, frame in enumerate([frames[0], *frames]):
        for name, segmenter in (('13', thirteen), ('39', many)):
            with watch.stage(name if index else 'warm-up'):
                segmenter.segment(frame, _STATIC)
    spreads = watch.spreads()
    few, more = spreads['13'].p50, spreads['39'].p50
    return {
        'cost_39_over_13_terms': more / few,
        'cost_per_term': (more - few) / (len(TERMS_39) - len(TERMS_13)) / few,
    }


def _stages_of(setup: Setup, frames: list[Frame]) -> dict[str, Any]:
    """Time the steps within a segmentation."""
    bundle = Bundle.load(setup.clipseg)
    sessions = open_sessions(
        bundle,
        ('image_encoder', 'text_encoder', 'decoder'),
        threads=setup.threads,
        providers=(setup.provider,),
    )
    preprocess = Preprocessor(bundle.manifest.input)
    text = TextEncoder(bundle, sessions['text_encoder'])
    texts = [_STATIC.text_for(term) for term in TERMS_13.all]
    side = np.array([1.0] * len(TERMS_13.positive) + [0.0] * len(TERMS_13.negative), np.float32)
    encoder, decoder = sessions['image_encoder'], sessions['decoder']
    names = [each.name for each in encoder.graph.outputs]
    text(texts)
    warm, watch = Stopwatch(), Stopwatch()
    for index, frame in enumerate([frames[0], *frames]):
        clock = watch if index else warm
        with clock.stage('preprocessing'):
            pixels = preprocess(frame.image_rgb)
        with clock.stage('image encoder'):
            features = encoder.run(names, {PIXEL_VALUES: pixels})
        feeds = dict(zip(names, features, strict=True))
        feeds.update({TEXT_EMBEDDING: text(texts), IS_POSITIVE: side})
        with clock.stage('decoder, 13 terms'):
            decoder.run(['positive', 'negative'], feeds)
    with watch.stage('13 new texts, off the path'):
        text([_STATIC.text_for(f'{term} in autumn') for term in TERMS_13.all])
    return watch.spreads()


def measure_memory(**setup_values: Any) -> Measured:
    """Run a few frames and tell the peak memory."""
    setup = Setup(**setup_values)
    segmenter = _segmenter(setup, TERMS_13)
    watch = Stopwatch()
    for frame in draw_frames(setup.frames):
        with watch.stage('frame'):
            segmenter.segment(frame, _STATIC)
    how = f'{Bundle.load(setup.clipseg).manifest.precision}, {setup.provider}'
    busy = watch.processor_p50('frame')
    return Measured('peace_ros', how, watch.spreads(), setup.frames, peak_rss_mb(), busy)


def measure_blabberseg(**setup_values: Any) -> Measured:
    """Encode the image once with 10 layers, run the decoder per term, prompts static."""
    setup = Setup(**setup_values)
    bundle = Bundle.load(Path(setup.clipseg))
    roles = ('image_encoder', 'text_encoder', 'decoder')
    sessions = open_sessions(bundle, roles, threads=setup.threads, providers=(setup.provider,))
    encoder, decoder = sessions['image_encoder'], sessions['decoder']
    names = [each.name for each in encoder.graph.outputs]
    texts = [_STATIC.text_for(term) for term in TERMS_13.all]
    embeddings = TextEncoder(bundle, sessions['text_encoder'])(texts)
    preprocess = Preprocessor(bundle.manifest.input)
    one = np.ones(1, np.float32)
    frames = draw_frames(setup.frames)
    warm, watch = Stopwatch(), Stopwatch()
    for index, frame in enumerate([frames[0], *frames]):
        with (watch if index else warm).stage('frame'):
            feeds: dict[str, NDArray[Any]] = {PIXEL_VALUES: preprocess(frame.image_rgb)}
            features = dict(zip(names, encoder.run(names, feeds), strict=True))
            maps = []
            for row in embeddings:
                feeds = {**features, TEXT_EMBEDDING: row[None], IS_POSITIVE: one}
                (logits,) = decoder.run([TERM_LOGITS], feeds)
                maps.append(0.5 * np.tanh(0.5 * logits[0]) + 0.5)
            count = len(TERMS_13.positive)
            set_difference(np.max(maps[:count], axis=0), np.max(maps[count:], axis=0))
    how = f'{bundle.manifest.precision}, {setup.provider}'
    busy = watch.processor_p50('frame')
    return Measured('BlabberSeg', how, watch.spreads(), len(frames), peak_rss_mb(), busy)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ways that others run the networks, on torch; needs the ``export`` extra.

CLIPSeg as PEACE's released code runs it: for each frame CLIP ViT-L/14 ranks the words, then Hugging
Face's CLIPSeg gets the image once per term, with the term's text, padded to 77 tokens and encoded
anew.

FastSAM with one CLIP call per segment, with the random weights of this project's bundle: the
segmenter, the 50 planted segments, and CLIP ViT-B/32 of Hugging Face in fp32. Each call gets the
segment's crop through CLIP's own image processor and all texts, padded to 77 tokens, and so encodes
them anew; the second way leaves the texts out and tells what batching and int8 alone give.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil
from transformers.models.vit.image_processing_pil_vit import ViTImageProcessorPil

from peace_ros.core.domain import Frame
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.core.prompting import load_vocabularies
from peace_ros.core.prompting.vocabulary import CATEGORIES
from peace_ros.core.segmentation import FastSamParameters
from peace_ros.core.segmentation.fastsam.letterbox import Letterbox
from peace_ros.core.segmentation.fastsam.masks import Segment, assemble, detect
from peace_ros.core.segmentation.fastsam.selection import select
from peace_ros.lab.benchmark.bundles import SEGMENTS
from peace_ros.lab.benchmark.measure import Measured, Stopwatch
from peace_ros.lab.benchmark.scene import TERMS_13, draw_frames
from peace_ros.lab.export.random_fastsam import random_fastsam
from peace_ros.lab.export.random_models import random_clip, random_clipseg
from peace_ros.lab.export.sources import ModelSource, from_model, load_source

RANDOM = 'random'
_CONTEXT = 77
_WARM_UP_CALLS = 3


def _padded(tokenizer: Tokenizer, texts: Sequence[str]) -> dict[str, torch.Tensor]:
    tokens = tokenizer(tuple(texts))
    extra = ((0, 0), (0, _CONTEXT - tokens.input_ids.shape[1]))
    ids = np.pad(tokens.input_ids, extra, constant_values=int(tokens.input_ids.max()))
    return {
        'input_ids': torch.from_numpy(ids),
        'attention_mask': torch.from_numpy(np.pad(tokens.attention_mask, extra)),
    }


class _ClipSegReference:
    def __init__(self, clipseg: ModelSource, clip: ModelSource, tokenizer: Tokenizer) -> None:
        self._clipseg, self._clip, self._tokenizer = clipseg.model, clip.model, tokenizer
        spec = clipseg.input
        self._clipseg_images = ViTImageProcessorPil(
            size={'height': spec.height, 'width': spec.width},
            resample=2,
            image_mean=list(spec.mean),
            image_std=list(spec.std),
        )
        self._clip_images = CLIPImageProcessorPil()
        vocabularies = load_vocabularies()
        self._words = {name: vocabularies.words(name) for name in CATEGORIES}
        self._embedded = {
            name: self._clip.get_text_features(**_padded(tokenizer, words)).pooler_output
            for name, words in self._words.items()
        }

    def rank(self, image: Image.Image) -> dict[str, str]:
        pixels = self._clip_images(image, return_tensors='pt')['pixel_values']
        features = self._clip.get_image_features(pixels).pooler_output
        best = {}
        for name, words in self._words.items():
            scores = torch.nn.functional.cosine_similarity(self._embedded[name], features)
            best[name] = words[int(scores.argmax())]
        return best

    def segment(self, image: Image.Image, words: dict[str, str]) -> torch.Tensor:
        template = 'A {resolution} {frame} of {term} in {environment}.'
        texts = tuple(template.format(term=term, **words) for term in TERMS_13.all)
        pixels = self._clipseg_images([image] * len(texts), return_tensors='pt')['pixel_values']
        tokens = _padded(self._tokenizer, texts)
        chances = torch.sigmoid(self._clipseg(**tokens, pixel_values=pixels).logits)
        count = len(TERMS_13.positive)
        negative = chances[count:].amax(dim=0)
        return torch.minimum(chances[:count].amax(dim=0), 1.0 - negative)


def measure_clipseg(
    source: str, clip_source: str, tokenizer_bundle: str, threads: int, count: int
) -> Measured:
    """Time CLIPSeg as PEACE's released code runs it.

    Args:
        source: of CLIPSeg, as ``peace models export`` takes it, or ``random``.
        clip_source: of the CLIP that ranks, likewise.
        tokenizer_bundle: folder of a bundle with CLIP's tokenizer.
        threads: CPU threads.
        count: frames; one more warms up.
    """
    torch.set_num_threads(threads)
    clipseg = (
        from_model('clipseg-rd64', 'clipseg', random_clipseg())
        if source == RANDOM
        else load_source(source)
    )
    clip = (
        from_model('clip-vit-l-14', 'clip', random_clip('ViT-L/14'))
        if clip_source == RANDOM
        else load_source(clip_source)
    )
    tokenizer = Tokenizer(Path(tokenizer_bundle) / 'tokenizer.json', clipseg.context_length)
    watch = Stopwatch()
    with torch.inference_mode():
        reference = _ClipSegReference(clipseg, clip, tokenizer)
        for frame, stage in watch.warmed(draw_frames(count)):
            with stage('frame'):
                image = Image.fromarray(frame.image_rgb)
                with stage('prompt'):
                    words = reference.rank(image)
                with stage('segment'):
                    reference.segment(image, words)
    return watch.measured('reference (Hugging Face)', 'fp32, torch')


class _FastSamReference:
    def __init__(self, bundle: Bundle, network: torch.nn.Module, clip: torch.nn.Module) -> None:
        self._network, self._clip = network, clip
        self._letterbox = Letterbox(bundle.manifest.input)
        self._processor = CLIPImageProcessorPil()
        tokenizer = Tokenizer(bundle.paths['tokenizer'], _CONTEXT)
        self._texts = _padded(tokenizer, [f'A photo of {term}.' for term in TERMS_13.all])
        self._embedded = self._clip.get_text_features(**self._texts).pooler_output

    def find(self, frame: Frame) -> tuple[list[Segment], NDArray[np.uint8]]:
        """Return the segments and the frame at their resolution."""
        parameters = FastSamParameters()
        pixels, place = self._letterbox(frame.image_rgb)
        predictions, prototypes = self._network(torch.from_numpy(pixels))
        found = detect(
            predictions[0].numpy(),
            min_confidence=parameters.fastsam_min_confidence,
            max_overlap=parameters.fastsam_max_overlap,
        )
        cell_px = pixels.shape[-1] // prototypes.shape[-1]
        segments = assemble(found, prototypes[0].numpy(), cell_px, place)
        image = Image.fromarray(frame.image_rgb).resize((place.width_px, place.height_px))
        frame_px = place.width_px * place.height_px
        return select(segments, frame_px, parameters).scored, np.asarray(image)

    def score(
        self, image: NDArray[np.uint8], segment: Segment, *, with_texts: bool
    ) -> torch.Tensor:
        """Return a segment's share of every term."""
        crop = image[segment.slices] * segment.mask[:, :, None]
        pixels = self._processor(Image.fromarray(crop), return_tensors='pt')['pixel_values']
        if with_texts:
            logits = self._clip(**self._texts, pixel_values=pixels).logits_per_image
        else:
            features = self._clip.get_image_features(pixels).pooler_output
            logits = 100.0 * torch.nn.functional.cosine_similarity(features, self._embedded)
        return logits.flatten().softmax(0)


def measure_fastsam(
    bundle: str, threads: int, count: int, calls: int, *, with_texts: bool
) -> Measured:
    """Time FastSAM with one CLIP call per segment.

    Args:
        bundle: folder of the bundle with the same random weights, for tokenizer and sizes.
        threads: CPU threads.
        count: frames.
        calls: how many calls of a frame are made; each segment counts as long as these took on
            average, so with as many as there are segments, a frame takes what it took.
        with_texts: whether each call encodes the texts too.
    """
    torch.set_num_threads(threads)
    opened = Bundle.load(Path(bundle))
    network = random_fastsam('s', side_px=opened.manifest.input.width, planted=SEGMENTS)
    watch = Stopwatch()
    with torch.inference_mode():
        reference = _FastSamReference(opened, network, random_clip('ViT-B/32'))
        frames = draw_frames(count)
        segments, image = reference.find(frames[0])
        for segment in segments[:_WARM_UP_CALLS]:
            reference.score(image, segment, with_texts=with_texts)
        for frame in frames:
            with watch.stage('segmenter and masks'):
                segments, image = reference.find(frame)
            for segment in segments[:calls]:
                with watch.stage('one CLIP call'):
                    reference.score(image, segment, with_texts=with_texts)
            made = min(calls, len(segments))
            for times in (watch.times_ms, watch.processor_ms):
                per_call = float(np.mean(times['one CLIP call'][-made:]))
                times['frame'].append(times['segmenter and masks'][-1] + len(segments) * per_call)
    what = 'image and 13 texts' if with_texts else 'image alone'
    return watch.measured(
        f'one CLIP call per segment, {what}',
        f'fp32, torch, {made} of {len(segments)} calls timed',
        segments_per_frame=len(segments),
    )

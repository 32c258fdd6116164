# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reference path, as PEACE's released code runs the networks; needs the ``export`` extra.

For each frame CLIP ViT-L/14 ranks the words, then Hugging Face's CLIPSeg gets the image once per
term, together with the term's text, padded to 77 tokens and encoded anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from PIL import Image
from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil
from transformers.models.vit.image_processing_pil_vit import ViTImageProcessorPil

from peace_ros.core.domain import Frame
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.core.prompting import load_vocabularies
from peace_ros.core.prompting.vocabulary import CATEGORIES
from peace_ros.lab.benchmark.measure import Measured, Stopwatch, peak_rss_mb
from peace_ros.lab.benchmark.scene import TERMS_13, draw_frames
from peace_ros.lab.export.random_models import random_clip, random_clipseg
from peace_ros.lab.export.sources import ModelSource, from_model, load_source

RANDOM = 'random'


class _Reference:
    def __init__(self, clipseg: ModelSource, clip: ModelSource, tokenizer: Tokenizer) -> None:
        self._clipseg, self._clip, self._tokenizer = clipseg.model, clip.model, tokenizer
        self._length = clipseg.context_length
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
            name: self._clip.get_text_features(*self._padded(words)).pooler_output
            for name, words in self._words.items()
        }

    def _padded(self, texts: tuple[str, ...]) -> tuple[torch.Tensor, torch.Tensor]:
        tokens = self._tokenizer(texts)
        extra = ((0, 0), (0, self._length - tokens.input_ids.shape[1]))
        ids = np.pad(tokens.input_ids, extra, constant_values=int(tokens.input_ids.max()))
        return torch.from_numpy(ids), torch.from_numpy(np.pad(tokens.attention_mask, extra))

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
        ids, mask = self._padded(texts)
        logits = self._clipseg(input_ids=ids, attention_mask=mask, pixel_values=pixels).logits
        chances = torch.sigmoid(logits)
        count = len(TERMS_13.positive)
        negative = chances[count:].amax(dim=0)
        return torch.minimum(chances[:count].amax(dim=0), 1.0 - negative)


def measure_reference(
    source: str, clip_source: str, tokenizer_bundle: str, threads: int, count: int
) -> Measured:
    """Time the reference path.

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
        reference = _Reference(clipseg, clip, tokenizer)
        frames: list[Frame] = draw_frames(count)
        for index, frame in enumerate([frames[0], *frames]):
            clock = watch if index else Stopwatch()
            with clock.stage('frame'):
                image = Image.fromarray(frame.image_rgb)
                with clock.stage('prompt'):
                    words = reference.rank(image)
                with clock.stage('segment'):
                    reference.segment(image, words)
    return Measured(
        'reference (Hugging Face)',
        'fp32, torch',
        watch.spreads(),
        count,
        peak_rss_mb(),
        watch.processor_p50('frame'),
    )

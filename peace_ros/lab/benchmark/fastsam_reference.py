# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FastSAM with one CLIP call per segment, on torch; needs the ``export`` extra.

The same random weights as this project's bundle: the segmenter, the 50 planted segments, and CLIP
ViT-B/32 of Hugging Face in fp32. Each call gets the segment's crop through CLIP's own image
processor and all texts, padded to 77 tokens, and so encodes them anew; the second way leaves the
texts out and tells what batching and int8 alone give.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil

from peace_ros.core.domain import Frame
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.core.segmentation import FastSamParameters
from peace_ros.core.segmentation.fastsam import Letterbox, Segment, assemble, detect
from peace_ros.core.segmentation.fastsam.selection import select
from peace_ros.lab.benchmark.bundles import SEGMENTS
from peace_ros.lab.benchmark.measure import Measured, Stopwatch, peak_rss_mb
from peace_ros.lab.benchmark.scene import TERMS_13, draw_frames
from peace_ros.lab.export.random_fastsam import random_fastsam
from peace_ros.lab.export.random_models import random_clip

_CONTEXT = 77
_WARM_UP_CALLS = 3


class _FastSamReference:
    def __init__(self, bundle: Bundle, network: torch.nn.Module, clip: torch.nn.Module) -> None:
        self._network, self._clip = network, clip
        self._letterbox = Letterbox(bundle.manifest.input)
        self._processor = CLIPImageProcessorPil()
        texts = tuple(f'A photo of {term}.' for term in TERMS_13.all)
        tokens = Tokenizer(bundle.paths['tokenizer'], _CONTEXT)(texts)
        extra = ((0, 0), (0, _CONTEXT - tokens.input_ids.shape[1]))
        end = int(tokens.input_ids.max())
        self._texts = {
            'input_ids': torch.from_numpy(np.pad(tokens.input_ids, extra, constant_values=end)),
            'attention_mask': torch.from_numpy(np.pad(tokens.attention_mask, extra)),
        }
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
        crop = image[segment.rows, segment.columns] * segment.mask[:, :, None]
        pixels = self._processor(Image.fromarray(crop), return_tensors='pt')['pixel_values']
        if with_texts:
            logits = self._clip(**self._texts, pixel_values=pixels).logits_per_image
        else:
            features = self._clip.get_image_features(pixels).pooler_output
            logits = 100.0 * torch.nn.functional.cosine_similarity(features, self._embedded)
        return logits.flatten().softmax(0)


def measure_reference(
    fastsam: str, threads: int, count: int, calls: int, *, with_texts: bool
) -> Measured:
    """Time one CLIP call per segment.

    Args:
        fastsam: folder of the bundle with the same random weights, for tokenizer and sizes.
        threads: CPU threads.
        count: frames.
        calls: how many calls of a frame are made; each segment counts as long as these took on
            average, so with as many as there are segments, a frame takes what it took.
        with_texts: whether each call encodes the texts too.
    """
    torch.set_num_threads(threads)
    bundle = Bundle.load(Path(fastsam))
    network = random_fastsam('s', side_px=bundle.manifest.input.width, planted=SEGMENTS)
    watch = Stopwatch()
    with torch.inference_mode():
        reference = _FastSamReference(bundle, network, random_clip('ViT-B/32'))
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
    return Measured(
        f'one CLIP call per segment, {what}',
        f'fp32, torch, {made} of {len(segments)} calls timed',
        watch.spreads(),
        count,
        peak_rss_mb(),
        watch.processor_p50('frame'),
        {'segments_per_frame': len(segments)},
    )

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Training of the CLIPSeg-like segmenter."""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from peace_ros.lab.training.backbone import load_pretrained
from peace_ros.lab.training.batches import Batch, encode, pixel_class_table, wanted_labels
from peace_ros.lab.training.losses import class_loss, class_weights, prompt_loss, shares
from peace_ros.lab.training.networks import SegmenterNetwork
from peace_ros.lab.training.text import sample_prompt, vocabulary

BATCH_SIZE = 8
VIEW_PX = 320
PROMPTS = 6
PEAK_RATE = 2e-3
PRETRAINED = ('encoder.backbone.', 0.25)
"""What was learned on ImageNet changes slowly: at this part of the rate."""
SHARES = {'drawn': 0.42, 'satellite': 0.2, 'drone': 0.38}


def create_segmenter(seed: int) -> SegmenterNetwork:
    """Return a segmenter that knows ImageNet; its other weights follow from the seed."""
    torch.manual_seed(seed)
    model = SegmenterNetwork(len(vocabulary()))
    load_pretrained(model.encoder.backbone)
    # Convolutions on this memory order are the fastest on CPUs; the stubs do not know it.
    return cast('SegmenterNetwork', model.to(memory_format=torch.channels_last))  # type: ignore[call-overload]


def teach_text(
    model: SegmenterNetwork, seed: int, steps: int = 600, batch_size: int = 192
) -> float:
    """Teach the text tower which labels a prompt stands for, before any image is seen.

    Learning this through pixels takes most of an hour; alone it takes seconds. Returns the last
    loss.
    """
    rng = np.random.default_rng([seed, 9])
    threads = torch.get_num_threads()
    # Products this small lose more to waiting for each other than they win.
    torch.set_num_threads(1)
    parameters = [*model.text.parameters(), *model.decoder.meaning.parameters()]
    optimiser = torch.optim.AdamW(parameters, lr=5e-3, weight_decay=1e-3)
    last = 0.0
    for step in range(steps):
        for group in optimiser.param_groups:
            group['lr'] = 5e-3 * (1.0 - 0.95 * step / steps)
        prompts = [sample_prompt(rng) for _ in range(batch_size)]
        texts = model.text(*encode([prompt.text for prompt in prompts]))
        loss = functional.binary_cross_entropy_with_logits(
            model.decoder.meaning_logits(texts), wanted_labels(prompts)
        )
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        last = loss.item()
    torch.set_num_threads(threads)
    return last


class SegmenterLoss:
    """Class loss and prompt loss of a batch."""

    def __init__(self) -> None:
        self._table = pixel_class_table()
        self._weights = class_weights()

    def __call__(self, segmenter: SegmenterNetwork, batch: Batch) -> dict[str, Tensor]:
        """Run the network in bfloat16 where the processor has it, the losses in float32."""
        with torch.autocast('cpu', dtype=torch.bfloat16):
            features = segmenter.encoder(batch.pixels)
        features = features.float()
        count = len(batch.views)
        text = segmenter.text(batch.input_ids, batch.attention_mask)
        text = text.reshape(count, -1, text.shape[-1])
        meaning = segmenter.decoder.meaning_logits(text)
        classes = segmenter.decoder.classes(features)
        logits = segmenter.decoder.mix(classes, features, text)
        share = shares(batch.classes)
        known = (self._table, self._weights)
        return {
            'class': class_loss(classes, share, *known),
            'prompt': prompt_loss(logits, share, batch.wanted, *known),
            'text': 0.3 * functional.binary_cross_entropy_with_logits(meaning, batch.wanted),
        }

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A bundle against the reference model, on the same images and texts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from peace_ros.core.domain import Frame
from peace_ros.core.inference import contract
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.session import Session, open_sessions
from peace_ros.core.inference.tokenizer import Tokenizer, Tokens
from peace_ros.lab.export import pictures
from peace_ros.lab.export.agreement import Agreement, cosine, mask_iou
from peace_ros.lab.export.precision import require_finite
from peace_ros.lab.export.sources import ModelSource

Array = NDArray[np.float32]

MOST_DIFFERENCE = 1e-3
"""Between logits, fp32."""
_SAFE = 0.5


@dataclass(frozen=True)
class ModelAgreement(Agreement):
    """How well a bundle and its reference agree; the worst picture's, unless it says otherwise."""

    difference: float
    """Largest absolute difference of a logit."""
    cosine: float
    """Cosine similarity of the logits (clipseg) or of the embeddings (clip)."""
    iou: float
    """Of the heatmaps Sf as fuzzy sets (clipseg); 1 for clip."""
    median_iou: float = 1.0
    """Of the masks Sf >= the reference's median, of all pictures together (clipseg): half of what
    they show, whatever the weights are. Not of each picture by itself, because a uniform one has no
    edge at its median, only noise."""
    mask_iou: float = 1.0
    """Of the masks Sf >= 0.5, of all pictures together (clipseg). Reported, not judged: with random
    weights a few per cent of a picture lie above one half, most of them near it, and the smallest
    error moves their edge."""
    pictures: int = 1
    """Number of images."""

    MOST = MappingProxyType({'difference': MOST_DIFFERENCE})
    LEAST = MappingProxyType({**Agreement.LEAST, 'median_iou': Agreement.LEAST['iou']})


class Answers(NamedTuple):
    """Of one picture; clip has no heatmaps."""

    difference: float
    cosine: float
    have: NDArray[Any] | None = None
    """Sf of the bundle."""
    wanted: NDArray[Any] | None = None
    """Sf of the reference."""


def compare(source: ModelSource, bundle: Bundle, frames: Sequence[Frame]) -> ModelAgreement:
    """Run both over the frames and the sentences of :mod:`pictures`; raises BundleError."""
    roles = [role for role in bundle.paths if role != 'tokenizer']
    sessions = open_sessions(bundle, roles)
    tokenizer = Tokenizer(bundle.paths['tokenizer'], bundle.manifest.context_length)
    tokens = tokenizer(pictures.TEXTS)
    preprocess = Preprocessor(bundle.manifest.input)
    check = _compare_clipseg if source.family == 'clipseg' else _compare_clip
    found = [check(source.model, sessions, tokens, preprocess(each.image_rgb)) for each in frames]
    numbers = np.array([each[:2] for each in found])
    require_finite([numbers], bundle.manifest.precision, source.name)
    return agreement_of(found)


def agreement_of(found: Sequence[Answers]) -> ModelAgreement:
    """Judge all pictures."""
    difference = max(each.difference for each in found)
    least = min(each.cosine for each in found)
    pairs = [
        (each.have, each.wanted)
        for each in found
        if each.have is not None and each.wanted is not None
    ]
    if not pairs:
        return ModelAgreement(difference, least, 1.0, pictures=len(found))
    have, wanted = (np.stack(each) for each in zip(*pairs, strict=True))
    median = float(np.median(wanted))
    return ModelAgreement(
        difference,
        least,
        min(_iou(*pair) for pair in pairs),
        mask_iou(have >= median, wanted >= median),
        mask_iou(have >= _SAFE, wanted >= _SAFE),
        len(found),
    )


def _compare_clip(
    model: Any, sessions: Mapping[str, Session], tokens: Tokens, pixels: Array
) -> Answers:
    with torch.inference_mode():
        reference = model(**_torch_inputs(tokens), pixel_values=torch.from_numpy(pixels))
    texts = _text(sessions, tokens)
    (image,) = sessions['image_encoder'].run(
        [contract.IMAGE_EMBEDDING], {contract.PIXEL_VALUES: pixels}
    )
    units = [_unit(image), _unit(texts)]
    wanted = [reference.image_embeds.numpy(), reference.text_embeds.numpy()]
    logits = np.exp(model.logit_scale.item()) * units[0] @ units[1].T
    least = min(
        float((_unit(have) * _unit(want)).sum(axis=1).min())
        for have, want in zip(units, wanted, strict=True)
    )
    difference = float(np.abs(logits - reference.logits_per_image.numpy()).max())
    return Answers(difference, least)


def _compare_clipseg(
    model: Any, sessions: Mapping[str, Session], tokens: Tokens, pixels: Array
) -> Answers:
    count = len(tokens.input_ids)
    with torch.inference_mode():
        repeated = torch.from_numpy(pixels).expand(count, -1, -1, -1)
        reference = model(**_torch_inputs(tokens), pixel_values=repeated).logits.numpy()
    side = np.array(pictures.IS_POSITIVE, np.float32)
    encoder = sessions['image_encoder']
    names = [each.name for each in encoder.graph.outputs]
    features = encoder.run(names, {contract.PIXEL_VALUES: pixels})
    positive, negative, logits = sessions['decoder'].run(
        [contract.POSITIVE, contract.NEGATIVE, contract.TERM_LOGITS],
        {
            **dict(zip(names, features, strict=True)),
            contract.TEXT_EMBEDDING: _text(sessions, tokens),
            contract.IS_POSITIVE: side,
        },
    )
    # tanh never overflows, where exp would.
    chances = 0.5 * np.tanh(0.5 * reference.astype(np.float64)) + 0.5
    wanted = np.minimum(chances[side == 1].max(axis=0), 1.0 - chances[side == 0].max(axis=0))
    have = np.minimum(positive, 1.0 - negative)
    difference = float(np.abs(logits - reference).max())
    return Answers(difference, cosine(logits, reference), have, wanted)


def _iou(have: NDArray[Any], wanted: NDArray[Any]) -> float:
    """Return the IoU of two heatmaps as fuzzy sets: the sum of minima over that of maxima."""
    return float(np.minimum(have, wanted).sum() / np.maximum(have, wanted).sum())


def _text(sessions: Mapping[str, Session], tokens: Tokens) -> Array:
    feeds = {contract.INPUT_IDS: tokens.input_ids, contract.ATTENTION_MASK: tokens.attention_mask}
    return sessions['text_encoder'].run([contract.TEXT_EMBEDDING], feeds)[0]


def _torch_inputs(tokens: Tokens) -> dict[str, torch.Tensor]:
    return {
        contract.INPUT_IDS: torch.from_numpy(tokens.input_ids),
        contract.ATTENTION_MASK: torch.from_numpy(tokens.attention_mask),
    }


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit

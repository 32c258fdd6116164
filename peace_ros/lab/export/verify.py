# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A bundle against the reference model, on the same images and texts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.contract import (
    ATTENTION_MASK,
    IMAGE_EMBEDDING,
    INPUT_IDS,
    IS_POSITIVE,
    NEGATIVE,
    PIXEL_VALUES,
    POSITIVE,
    TERM_LOGITS,
    TEXT_EMBEDDING,
)
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.session import Session, open_sessions
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.lab.export import pictures
from peace_ros.lab.export.precision import require_finite

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from peace_ros.core.domain import Frame
    from peace_ros.core.inference.bundle import Bundle
    from peace_ros.core.inference.tokenizer import Tokens
    from peace_ros.lab.export.sources import ModelSource

    Array = NDArray[np.float32]

MOST_DIFFERENCE = 1e-3
"""Between logits, fp32."""
LEAST_COSINE = 0.999
LEAST_IOU = 0.98
"""Both for fp16 and int8."""
_SAFE = 0.5


@dataclass(frozen=True)
class Agreement:
    """How well a bundle and its reference agree; of the worst picture, unless it says otherwise."""

    difference: float
    """Largest absolute difference of a logit."""
    cosine: float
    """Cosine similarity of the logits (clipseg) or of the embeddings (clip)."""
    iou: float
    """Of the heatmaps Sf as fuzzy sets (clipseg); 1 for clip."""
    median_iou: float = 1.0
    """Of the masks Sf >= the reference's median, of all pictures together (clipseg): half of what
    they show, whatever the weights say. Not of each picture by itself, because one that looks the
    same everywhere has no edge at its median, only noise."""
    mask_iou: float = 1.0
    """Of the masks Sf >= 0.5, of all pictures together (clipseg). Told, not judged: with random
    weights a few per cent of a picture lie above one half, most of them near it, and the smallest
    error moves their edge."""
    pictures: int = 1
    """Number of images."""

    def refuse_if_poor(self, precision: str, what: str) -> None:
        """Raise BundleError when the bundle must not be used."""
        if precision == 'fp32':
            is_good = self.difference <= MOST_DIFFERENCE
            limit = f'at most {MOST_DIFFERENCE} is allowed'
        else:
            is_good = self.cosine >= LEAST_COSINE and min(self.iou, self.median_iou) >= LEAST_IOU
            limit = f'a cosine of {LEAST_COSINE} and both IoUs of {LEAST_IOU} are needed'
        if not is_good:
            raise BundleError(
                f'{what} in {precision} does not agree with its reference: logits differ by '
                f'{self.difference:.2g}, cosine {self.cosine:.5f}, IoU of heatmaps {self.iou:.4f}, '
                f'of masks at the median {self.median_iou:.4f}; {limit}. '
                'Nothing was written; choose a higher precision, or more pictures like those '
                'of the flight'
            )

    def __str__(self) -> str:
        return (
            f'largest difference {self.difference:.1e}, cosine {self.cosine:.6f}, '
            f'IoU {self.iou:.4f} (masks at the median {self.median_iou:.4f}, at one half '
            f'{self.mask_iou:.3f}), {self.pictures} pictures'
        )

    def as_numbers(self) -> dict[str, float]:
        """Return what a manifest keeps."""
        return {name: round(float(value), 7) for name, value in asdict(self).items()}


class Answers(NamedTuple):
    """Of one picture; clip has no heatmaps."""

    difference: float
    cosine: float
    have: NDArray[Any] | None = None
    """Sf of the bundle."""
    wanted: NDArray[Any] | None = None
    """Sf of the reference."""


def compare(source: ModelSource, bundle: Bundle, frames: Sequence[Frame]) -> Agreement:
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


def agreement_of(found: Sequence[Answers]) -> Agreement:
    """Judge all pictures."""
    difference = max(each.difference for each in found)
    cosine = min(each.cosine for each in found)
    pairs = [
        (each.have, each.wanted)
        for each in found
        if each.have is not None and each.wanted is not None
    ]
    if not pairs:
        return Agreement(difference, cosine, 1.0, pictures=len(found))
    have, wanted = (np.stack(each) for each in zip(*pairs, strict=True))
    return Agreement(
        difference,
        cosine,
        min(_iou(*pair) for pair in pairs),
        _mask_iou(have, wanted, float(np.median(wanted))),
        _mask_iou(have, wanted, _SAFE),
        len(found),
    )


def _compare_clip(
    model: Any, sessions: Mapping[str, Session], tokens: Tokens, pixels: Array
) -> Answers:
    with torch.inference_mode():
        reference = model(**_torch_inputs(tokens), pixel_values=torch.from_numpy(pixels))
    texts = _text(sessions, tokens)
    (image,) = sessions['image_encoder'].run([IMAGE_EMBEDDING], {PIXEL_VALUES: pixels})
    units = [_unit(image), _unit(texts)]
    wanted = [reference.image_embeds.numpy(), reference.text_embeds.numpy()]
    logits = np.exp(model.logit_scale.item()) * units[0] @ units[1].T
    cosine = min(
        float((_unit(have) * _unit(want)).sum(axis=1).min())
        for have, want in zip(units, wanted, strict=True)
    )
    difference = float(np.abs(logits - reference.logits_per_image.numpy()).max())
    return Answers(difference, cosine)


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
    features = encoder.run(names, {PIXEL_VALUES: pixels})
    positive, negative, logits = sessions['decoder'].run(
        [POSITIVE, NEGATIVE, TERM_LOGITS],
        {
            **dict(zip(names, features, strict=True)),
            TEXT_EMBEDDING: _text(sessions, tokens),
            IS_POSITIVE: side,
        },
    )
    # tanh never overflows, where exp would.
    chances = 0.5 * np.tanh(0.5 * reference.astype(np.float64)) + 0.5
    wanted = np.minimum(chances[side == 1].max(axis=0), 1.0 - chances[side == 0].max(axis=0))
    have = np.minimum(positive, 1.0 - negative)
    flat, want = logits.ravel().astype(np.float64), reference.ravel().astype(np.float64)
    cosine = float(flat @ want / (np.linalg.norm(flat) * np.linalg.norm(want)))
    difference = float(np.abs(logits - reference).max())
    return Answers(difference, cosine, have, wanted)


def _iou(have: NDArray[Any], wanted: NDArray[Any]) -> float:
    """Return the IoU of two heatmaps as fuzzy sets: the sum of minima over that of maxima."""
    return float(np.minimum(have, wanted).sum() / np.maximum(have, wanted).sum())


def _mask_iou(have: NDArray[Any], wanted: NDArray[Any], least: float) -> float:
    """Return the IoU of what scores at least so much; 1 where nothing does."""
    one, other = have >= least, wanted >= least
    either = int((one | other).sum())
    return float((one & other).sum() / either) if either else 1.0


def _text(sessions: Mapping[str, Session], tokens: Tokens) -> Array:
    feeds = {INPUT_IDS: tokens.input_ids, ATTENTION_MASK: tokens.attention_mask}
    return sessions['text_encoder'].run([TEXT_EMBEDDING], feeds)[0]


def _torch_inputs(tokens: Tokens) -> dict[str, torch.Tensor]:
    return {
        INPUT_IDS: torch.from_numpy(tokens.input_ids),
        ATTENTION_MASK: torch.from_numpy(tokens.attention_mask),
    }


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit

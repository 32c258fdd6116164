# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Losses of the segmenter and of the pair that names segments."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from peace_ros.core.segmentation import load_terms
from peace_ros.lab.training.batches import encode, pixel_class_table, wanted_labels
from peace_ros.lab.training.instances import networks
from peace_ros.lab.training.instances.batches import CropBatch, InstanceBatch
from peace_ros.lab.training.instances.targets import IGNORED, NOTHING
from peace_ros.lab.training.losses import class_loss, class_weights, shares
from peace_ros.lab.training.networks import Pair
from peace_ros.lab.training.text import TEMPLATES, TERMS, TermPrompt

ANCHORS_PER_INSTANCE = 9
MASKS_PER_VIEW = 28
_LEAST_QUALITY = 0.5
"""What the best anchor of an instance aims at while its box is still bad."""
_MARGIN = (0.45, 16.0)
"""Around a box, where its mask must still be right: share of its size, and pixels."""
_SAME_CLASS = 0.1
"""Weight of cells of another part of the same class: in one mask they are harmless."""
_HAZARD_WEIGHT = 1.6


def overlaps(first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    """Return intersection over union, and its generalised form, of boxes [..., 4] (corners)."""
    low = torch.maximum(first[..., :2], second[..., :2])
    high = torch.minimum(first[..., 2:], second[..., 2:])
    shared = (high - low).clamp(min=0.0).prod(dim=-1)
    areas = [(each[..., 2:] - each[..., :2]).prod(dim=-1) for each in (first, second)]
    union = areas[0] + areas[1] - shared + 1e-6
    hull = torch.maximum(first[..., 2:], second[..., 2:]) - torch.minimum(
        first[..., :2], second[..., :2]
    )
    around = hull.prod(dim=-1) + 1e-6
    iou = shared / union
    return iou, iou - (around - union) / around


def _corners(boxes: Tensor) -> Tensor:
    half = boxes[..., 2:] / 2.0
    return torch.cat([boxes[..., :2] - half, boxes[..., :2] + half], dim=-1)


class InstanceLoss:
    """Confidence, boxes, masks and classes of a batch.

    Of the anchors inside an instance those predict it that lie deepest, are most confident and have
    the best boxes (after TOOD, Feng et al., ICCV 2021); the confidence learns how good they are.
    """

    def __init__(self) -> None:
        self._table = pixel_class_table()
        self._weights = class_weights()

    def __call__(
        self, network: networks.InstanceNetwork, batch: InstanceBatch
    ) -> dict[str, Tensor]:
        """Run the network in bfloat16 where the processor has it, the losses in float32."""
        with torch.autocast('cpu', dtype=torch.bfloat16):
            raw = network(batch.pixels)
        raw = raw.to_float()
        anchors = networks.anchor_points(batch.pixels.shape[-1])
        boxes = networks.decode_boxes(raw.boxes, anchors)
        wanted = _wanted_boxes(batch)
        iou, generous = overlaps(_corners(boxes), wanted)
        quality = _assign(batch, raw.logits, iou)
        total = quality.sum().clamp(min=1.0)
        judged = (batch.owners != IGNORED).to(torch.float32)
        confidence = functional.binary_cross_entropy_with_logits(
            raw.logits, quality, weight=judged, reduction='sum'
        )
        sizes = (wanted[..., 2:] - wanted[..., :2]).clamp(min=4.0)
        corners = (_corners(boxes) - wanted).abs() / torch.cat([sizes, sizes], dim=-1)
        off = (1.0 - generous) + functional.smooth_l1_loss(
            corners, torch.zeros_like(corners), beta=0.1, reduction='none'
        ).mean(dim=-1)
        return {
            'confidence': confidence / total,
            'box': 2.0 * (off * quality).sum() / total,
            'mask': 2.0 * self._mask_loss(batch, raw, quality),
            'class': 0.7
            * class_loss(raw.classes, shares(batch.classes), self._table, self._weights),
        }

    def _mask_loss(self, batch: InstanceBatch, raw: networks.Raw, quality: Tensor) -> Tensor:
        """Return cross-entropy and overlap loss (dice) of masks inside of their true boxes."""
        losses = []
        middles = slice(networks.CELL_PX // 2, None, networks.CELL_PX)
        cells = batch.classes[:, middles, middles]
        for view, prototypes in enumerate(raw.prototypes):
            chosen = quality[view].nonzero()[:, 0]
            if not len(chosen):
                continue
            chosen = chosen[torch.randperm(len(chosen))[:MASKS_PER_VIEW]]
            owner = batch.owners[view, chosen] - 1
            logits = raw.coefficients[view, chosen] @ prototypes.flatten(1)
            logits = logits.reshape(-1, *prototypes.shape[1:])
            target = batch.masks[view][owner].to(torch.float32) / 255.0
            inside = _inside(batch.boxes[view][owner], logits.shape[-1])
            same = (cells[view] == batch.kinds[view][owner][:, None, None]) & (target < 0.05)
            inside = inside * torch.where(same, _SAME_CLASS, 1.0)
            each = functional.binary_cross_entropy_with_logits(logits, target, reduction='none')
            area = inside.sum(dim=(1, 2)).clamp(min=1.0)
            cross = (each * inside).sum(dim=(1, 2)) / area
            chance = logits.sigmoid()
            hit = (chance * target * inside).sum(dim=(1, 2))
            both = ((chance + target) * inside).sum(dim=(1, 2))
            losses.append(cross + 0.5 * (1.0 - (2.0 * hit + 1.0) / (both + 1.0)))
        return torch.cat(losses).mean() if losses else raw.prototypes.sum() * 0.0


def _wanted_boxes(batch: InstanceBatch) -> Tensor:
    """Return the box of each anchor's instance: [B, A, 4]; of anchors without one, a unit box."""
    rows = []
    for owners, boxes in zip(batch.owners, batch.boxes, strict=True):
        known = torch.cat([torch.tensor([[0.0, 0.0, 1.0, 1.0]]), boxes])
        rows.append(known[owners.clamp(min=0)])
    return torch.stack(rows)


def _assign(batch: InstanceBatch, logits: Tensor, iou: Tensor) -> Tensor:
    """Return what the confidence of each anchor should be: [B, A], 0 for most."""
    with torch.no_grad():
        most = max(1, *(len(boxes) for boxes in batch.boxes))
        numbers = torch.arange(1, most + 1)[None, :, None]
        owned = batch.owners[:, None, :] == numbers
        fit = batch.priors * (iou + 0.05).square() * (logits.sigmoid() + 0.02).sqrt()
        fits = torch.where(owned, fit[:, None, :], 0.0)
        best, where = fits.topk(ANCHORS_PER_INSTANCE, dim=2)
        chosen = torch.zeros_like(fits).scatter_(2, where, best)
        share = chosen / chosen.amax(dim=2, keepdim=True).clamp(min=1e-9)
        boxes = torch.where(owned, iou[:, None, :], 0.0).amax(dim=2, keepdim=True)
        return (share * boxes.clamp(min=_LEAST_QUALITY)).amax(dim=1) * (batch.owners > NOTHING)


def _inside(boxes: Tensor, cells: int) -> Tensor:
    """Tell the cells within boxes (corners) and the margin around them: float32 [N, h, w]."""
    sizes = boxes[:, 2:] - boxes[:, :2]
    grown = networks.widen(torch.cat([(boxes[:, :2] + boxes[:, 2:]) / 2.0, sizes], dim=1), *_MARGIN)
    left, top, right, bottom = (_corners(grown) / networks.CELL_PX).unbind(dim=1)
    at = torch.arange(cells) + 0.5
    x = (at > left[:, None]) & (at < right[:, None])
    y = (at > top[:, None]) & (at < bottom[:, None])
    return (y[:, :, None] & x[:, None, :]).to(torch.float32)


class MatchLoss:
    """How segments divide among prompts: random ones, and the terms that the package ships."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 23])
        meanings = {term.strip(): labels for labels, group in TERMS for term in group.split(';')}
        self._terms = load_terms().all
        self._wanted = wanted_labels([TermPrompt(term, meanings[term]) for term in self._terms])

    def __call__(self, matcher: Pair, batch: CropBatch) -> dict[str, Tensor]:
        """Score all segments of the batch against both sets of prompts."""
        with torch.autocast('cpu', dtype=torch.bfloat16):
            maps = matcher.image.backbone(batch.pixels)
        image = matcher.image.describe(batch.pixels, [level.float() for level in maps.values()])
        template = TEMPLATES[int(self._rng.integers(len(TEMPLATES)))]
        slots = {'resolution': 'rendered', 'frame': 'view', 'environment': 'summer'}
        texts = [template.format(term=term, **slots) for term in self._terms]
        terms = matcher.text(*encode(texts))
        prompts = matcher.text(batch.input_ids, batch.attention_mask)
        scale = matcher.scale()
        return {
            'prompt': _divided(scale * image @ prompts.T, batch, batch.wanted),
            'term': _divided(scale * image @ terms.T, batch, self._wanted),
        }


def _divided(similar: Tensor, batch: CropBatch, wanted: Tensor) -> Tensor:
    """Return the loss of a softmax over prompts [N, T].

    The right prompts of a known label share the segment evenly; where a segment may be one of
    several labels, any division among their prompts will do.
    """
    right = (batch.labels @ wanted.T > 0.0).to(torch.float32)
    count = right.sum(dim=1)
    logs = functional.log_softmax(similar, dim=1)
    even = -(logs * right).sum(dim=1) / count.clamp(min=1.0)
    any_of = -(logs + (1.0 - right) * -1e4).logsumexp(dim=1)
    # A mixed set of few right words among many: the union counts beside the even division.
    each = torch.where(batch.known > 0.0, 0.5 * even + any_of, any_of)
    hazard = (batch.labels[:, :2].sum(dim=1) == 0.0).to(torch.float32)
    weight = (1.0 + hazard * (_HAZARD_WEIGHT - 1.0)) * (count > 0.0)
    return (each * weight).sum() / weight.sum().clamp(min=1.0)

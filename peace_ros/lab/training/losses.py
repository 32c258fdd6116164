# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Losses of the segmenter: wrong classes, wrong prompt masks, hazards called safe most of all."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from peace_ros.core.domain import Label
from peace_ros.lab.training import annotations
from peace_ros.lab.training.networks import STRIDE

_CLASS_WEIGHTS = {
    Label.GRASS: 1.0, Label.BARE_GROUND: 1.0, Label.PAVED: 1.0, Label.BUILDING: 1.1,
    Label.TREE: 1.6, Label.WATER: 1.5, Label.VEHICLE: 2.0, Label.PERSON: 14.0, Label.OBSTACLE: 4.0,
}  # fmt: skip
_PARTIAL_WEIGHTS = {
    annotations.VEGETATION: 0.6,
    annotations.LOOSE_SURFACE: 0.6,
    annotations.OPEN_GROUND: 0.8,
    annotations.NOT_SAFE: 1.0,
}
FALSE_SAFE_WEIGHT = 2.5
"""A hazard pixel that a safe-ground prompt selects costs this much more than a missed one."""


def class_weights() -> Tensor:
    """Return the weight of each pixel class: float32 [pixel classes]; unlabeled weighs nothing."""
    weights = torch.zeros(annotations.PIXEL_CLASS_COUNT)
    for index, weight in (_CLASS_WEIGHTS | _PARTIAL_WEIGHTS).items():
        weights[index] = weight
    return weights


def shares(classes: Tensor) -> Tensor:
    """Return how much of each feature cell is of each pixel class: [B, H, W] -> [B, P, h, w]."""
    one_hot = functional.one_hot(classes, annotations.PIXEL_CLASS_COUNT).permute(0, 3, 1, 2)
    return functional.avg_pool2d(one_hot.to(torch.float32), STRIDE)


def class_loss(logits: Tensor, share: Tensor, table: Tensor, weights: Tensor) -> Tensor:
    """Cross-entropy of the class head, summed over the labels that a pixel may be."""
    p = torch.einsum('pl,blhw->bphw', table, functional.softmax(logits, dim=1))
    partial = p.clamp(min=1e-6).log()
    weighted = share * weights[None, :, None, None]
    return -(weighted * partial).sum() / weighted.sum().clamp(min=1.0)


def prompt_loss(
    logits: Tensor, share: Tensor, wanted: Tensor, table: Tensor, weights: Tensor
) -> Tensor:
    """Binary cross-entropy of the prompt masks [B, T, h, w].

    A pixel counts as selected when all labels that it may be are wanted, as rejected when none
    is, and not at all in between.
    """
    sizes = table.sum(dim=1).clamp(min=1.0)
    hits = torch.einsum('btl,pl->btp', wanted, table) / sizes
    known = (weights > 0).to(torch.float32)
    selected = (hits > 0.999).to(torch.float32) * weights
    rejected = (hits < 0.001).to(torch.float32) * known
    safe_prompt = (wanted[:, :, 0] + wanted[:, :, 1] > 0).to(torch.float32)
    safe_prompt = safe_prompt * (wanted[:, :, 2:].sum(dim=2) == 0).to(torch.float32)
    hazard = (table[:, :2].sum(dim=1) == 0).to(torch.float32) * weights.clamp(min=1.0)
    factor = 1.0 + safe_prompt[:, :, None] * hazard * (FALSE_SAFE_WEIGHT - 1.0)
    flat = share.flatten(2)
    positive = torch.bmm(selected, flat).reshape_as(logits)
    negative = torch.bmm(rejected * factor, flat).reshape_as(logits)
    loss = positive * functional.softplus(-logits) + negative * functional.softplus(logits)
    return loss.sum() / (positive + negative).sum().clamp(min=1.0)

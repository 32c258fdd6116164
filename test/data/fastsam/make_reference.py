#!/usr/bin/env python3
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Write what ultralytics makes of some tensors: reference.npz, beside this file.

Run by hand, in an environment of its own with torch, torchvision and ultralytics (8.4.190 made the
stored file). Ultralytics is under AGPL-3.0: the package and its tests never import it, and what is
stored here is numbers only.

The tensors come from a FastSAM-s network (YOLOv8s-seg with one class) of random weights, its last
layers scaled until its boxes differ and overlap, and from boxes and prototypes that are drawn.
Prototypes are rounded to half precision before the reference sees them: the file stays small.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from ultralytics.data.augment import LetterBox
from ultralytics.nn.tasks import SegmentationModel
from ultralytics.utils.nms import non_max_suppression
from ultralytics.utils.ops import process_mask

SIDE_PX = 160
SPREAD_OF_BOXES, SPREAD_OF_SCORES, SPREAD_OF_MASKS = 3.0, 1.5, 1.0
"""Standard deviations over the anchors, of logits and coefficients."""


def blotches(rng: np.random.Generator, height_px: int, width_px: int) -> np.ndarray:
    """Return an RGB image of smooth random colours."""
    coarse = torch.from_numpy(rng.normal(128.0, 90.0, (1, 3, 6, 6)))
    fine = nn.functional.interpolate(coarse, (height_px, width_px), mode='bicubic')
    image: np.ndarray = fine[0].permute(1, 2, 0).clamp(0, 255).round().numpy().astype(np.uint8)
    return image


def random_network(rng: np.random.Generator) -> SegmentationModel:
    """Return a network whose detections differ from place to place."""
    model = SegmentationModel('yolov8s-seg.yaml', nc=1, verbose=False)
    for module in model.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = 0.3
    model.train()
    with torch.no_grad():
        # Statistics of real activations keep the signal alive through the depth of the network.
        for _ in range(12):
            images = np.stack([blotches(rng, SIDE_PX, SIDE_PX) for _ in range(4)])
            model(torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255.0)
    model.eval()
    head = model.model[-1]
    frame = torch.from_numpy(blotches(rng, SIDE_PX, SIDE_PX)).permute(2, 0, 1)[None].float() / 255.0
    with torch.no_grad():
        raw = model(frame)[1]
        for layers, output, spread in (
            (head.cv2, 'boxes', SPREAD_OF_BOXES),
            (head.cv3, 'scores', SPREAD_OF_SCORES),
            (head.cv4, 'mask_coefficient', SPREAD_OF_MASKS),
        ):
            gain = spread / (raw[output] - raw[output].mean(dim=2, keepdim=True)).std()
            for layer in layers:
                layer[-1].weight.mul_(gain)
                layer[-1].bias.zero_()
        for layer in head.cv2:
            # Nearer sides are likelier, as in a trained network; else all boxes are large.
            layer[-1].bias.copy_(-0.6 * torch.arange(head.reg_max).repeat(4))
        scores = model(frame)[1]['scores']
        for layer in head.cv3:
            layer[-1].bias.sub_(scores.median() + 0.8)
    return model


def drawn_tensors(rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Return boxes that nest, repeat, touch the border and leave the image; smooth prototypes."""
    count, masks = 240, 32
    sizes = np.exp(rng.uniform(np.log(4.0), np.log(220.0), (2, count)))
    centres = rng.uniform(-10.0, SIDE_PX + 10.0, (2, count))
    sizes[:, 60:120] = sizes[:, :60] * rng.uniform(0.93, 1.08, (2, 60))
    centres[:, 60:120] = centres[:, :60] + rng.normal(0.0, 1.0, (2, 60))
    confidences = rng.uniform(0.2, 1.0, (1, count))
    coefficients = rng.normal(0.0, 0.6, (masks, count))
    predictions = torch.from_numpy(np.concatenate([centres, sizes, confidences, coefficients]))
    coarse = torch.from_numpy(rng.normal(0.0, 1.0, (1, masks, 7, 7)))
    cells = SIDE_PX // 4
    return predictions[None], nn.functional.interpolate(coarse, (cells, cells), mode='bicubic')


def reference(
    predictions: Tensor, prototypes: Tensor, confidence: float, overlap: float
) -> dict[str, Any]:
    """Return the tensors and the boxes and masks that ultralytics makes of them."""
    predictions, prototypes = predictions.float(), prototypes.half()
    found = non_max_suppression(predictions.clone(), confidence, overlap, nc=1, max_det=300)[0]
    masks = process_mask(
        prototypes[0].float(), found[:, 6:], found[:, :4], (SIDE_PX, SIDE_PX), upsample=True
    )
    return {
        'predictions': predictions[0].numpy(),
        'prototypes': prototypes[0].numpy(),
        'limits': np.array([confidence, overlap], np.float32),
        'boxes': found[:, :4].numpy(),
        'confidences': found[:, 4].numpy(),
        'masks': np.packbits(masks.numpy().astype(bool)),
    }


def main() -> None:
    """Write the file."""
    torch.manual_seed(5)
    rng = np.random.default_rng(5)
    model = random_network(rng)
    stored: dict[str, Any] = {}
    frames = {'square': (SIDE_PX, SIDE_PX), 'wide': (93, 130), 'tall': (211, 77)}
    for name, (height, width) in frames.items():
        frame = blotches(rng, height, width)
        boxed = LetterBox((SIDE_PX, SIDE_PX), auto=False)(image=frame)
        stored[f'{name}/frame'], stored[f'{name}/letterboxed'] = frame, boxed
        with torch.no_grad():
            pixels = torch.from_numpy(boxed).permute(2, 0, 1)[None].float() / 255.0
            predictions, prototypes = model(pixels)[0]
        if name != 'tall':
            made = reference(predictions, prototypes, 0.4, 0.5 if name == 'square' else 0.7)
            stored |= {f'{name}/{key}': value for key, value in made.items()}
    made = reference(*drawn_tensors(rng), 0.4, 0.9)
    stored |= {f'drawn/{key}': value for key, value in made.items()}
    np.savez_compressed(Path(__file__).with_name('reference.npz'), **stored)
    for name in ('square', 'wide', 'drawn'):
        boxes = stored[f'{name}/boxes']
        sides = boxes[:, 2:] - boxes[:, :2]
        masks = np.unpackbits(stored[f'{name}/masks']).reshape(-1, SIDE_PX * SIDE_PX).mean(axis=1)
        candidates = (stored[f'{name}/predictions'][4] > 0.4).sum()
        print(
            f'{name}: {candidates} candidates, {len(boxes)} kept, sides {sides.min(0)} to '
            f'{sides.max(0)} px, mask shares {np.quantile(masks, [0, 0.5, 1.0])}'
        )


if __name__ == '__main__':
    main()

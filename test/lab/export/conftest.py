# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small reference networks with random weights; the tests here skip without the export extra."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture(scope='session')
def small_clip() -> Any:
    """A CLIP of two narrow layers."""
    torch = pytest.importorskip('torch')
    transformers = pytest.importorskip('transformers')
    torch.manual_seed(1)
    tower = {
        'hidden_size': 64,
        'intermediate_size': 96,
        'num_hidden_layers': 2,
        'num_attention_heads': 1,
    }
    config = transformers.CLIPConfig(
        vision_config={**tower, 'patch_size': 16, 'image_size': 64},
        text_config={**tower, 'eos_token_id': 49407},
        projection_dim=24,
    )
    return transformers.CLIPModel(config).eval()


@pytest.fixture(scope='session')
def make_small_clipseg() -> Callable[..., Any]:
    """Make a CLIPSeg with four vision layers of which it reads 0, 1 and 2."""
    torch = pytest.importorskip('torch')
    transformers = pytest.importorskip('transformers')

    def make(*, refined: bool = False, reduce_dim: int = 16) -> Any:
        torch.manual_seed(2)
        tower = {'hidden_size': 64, 'intermediate_size': 96, 'num_attention_heads': 2}
        config = transformers.CLIPSegConfig(
            vision_config={
                **tower,
                'num_hidden_layers': 4,
                'patch_size': 16,
                'image_size': 96,
            },
            text_config={**tower, 'num_hidden_layers': 2, 'eos_token_id': 49407},
            projection_dim=24,
            extract_layers=[0, 1, 2],
            reduce_dim=reduce_dim,
            decoder_intermediate_size=64,
            use_complex_transposed_convolution=refined,
        )
        model = transformers.CLIPSegForImageSegmentation(config).eval()
        with torch.no_grad():
            for reduce in model.decoder.reduces:
                reduce.weight *= 0.1
            for weight in model.decoder.transposed_convolution.parameters():
                weight.mul_(0.1)
        return model

    return make

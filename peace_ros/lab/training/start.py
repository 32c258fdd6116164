# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Continuing from a bundle that an earlier training wrote, in place of ImageNet's weights."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import cast

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from tokenizers import Tokenizer
from torch import Tensor, nn

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.lab.training.networks import SegmenterNetwork
from peace_ros.lab.training.text import build_tokenizer

Arrays = dict[str, np.ndarray]

_LINEAR = (
    ('meaning', 'decoder.meaning.bias'),
    ('condition.0', 'decoder.condition.0.bias'),
    ('condition.2', 'decoder.condition.2.bias'),
)
"""Layers of the decoder whose weights the exporter has turned round and renamed, in its order."""


def start_from(model: SegmenterNetwork, folder: Path, pixels: Iterable[Tensor]) -> None:
    """Fill a segmenter with the weights of a clipseg bundle of this training.

    A bundle holds each convolution with its batch norm folded into it. Here the norms are given the
    spreads that the ``pixels`` (float32 [B, 3, H, W], normalised) cause, and the gains and shifts
    that undo them: the network computes what the bundle does, and continues to learn from there.

    Raises:
        BundleError: the bundle is not whole.
        ConfigurationError: it is not one of this architecture and these words.
    """
    bundle = Bundle.load(folder)
    known = build_tokenizer().get_vocab()
    if Tokenizer.from_file(str(bundle.paths['tokenizer'])).get_vocab() != known:
        raise ConfigurationError(
            f'{folder}: its words are not the {len(known)} of this training; start from ImageNet'
        )
    try:
        _fill_encoder(model.encoder, bundle.paths['image_encoder'])
        _fill_named(model.text, _arrays(onnx.load(str(bundle.paths['text_encoder']))), '')
        _fill_decoder(model.decoder, bundle.paths['decoder'])
    except (KeyError, ValueError, RuntimeError) as error:
        raise ConfigurationError(
            f'{folder}: not a segmenter of this architecture ({error}); start from ImageNet'
        ) from error
    _spread(model.encoder, pixels)


def _arrays(graph: onnx.ModelProto) -> Arrays:
    """Return the weights by name; those stored as float16 have a suffix there."""
    return {
        tensor.name.removesuffix('_half'): numpy_helper.to_array(tensor).astype(np.float32)
        for tensor in graph.graph.initializer
    }


def _fill_named(module: nn.Module, arrays: Arrays, prefix: str) -> None:
    state = {name: torch.from_numpy(arrays[prefix + name]) for name in module.state_dict()}
    module.load_state_dict(state)


def _fill_decoder(decoder: nn.Module, path: Path) -> None:
    arrays = _arrays(onnx.load(str(path)))
    turned = [name for name in arrays if name.startswith('onnx::MatMul')]
    for (layer, bias), name in zip(_LINEAR, turned, strict=True):
        arrays[f'decoder.{layer}.weight'] = np.ascontiguousarray(arrays[name].T)
        arrays[f'decoder.{layer}.bias'] = arrays[bias]
    _fill_named(decoder, arrays, 'decoder.')


def _pairs(encoder: nn.Module) -> list[tuple[nn.Conv2d, nn.BatchNorm2d]]:
    """Return convolutions with their norms in the order in which they run, as in a graph."""
    ran: list[nn.Module] = []
    hooks = [
        module.register_forward_hook(lambda module, _inputs, _output: ran.append(module))
        for module in encoder.modules()
        if isinstance(module, nn.Conv2d | nn.BatchNorm2d)
    ]
    with torch.no_grad():
        encoder.eval()(torch.zeros(1, 3, 64, 64))
    for hook in hooks:
        hook.remove()
    return cast(
        'list[tuple[nn.Conv2d, nn.BatchNorm2d]]', list(zip(ran[::2], ran[1::2], strict=True))
    )


def _fill_encoder(encoder: nn.Module, path: Path) -> None:
    graph = onnx.load(str(path))
    arrays = _arrays(graph)
    nodes = [node for node in graph.graph.node if node.op_type == 'Conv']
    with torch.no_grad():
        for (convolution, norm), node in zip(_pairs(encoder), nodes, strict=True):
            weight, bias = (arrays[name.removesuffix('_half')] for name in node.input[1:])
            convolution.weight.copy_(torch.from_numpy(weight))
            norm.weight.fill_(1.0)
            norm.bias.copy_(torch.from_numpy(bias))
            norm.running_mean.zero_()  # type: ignore[union-attr]
            norm.running_var.fill_(1.0 - norm.eps)  # type: ignore[union-attr]
    for name, value in encoder.named_parameters():
        if name.startswith('context.'):
            value.data.copy_(torch.from_numpy(arrays[name]))


def _spread(encoder: nn.Module, pixels: Iterable[Tensor]) -> None:
    """Give every norm the mean and spread of what it sees, and let gain and shift undo both."""
    pairs = _pairs(encoder)
    sums = {norm: [0.0, torch.zeros(()), torch.zeros(())] for _, norm in pairs}

    def note(norm: nn.Module, inputs: tuple[Tensor, ...], _output: Tensor) -> None:
        seen = inputs[0].float()
        total = sums[norm]  # type: ignore[index]
        total[0] += 1.0
        total[1] = total[1] + seen.mean(dim=(0, 2, 3))
        total[2] = total[2] + seen.square().mean(dim=(0, 2, 3))

    hooks = [norm.register_forward_hook(note) for _, norm in pairs]
    with torch.no_grad():
        for batch in pixels:
            encoder.eval()(batch)
        for hook in hooks:
            hook.remove()
        for norm, (count, first, second) in sums.items():
            mean = first / count
            variance = (second / count - mean.square()).clamp(min=1e-4)
            norm.running_mean.copy_(mean)  # type: ignore[union-attr]
            norm.running_var.copy_(variance)  # type: ignore[union-attr]
            norm.weight.copy_((variance + norm.eps).sqrt())
            norm.bias.add_(mean)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Smoothing changes no result in fp32 and saves those of int8 from outliers."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('transformers')

import onnx  # noqa: E402

from peace_ros.core.inference import session  # noqa: E402
from peace_ros.core.inference.providers import CPU  # noqa: E402
from peace_ros.lab.export import quantiser as quantiser_module  # noqa: E402
from peace_ros.lab.export.activations import (  # noqa: E402
    best_scale,
    products_of,
    watch,
)
from peace_ros.lab.export.build import build_bundle  # noqa: E402
from peace_ros.lab.export.decoder import ClipSegDecoderGraph  # noqa: E402
from peace_ros.lab.export.precision import EVERY, MLP  # noqa: E402
from peace_ros.lab.export.smoothing import smooth  # noqa: E402
from peace_ros.lab.export.sources import from_model  # noqa: E402
from peace_ros.lab.export.towers import ClipSegImageTower  # noqa: E402

pytestmark = pytest.mark.export

SIDE_PX = 96


@pytest.fixture
def wild(make_small_clipseg: Callable[..., Any]) -> Any:
    """A CLIPSeg some channels of which are far from the rest, as in trained transformers.

    Their weights are small in turn, so that they matter no more than others.
    """
    model = make_small_clipseg()
    with torch.no_grad():
        for layer in model.clip.vision_model.encoder.layers:
            attention = layer.self_attn
            into = (attention.q_proj, attention.k_proj, attention.v_proj)
            for norm, products in (
                (layer.layer_norm1, into),
                (layer.layer_norm2, (layer.mlp.fc1,)),
            ):
                norm.weight[5] *= 30.0
                norm.bias[9] += 25.0
                for product in products:
                    product.weight[:, 5] /= 30.0
        for layer in model.decoder.layers:
            layer.layer_norm1.bias[3] += 8.0
    return model


def samples(count: int = 2) -> list[tuple[Any, ...]]:
    torch.manual_seed(4)
    return [(torch.randn(1, 3, SIDE_PX, SIDE_PX),) for _ in range(count)]


def smoothed(tower: Any, names: tuple[str, ...], inputs: list[tuple[Any, ...]]) -> Any:
    own = copy.deepcopy(tower)
    smooth(own, watch(own, products_of(own, names), inputs))
    return own


def test_the_encoder_computes_what_it_did(wild: Any) -> None:
    tower = ClipSegImageTower(wild, SIDE_PX)
    with torch.no_grad():
        for before, after in zip(
            tower(*samples()[0]), smoothed(tower, EVERY, samples())(*samples()[0]), strict=True
        ):
            torch.testing.assert_close(after, before, rtol=1e-3, atol=1e-3)


def test_the_decoder_computes_what_it_did(wild: Any) -> None:
    tower = ClipSegImageTower(wild, SIDE_PX)
    decoder = ClipSegDecoderGraph(wild, tower.rows)
    with torch.no_grad():
        inputs = [
            (*tower(*each), torch.randn(3, 24), torch.tensor([1.0, 0.0, 1.0])) for each in samples()
        ]
        after = smoothed(decoder, MLP, inputs)
        torch.testing.assert_close(after(*inputs[0]), decoder(*inputs[0]), rtol=1e-3, atol=1e-3)


def test_int8_of_a_network_with_outliers_gains_by_smoothing(
    wild: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = from_model('wild', 'clipseg', wild)
    before = {name: each.clone() for name, each in wild.state_dict().items()}
    monkeypatch.setattr('peace_ros.lab.export.build.compare', _measured_and_accepted)
    _FOUND.clear()
    build_bundle(source, tmp_path / 'smooth', precision='int8')
    monkeypatch.setattr(quantiser_module, 'smooth', lambda *_: None)
    build_bundle(source, tmp_path / 'plain', precision='int8')
    with_smoothing, without = (1.0 - each.cosine for each in _FOUND)
    assert with_smoothing < 0.5 * without
    for name, each in wild.state_dict().items():
        assert torch.equal(each, before[name]), f'{name} of the reference was changed'


_FOUND: list[Any] = []


def _measured_and_accepted(*given: Any) -> Any:
    from peace_ros.lab.export.verify import ModelAgreement, compare

    _FOUND.append(compare(*given))
    return ModelAgreement(0.0, 1.0, 1.0)


def test_every_product_meant_for_int8_is_in_int8(
    make_small_clipseg: Callable[..., Any], tmp_path: Path
) -> None:
    folder = tmp_path / 'small'
    source = from_model('small', 'clipseg', make_small_clipseg())
    agreement = build_bundle(source, folder, precision='int8')
    assert agreement.iou > 0.98
    assert _int8_products(folder / 'image_encoder.onnx') == 3 * 6  # query, key and value apart
    assert _int8_products(folder / 'decoder.onnx') == 3 * 2
    assert _int8_products(folder / 'text_encoder.onnx') == 0
    assert _fused_products(folder / 'image_encoder.onnx', tmp_path) == 3 * 6
    assert _fused_products(folder / 'decoder.onnx', tmp_path) == 3 * 2


def _fused_products(path: Path, folder: Path) -> int:
    """Return how many products ONNX Runtime really runs in int8, as the nodes open the file."""
    options = session._options(1, 'all')
    options.optimized_model_filepath = str(folder / 'optimised.onnx')
    session._OnnxRuntimeEngine(path, options, [CPU])
    nodes = onnx.load(str(folder / 'optimised.onnx')).graph.node
    return sum(node.op_type == 'MatMulIntegerToFloat' for node in nodes)


def _int8_products(path: Path) -> int:
    graph = onnx.load(str(path)).graph
    whole = {each.name for each in graph.initializer if each.data_type == onnx.TensorProto.INT8}
    opened = {
        node.output[0]
        for node in graph.node
        if node.op_type == 'DequantizeLinear' and node.input[0] in whole
    }
    return sum(
        node.op_type == 'MatMul' and node.input[1] in opened and '.input' in node.input[0]
        for node in graph.node
    )


def test_the_scale_cuts_off_a_few_far_values_and_keeps_the_sign_bit_busy() -> None:
    linear = torch.nn.Linear(8, 8)
    values = torch.from_numpy(np.random.default_rng(0).normal(size=(4000, 8)).astype(np.float32))
    values[1, 0] = 12.0
    found = watch(linear, {'layers.widen': linear}, [(values,)])['layers.widen']
    scale = best_scale(found)
    assert not scale.is_unsigned
    assert scale.step * 127 < 9.0
    found = watch(linear, {'layers.widen': linear}, [(values.relu(),)])['layers.widen']
    scale = best_scale(found)
    assert scale.is_unsigned
    assert scale.limits == (0, 255)

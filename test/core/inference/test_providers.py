# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Providers say what they need; OpenVINO gives what ONNX Runtime gives."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import TensorProto, helper

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference import Bundle, ClipEncoder, Session, open_sessions
from peace_ros.core.inference.providers import (
    CPU,
    CUDA,
    OPENVINO,
    TENSORRT,
    LoadMeter,
    available_providers,
    check_providers,
    with_options,
)

needs_openvino = pytest.mark.skipif(
    importlib.util.find_spec('openvino') is None, reason='openvino is not installed'
)


@pytest.mark.parametrize(
    ('provider', 'remedy'),
    [(OPENVINO, 'pip install openvino'), (CUDA, 'onnxruntime-gpu'), (TENSORRT, 'TensorRT')],
)
def test_a_missing_provider_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, provider: str, remedy: str
) -> None:
    monkeypatch.setattr('importlib.util.find_spec', lambda _: None)
    assert available_providers() == ('CPUExecutionProvider',) or provider not in (
        available_providers()
    )
    with pytest.raises(ConfigurationError, match=remedy):
        check_providers((provider,))


def test_openvino_is_no_second_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        'peace_ros.core.inference.providers.available_providers', lambda: (CPU, OPENVINO)
    )
    with pytest.raises(ConfigurationError, match='name it first'):
        check_providers((CPU, OPENVINO))


def test_tensorrt_engines_are_kept_by_model_version_and_device(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr('peace_ros.core.inference.providers._CACHE', tmp_path)
    monkeypatch.setattr('peace_ros.core.inference.providers._tensorrt_version', lambda: '10.3')
    monkeypatch.setattr('peace_ros.core.inference.providers._device', lambda: 'Orin')
    name, options = with_options((TENSORRT, CPU), 'ab' * 32)[0]
    assert name == TENSORRT
    assert Path(options['trt_engine_cache_path']) == tmp_path / f'{"ab" * 8}-10.3-Orin'
    assert Path(options['trt_engine_cache_path']).is_dir()
    assert options['trt_layer_norm_fp32_fallback'] == 'True'
    other = with_options((TENSORRT,), 'cd' * 32)[0][1]
    assert other['trt_engine_cache_path'] != options['trt_engine_cache_path']


@needs_openvino
def test_openvino_gives_the_same_numbers(clipseg_folder: Path) -> None:
    bundle = Bundle.load(clipseg_folder)
    roles = ('image_encoder', 'text_encoder', 'decoder')
    pixels = np.random.default_rng(1).normal(size=(1, 3, 32, 40)).astype(np.float32)
    found = []
    for provider in (CPU, OPENVINO):
        sessions = open_sessions(bundle, roles, threads=1, providers=(provider,))
        assert provider in sessions['decoder'].providers
        feeds: dict[str, Any] = {'input_ids': np.ones((3, 4), np.int64)}
        feeds['attention_mask'] = feeds['input_ids']
        (texts,) = sessions['text_encoder'].run(['text_embedding'], feeds)
        fine, coarse = sessions['image_encoder'].run(['fine', 'coarse'], {'pixel_values': pixels})
        feeds = {'fine': fine, 'coarse': coarse, 'text_embedding': texts}
        feeds['is_positive'] = np.array([1, 0, 0], np.float32)
        maps = sessions['decoder'].run(['negative', 'positive'], feeds)
        found.append([texts, coarse, *maps])
        assert sessions['decoder'].calls == 1
    for have, want in zip(*found, strict=True):
        np.testing.assert_allclose(have, want, atol=1e-3)


@needs_openvino
def test_results_of_openvino_outlive_the_next_run(clip_folder: Path) -> None:
    session = Session(clip_folder / 'image_encoder.onnx', threads=1, providers=(OPENVINO,))
    pixels = np.ones((1, 3, 32, 40), np.float32)
    (first,) = session.run(['image_embedding'], {'pixel_values': pixels})
    kept = first.copy()
    session.run(['image_embedding'], {'pixel_values': -pixels})
    np.testing.assert_array_equal(first, kept)


@needs_openvino
def test_openvino_names_a_file_that_is_no_graph(tmp_path: Path) -> None:
    path = tmp_path / 'broken.onnx'
    path.write_bytes(b'not a graph')
    with pytest.raises(BundleError, match=r'broken\.onnx: OpenVINO cannot open it'):
        Session(path, providers=(OPENVINO,))


def test_the_memory_that_loading_takes_is_counted() -> None:
    meter = LoadMeter()
    held = np.ones(12_000_000, np.float32)
    footprint = meter.read('clip-b', 'int8', (CPU,), 2)
    assert held.nbytes / 1e6 - 3.0 < footprint.memory_mb < 3.0 * held.nbytes / 1e6
    assert footprint.ready_s > 0.0
    assert str(footprint).startswith('clip-b int8 on CPUExecutionProvider, 2 threads, ')
    assert ' MB, warmed up in ' in str(footprint)


def test_an_encoder_tells_where_it_runs_and_what_it_takes(clip_folder: Path) -> None:
    footprint = ClipEncoder(Bundle.load(clip_folder), threads=1).footprint
    assert (footprint.bundle, footprint.providers) == ('clip-tiny', (CPU,))
    assert footprint.threads == 1
    assert 0.0 <= footprint.memory_mb < 1000.0


@needs_openvino
def test_a_network_with_a_weight_that_is_not_a_number_is_refused(tmp_path: Path) -> None:
    """OpenVINO's Relu would turn it into 0, and nobody would see it in the output."""
    x = helper.make_tensor_value_info('x', TensorProto.FLOAT, [1, 2])
    y = helper.make_tensor_value_info('y', TensorProto.FLOAT, [1, 2])
    weight = helper.make_tensor('weight', TensorProto.FLOAT, [1, 2], [1.0, float('nan')])
    nodes = [
        helper.make_node('Mul', ['x', 'weight'], ['z']),
        helper.make_node('Relu', ['z'], ['y']),
    ]
    graph = helper.make_graph(nodes, 'damaged', [x], [y], [weight])
    path = tmp_path / 'damaged.onnx'
    opset = [helper.make_opsetid('', 18)]
    path.write_bytes(
        helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()
    )
    with pytest.raises(BundleError, match=r'damaged\.onnx.*weight weight.*not numbers'):
        Session(path, providers=(OPENVINO,))

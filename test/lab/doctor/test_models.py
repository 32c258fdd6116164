# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bundles, checksums, engines and the time of a frame."""

from __future__ import annotations

import hashlib
import itertools
import json
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from peace_ros.core.inference import providers
from peace_ros.core.presets import load_preset
from peace_ros.core.resources import models_dir
from peace_ros.lab.doctor.models import Models


@pytest.fixture
def own_preset(tmp_path):
    """Write a preset with other values for both nodes with networks."""

    def write(segmentation=None, prompting=None):
        file = tmp_path / 'own.yaml'
        sections = {
            name: {'ros__parameters': values}
            for name, values in (('segmentation', segmentation), ('prompt_generator', prompting))
            if values
        }
        file.write_text(yaml.safe_dump(sections or {'landing': {'ros__parameters': {}}}))
        return load_preset(file)

    return write


@pytest.fixture
def changed_bundle(tmp_path) -> Path:
    folder = Path(shutil.copytree(models_dir() / 'clipseg-small', tmp_path / 'changed'))
    name = json.loads((folder / 'manifest.json').read_text())['roles']['decoder']
    data = bytearray((folder / name).read_bytes())
    data[-1] ^= 1
    (folder / name).write_bytes(data)
    return folder


def test_the_bundled_models_are_whole_and_fast_enough(to_mend) -> None:
    models = Models(load_preset('peace_cs'))
    found = [*models.load(), *models.time_frame(64, 48)]
    assert not to_mend(found)
    text = '\n'.join(each.found for each in found)
    for words in ('bundle clipseg-small: 4 files', 'bundle clip-small', 'CPUExecutionProvider'):
        assert words in text
    assert found[-1].figures['frame_ms'] > 0.0


def test_a_static_template_needs_no_clip(to_mend) -> None:
    found = list(Models(load_preset('dd_cs')).load())
    assert not to_mend(found)
    assert 'clip-small' not in '\n'.join(each.found for each in found)


def test_a_model_that_is_missing_leaves_the_other_one_checked(own_preset, to_mend) -> None:
    models = Models(own_preset({'bundle': 'no-such-bundle'}))
    found = list(models.load())
    ((what, _),) = to_mend(found)
    assert 'no-such-bundle' in what
    assert any('bundle clip-small' in each.found for each in found)
    (frame,) = models.time_frame(64, 48)
    assert frame.outcome.value == 'not checked'


def test_a_wrong_checksum_is_found(own_preset, changed_bundle, to_mend) -> None:
    ((what, _),) = to_mend(Models(own_preset({'bundle': str(changed_bundle)})).load())
    assert 'SHA-256' in what
    assert 'fetch or build the bundle again' in what


def test_a_provider_that_is_not_there_is_found(own_preset, to_mend) -> None:
    preset = own_preset({'providers': ['CUDAExecutionProvider']})
    ((what, _),) = to_mend(Models(preset).load())
    assert 'CUDAExecutionProvider' in what
    assert 'onnxruntime-gpu' in what


def test_engines_of_tensorrt_are_not_built_by_the_doctor(
    own_preset, tmp_path, monkeypatch, to_mend
) -> None:
    monkeypatch.setattr(providers, '_CACHE', tmp_path / 'engines')
    preset = own_preset({'providers': [providers.TENSORRT, providers.CPU]})
    ((what, remedy),) = to_mend(Models(preset).load())
    assert 'TensorRT has built no engine' in what
    assert 'peace models warm --config own' in remedy
    ((what, _),) = to_mend(Models(preset, builds_engines=True).load())
    assert 'execution provider' in what


def test_a_slow_frame_is_to_be_mended(monkeypatch, to_mend) -> None:
    models = Models(load_preset('peace_cs'))
    assert not to_mend(models.load())
    ticks = itertools.count(step=1.2)
    monkeypatch.setattr(time, 'perf_counter', lambda: next(ticks))
    ((what, remedy),) = to_mend(models.time_frame(64, 48))
    assert 'takes 1200 ms' in what
    assert 'clipseg_max_looks' in remedy


def test_other_providers_replace_those_of_the_preset(to_mend) -> None:
    models = Models(load_preset('dd_cs'), ['NoSuchProvider'])
    assert 'NoSuchProvider' in to_mend(models.load())[0][0]


@pytest.fixture
def bundle_of_two_readings(tmp_path) -> Path:
    """A bundle whose scores are halved, but not by an engine that ignores a reduction's axes."""
    onnx = pytest.importorskip('onnx')
    folder = Path(shutil.copytree(models_dir() / 'clipseg-small', tmp_path / 'two_readings'))
    manifest = json.loads((folder / 'manifest.json').read_text())
    name = manifest['roles']['decoder']
    model = onnx.load(folder / name)
    for each in model.graph.node:
        each.output[:] = ['whole' if out == 'positive' else out for out in each.output]
        each.input[:] = ['whole' if given == 'positive' else given for given in each.input]
    ones = onnx.numpy_helper.from_array(np.ones((2, 2), np.float32), 'ones')
    quarter = onnx.numpy_helper.from_array(np.float32(0.25), 'quarter')
    model.graph.initializer.extend([ones, quarter])
    make = onnx.helper.make_node
    model.graph.node.extend(
        [
            make('ReduceL1', ['ones'], ['sums'], axes=[1]),  # 2 and 2; all of it would be 4
            make('ReduceMax', ['sums'], ['largest'], keepdims=0),
            make('Mul', ['largest', 'quarter'], ['share']),
            make('Mul', ['whole', 'share'], ['positive']),
        ]
    )
    onnx.save(model, folder / name)
    data = (folder / name).read_bytes()
    manifest['files'][name] = {'sha256': hashlib.sha256(data).hexdigest(), 'bytes': len(data)}
    (folder / 'manifest.json').write_text(json.dumps(manifest))
    return folder


def test_an_engine_that_reads_a_network_in_another_way_is_to_be_mended(
    own_preset, bundle_of_two_readings, to_mend
) -> None:
    pytest.importorskip('openvino')
    models = Models(own_preset({'bundle': str(bundle_of_two_readings)}), [providers.OPENVINO])
    assert not to_mend(models.load())
    ((what, remedy),) = to_mend(models.compare(352, 352))
    assert 'safety differs from that of CPUExecutionProvider' in what
    assert 'newer opset' in remedy


def test_an_engine_that_agrees_is_fine(to_mend) -> None:
    pytest.importorskip('openvino')
    models = Models(load_preset('dd_cs'), [providers.OPENVINO])
    (found,) = [[*models.load()], *models.compare(64, 48)][1:]
    assert not to_mend([found])
    assert found.figures['safety_difference'] < 0.001


def test_the_usual_provider_is_not_compared_with_itself() -> None:
    models = Models(load_preset('dd_cs'))
    assert [*models.load()]
    assert not [*models.compare(64, 48)]

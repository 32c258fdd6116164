# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A checkpoint becomes a bundle only when the bundle answers as torch does.

Ultralytics (AGPL-3.0) is not needed: a network with the same outputs stands in for what it reads.
"""

from __future__ import annotations

import logging
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import helper, numpy_helper

from peace_ros.core.domain import BundleError, ConfigurationError, Frame, Prompt
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.session import Session
from peace_ros.core.segmentation import (
    FastSamParameters,
    FastSamSegmenter,
    SegmentationParameters,
    Terms,
)

torch = pytest.importorskip('torch')
pytestmark = pytest.mark.training

SIDE_PX, MASKS = 64, 4
TERMS = Terms(('grass', 'park'), ('road', 'car'))
PROMPT = Prompt('A rendered image of {term} in spring.', 0)


class _Head(torch.nn.Module):
    def __init__(self, classes: int, masks: int) -> None:
        super().__init__()
        self.nc, self.nm, self.export, self.format = classes, masks, False, ''
        self.found = torch.nn.Conv2d(6, 5 + masks, 8, 8)
        self.shapes = torch.nn.Conv2d(6, masks, 1)
        with torch.no_grad():  # answers that differ from place to place
            self.found.weight.mul_(6.0)
            self.shapes.weight.mul_(6.0)

    def forward(self, features: Any) -> Any:
        rows = self.found(features).flatten(2)
        boxes = rows[:, :4].sigmoid() * SIDE_PX
        found = torch.cat([boxes, rows[:, 4:5].sigmoid(), rows[:, 5:]], 1)
        return (found, self.shapes(features)) if self.export else ((found, None), {})


class _Network(torch.nn.Module):
    def __init__(self, classes: int = 1, masks: int = MASKS) -> None:
        super().__init__()
        torch.manual_seed(1)
        self.model = torch.nn.ModuleList([torch.nn.Conv2d(3, 6, 4, 4), _Head(classes, masks)])

    def fuse(self, verbose: bool = True) -> Any:
        return self

    def forward(self, pixels: Any) -> Any:
        return self.model[1](torch.relu(self.model[0](pixels)))


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Any:
    made = SimpleNamespace(model=_Network())
    monkeypatch.setitem(sys.modules, 'ultralytics', SimpleNamespace(YOLO=lambda path: made))
    return made


@pytest.fixture
def checkpoint(tmp_path: Path) -> Path:
    path = tmp_path / 'FastSAM-s.pt'
    path.write_bytes(b'weights')
    return path


@pytest.fixture
def clip(clip_folder: Path) -> Bundle:
    return Bundle.load(clip_folder)


def export(checkpoint: Path, clip: Bundle, folder: Path, **options: Any) -> Bundle:
    from peace_ros.lab.export.fastsam import export_fastsam

    export_fastsam(checkpoint, clip, folder, side_px=SIDE_PX, **options)
    return Bundle.load(folder)


def test_a_missing_checkpoint_is_said_before_anything_is_installed_for_it(
    clip: Bundle, tmp_path: Path
) -> None:
    with pytest.raises(BundleError, match='no such file'):
        export(tmp_path / 'FastSAM-s.pt', clip, tmp_path / 'out')


def test_the_bundle_runs_and_says_its_licence(
    network: Any, checkpoint: Path, clip: Bundle, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        bundle = export(checkpoint, clip, tmp_path / 'out' / 'fastsam-s')
    assert 'AGPL-3.0' in caplog.text
    assert 'AGPL-3.0' in bundle.manifest.licence
    own = FastSamParameters(
        fastsam_min_confidence=0.0,
        fastsam_min_stability=0.0,
        fastsam_min_area=0.0,
        fastsam_max_segments=300,
    )
    segmenter = FastSamSegmenter(bundle, TERMS, SegmentationParameters(threads=1), own)
    rng = np.random.default_rng(3)
    maps = segmenter.term_maps(Frame(rng.integers(0, 256, (48, 64, 3), np.uint8), 7), PROMPT)
    assert maps.shape == (4, 48, 64)
    assert maps.sum(axis=0).max() == pytest.approx(1.0, abs=1e-5)
    assert segmenter.calls == {'segmenter': 1, 'image_encoder': 1, 'text_encoder': 1}


def test_a_network_that_changes_on_the_way_is_refused_and_the_old_bundle_stays(
    network: Any, checkpoint: Path, clip: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from peace_ros.lab.export import fastsam

    folder = tmp_path / 'fastsam-s'
    before = export(checkpoint, clip, folder).checksum
    write = fastsam._write_image_encoder

    def damage(clip: Bundle, encoder: Path) -> None:
        write(clip, encoder)
        path = encoder.with_name('segmenter.onnx')
        graph = onnx.load(str(path))
        for tensor in graph.graph.initializer:
            if tensor.data_type == onnx.TensorProto.FLOAT:
                values = numpy_helper.to_array(tensor) * np.float32(1.01)
                tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
        onnx.save(graph, str(path))

    monkeypatch.setattr(fastsam, '_write_image_encoder', damage)
    with pytest.raises(BundleError, match=r'FastSAM-s in fp32 does not agree .* needed: '):
        export(checkpoint, clip, folder)
    assert Bundle.load(folder).checksum == before
    assert sorted(each.name for each in tmp_path.iterdir() if each.name.startswith('.')) == []


@pytest.mark.parametrize(('classes', 'masks'), [(80, 4), (1, 0)])
def test_another_network_is_refused(
    network: Any, checkpoint: Path, clip: Bundle, tmp_path: Path, classes: int, masks: int
) -> None:
    network.model = _Network(classes, masks)
    with pytest.raises(BundleError, match=r'give FastSAM-s\.pt'):
        export(checkpoint, clip, tmp_path / 'x')
    assert not (tmp_path / 'x').exists()


def test_without_ultralytics_there_is_a_way_out(
    checkpoint: Path, clip: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'ultralytics', None)
    with pytest.raises(ConfigurationError, match=r'pip install ultralytics.*AGPL-3\.0'):
        export(checkpoint, clip, tmp_path / 'x')


def test_a_missing_checkpoint_is_not_looked_for_on_the_network(
    network: Any, clip: Bundle, tmp_path: Path
) -> None:
    with pytest.raises(BundleError, match='no such file'):
        export(tmp_path / 'FastSAM-s.pt', clip, tmp_path / 'x')


@pytest.fixture
def graph_file(tmp_path: Path) -> Path:
    """What `yolo export` writes: other names, and a licence in the metadata."""
    network = _Network()
    network.model[1].export = True
    path = tmp_path / 'FastSAM-s.onnx'
    torch.onnx.export(
        network.eval(), (torch.zeros(1, 3, SIDE_PX, SIDE_PX),), str(path), dynamo=False,
        opset_version=17, input_names=['images'], output_names=['output0', 'output1'],
    )  # fmt: skip
    model = onnx.load(str(path))
    onnx.helper.set_model_props(model, {'license': 'AGPL-3.0 License'})
    onnx.save(model, str(path))
    return path


def test_an_exported_graph_needs_neither_ultralytics_nor_torch(
    graph_file: Path, clip: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    monkeypatch.setitem(sys.modules, 'ultralytics', None)
    with caplog.at_level(logging.WARNING):
        bundle = export(graph_file, clip, tmp_path / 'out')
    assert 'AGPL-3.0' in caplog.text
    assert 'AGPL-3.0' in bundle.manifest.licence
    pixels = np.random.default_rng(1).random((1, 3, SIDE_PX, SIDE_PX), np.float32)
    have = Session(bundle.paths['segmenter']).run(
        ['predictions', 'prototypes'], {'pixel_values': pixels}
    )
    wanted = Session(graph_file).run(['output0', 'output1'], {'images': pixels})
    for ours, theirs in zip(have, wanted, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_graph_of_another_side_is_refused(graph_file: Path, clip: Bundle, tmp_path: Path) -> None:
    from peace_ros.lab.export.fastsam import export_fastsam

    with pytest.raises(ConfigurationError, match='exported for 64 px, --side 96 cannot change'):
        export_fastsam(graph_file, clip, tmp_path / 'x', side_px=96)


def test_another_graph_is_refused(clip: Bundle, tmp_path: Path) -> None:
    from peace_ros.lab.export.fastsam import export_fastsam

    path = tmp_path / 'clip.onnx'
    path.write_bytes(clip.paths['image_encoder'].read_bytes())
    with pytest.raises(BundleError, match=r'FastSAM gives predictions \[1, 5 \+ K, A\]'):
        export_fastsam(path, clip, tmp_path / 'x')
    path.write_bytes(b'cut')
    with pytest.raises(BundleError, match='no readable ONNX graph'):
        export_fastsam(path, clip, tmp_path / 'x')


def narrow_network() -> Any:
    from peace_ros.lab.export.random_fastsam import Yolo, draw_weights

    torch.manual_seed(0)
    network = Yolo(1 / 3, 0.125, 1024, SIDE_PX).eval()
    with torch.no_grad():
        draw_weights(network)
    return network


@pytest.mark.parametrize('precision', ['fp32', 'fp16', 'int8'])
def test_each_precision_is_held_against_the_reference(
    clip: Bundle, tmp_path: Path, precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from peace_ros.lab.export import fastsam
    from peace_ros.lab.export.segmenters import from_network

    source = from_network(
        narrow_network(), 'narrow', SIDE_PX, licence='none', provenance='random weights'
    )
    if precision == 'int8':  # random weights lose more in int8 than is allowed
        limits = {'cosine': 0.9, 'iou': 0.5}
        monkeypatch.setattr(fastsam.SegmenterAgreement, 'LEAST', limits)
    agreement = fastsam.export_fastsam(source, clip, tmp_path / 'x', precision=precision)
    bundle = Bundle.load(tmp_path / 'x')
    assert bundle.manifest.precision == precision
    assert f'random weights in {precision}; CLIP in fp32' in bundle.manifest.provenance
    assert 0.9 < agreement.cosine <= 1.0 + 1e-9
    assert (agreement.error <= fastsam.MOST_ERROR) == (precision == 'fp32')
    graph = onnx.load(str(bundle.paths['segmenter'])).graph
    kinds = {each.data_type for each in graph.initializer}
    quantised = [each for each in graph.node if each.op_type == 'QuantizeLinear']
    assert (onnx.TensorProto.FLOAT16 in kinds) == (precision == 'fp16')
    assert bool(quantised) == (precision == 'int8')


def test_numbers_too_large_for_fp16_are_refused_by_name(clip: Bundle, tmp_path: Path) -> None:
    from peace_ros.lab.export.fastsam import export_fastsam
    from peace_ros.lab.export.segmenters import from_network

    network = narrow_network()
    with torch.no_grad():
        network.start[0][0].weight.mul_(1e6)
    source = from_network(network, 'loud', SIDE_PX, licence='none', provenance='random weights')
    with pytest.raises(BundleError, match=r'loud in fp16 answers with infinite numbers.*written'):
        export_fastsam(source, clip, tmp_path / 'x', precision='fp16')
    assert not (tmp_path / 'x').exists()


def test_a_poor_precision_is_refused() -> None:
    from peace_ros.lab.export.fastsam import SegmenterAgreement

    poor = SegmenterAgreement(0.001, 0.0001, 0.9985, 0.99)
    poor.refuse_if_poor('fp32', 'FastSAM-s')
    with pytest.raises(BundleError, match=r'cosine 0\.9985, .*Nothing was written'):
        poor.refuse_if_poor('int8', 'FastSAM-s')


@pytest.mark.parametrize(
    ('precision', 'error', 'refused'),
    [('fp32', 1e-4, ''), ('fp32', 0.01, '0.001 is allowed'), ('int8', 0.01, ''),
     ('int8', 0.1, '0.045 is allowed')],
)  # fmt: skip
def test_a_batch_may_differ_from_single_images_by_rounding_alone(
    clip: Bundle,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    precision: str,
    error: float,
    refused: str,
) -> None:
    from peace_ros.lab.export import fastsam

    class Rounding(Session):
        def run(self, outputs: Any, feeds: Any) -> Any:
            (found,) = super().run(outputs, feeds)
            return [found * (1.0 + error) if len(found) > 1 else found]

    monkeypatch.setattr(fastsam, 'Session', Rounding)
    given = Bundle(
        clip.folder, replace(clip.manifest, precision=precision), clip.checksum, clip.paths
    )
    if refused:
        with pytest.raises(BundleError, match=refused):
            fastsam._write_image_encoder(given, tmp_path / 'image_encoder.onnx')
    else:
        fastsam._write_image_encoder(given, tmp_path / 'image_encoder.onnx')


def test_the_command_exports_and_says_how_well_it_agrees(
    graph_file: Path, clip_folder: Path, tmp_path: Path
) -> None:
    import typer
    from typer.testing import CliRunner

    from peace_ros.cli import models as commands

    app = typer.Typer()
    app.command()(commands.models_export)
    options = ['--clip', str(clip_folder), '--out', str(tmp_path / 'models')]
    result = CliRunner().invoke(app, [str(graph_file), *options])
    assert result.exit_code == 0, result.output
    assert 'agrees with its reference: box error px 0,' in result.output
    assert Bundle.load(tmp_path / 'models' / 'FastSAM-s-fp32').manifest.family == 'fastsam'
    refused = CliRunner().invoke(app, [str(graph_file)])
    assert isinstance(refused.exception, ConfigurationError)
    assert '--clip BUNDLE' in str(refused.exception)


def test_a_class_token_is_repeated_for_every_image(tmp_path: Path) -> None:
    from peace_ros.lab.export.batching import free_batch

    rng = np.random.default_rng(0)
    node = helper.make_node
    graph = helper.make_graph(
        [
            node('Conv', ['pixel_values', 'kernel'], ['patches'], strides=[4, 4]),
            node('Reshape', ['patches', 'columns'], ['flat']),
            node('Transpose', ['flat'], ['tokens'], perm=[0, 2, 1]),
            node('Concat', ['class', 'tokens'], ['joined'], axis=1),
            node('Softmax', ['joined'], ['bent'], axis=1),
            node('ReduceMean', ['bent'], ['image_embedding'], axes=[1], keepdims=0),
        ],
        'image',
        [helper.make_tensor_value_info('pixel_values', onnx.TensorProto.FLOAT, [1, 3, 16, 16])],
        [helper.make_tensor_value_info('image_embedding', onnx.TensorProto.FLOAT, [1, 5])],
        [
            numpy_helper.from_array(rng.normal(size=(5, 3, 4, 4)).astype(np.float32), 'kernel'),
            numpy_helper.from_array(rng.normal(size=(1, 1, 5)).astype(np.float32), 'class'),
            numpy_helper.from_array(np.array([1, 5, 16], np.int64), 'columns'),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 17)])
    model.ir_version = 8
    onnx.save(model, str(tmp_path / 'one.onnx'))
    free_batch(model)
    onnx.checker.check_model(model)
    onnx.save(model, str(tmp_path / 'many.onnx'))
    images = rng.normal(size=(7, 3, 16, 16)).astype(np.float32)
    one, many = (Session(tmp_path / f'{name}.onnx', threads=1) for name in ('one', 'many'))
    (together,) = many.run(['image_embedding'], {'pixel_values': images})
    assert together.std(axis=0).min() > 0.0
    for image, embedding in zip(images, together, strict=True):
        (alone,) = one.run(['image_embedding'], {'pixel_values': image[None]})
        np.testing.assert_allclose(embedding, alone[0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize('size', ['s', 'x'])
def test_the_true_size_fastsam_agrees(clip: Bundle, tmp_path: Path, size: str) -> None:
    from peace_ros.lab.export.fastsam import export_fastsam
    from peace_ros.lab.export.pictures import draw_pictures
    from peace_ros.lab.export.random_fastsam import random_fastsam
    from peace_ros.lab.export.segmenters import from_network

    source = from_network(
        random_fastsam(size), 'fastsam', 640, licence='none', provenance='random weights'
    )
    frames = draw_pictures(1)
    agreement = export_fastsam(source, clip, tmp_path / 'fastsam', frames=frames)
    assert agreement.box_error_px <= 0.01
    assert agreement.error <= 1e-3
    outputs = onnx.load(str(tmp_path / 'fastsam' / 'segmenter.onnx')).graph.output
    sizes = {tuple(d.dim_value for d in each.type.tensor_type.shape.dim) for each in outputs}
    assert sizes == {(1, 37, 8400), (1, 32, 160, 160)}

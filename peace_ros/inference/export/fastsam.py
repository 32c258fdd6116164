# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A FastSAM checkpoint and a CLIP bundle -> a bundle of the family fastsam.

The checkpoint is read by ultralytics, an optional extra under AGPL-3.0 that is imported here and
nowhere else. The bundle runs without it.
"""

from __future__ import annotations

import importlib
import json
import logging
import shutil
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper

from peace_ros.domain import BundleError, ConfigurationError
from peace_ros.inference.bundle import MANIFEST_NAME, Bundle, file_entry, sha256_of
from peace_ros.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.inference.export.build import staged
from peace_ros.inference.manifest import FORMAT
from peace_ros.inference.session import Session, open_sessions

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LOG = logging.getLogger(__name__)

OPSET = 17
LICENCE_NOTE = (
    'ultralytics is under AGPL-3.0, and so is a FastSAM network that it reads and converts: who '
    'passes the bundle on, or lets others use it over a network, owes them the complete source '
    'code under AGPL-3.0, or needs a licence from Ultralytics'
)
MOST_BOX_ERROR_PX = 0.01
MOST_ERROR = 1e-3
"""Of confidences, coefficients and prototypes, against torch."""
_STRIDE_PX = 32
_CHECKED_IMAGES = 3


def export_fastsam(checkpoint: Path, clip: Bundle, folder: Path, *, side_px: int = 640) -> Bundle:
    """Write a fastsam bundle, hold it against torch, and only then put it in its place.

    Args:
        checkpoint: FastSAM-s.pt or FastSAM-x.pt. Reading it runs code that it may hold: take it
            from where you trust.
        clip: bundle of the family clip.
        folder: where the bundle goes; one that is there stays until the new one is verified.
        side_px: side of the square that frames are letterboxed into, a multiple of 32.

    Raises:
        ConfigurationError: ultralytics is not installed, or the side cannot be used.
        BundleError: the checkpoint, the CLIP bundle or the folder cannot be used, or the exported
            network answers otherwise than torch does.
    """
    if side_px < _STRIDE_PX or side_px % _STRIDE_PX:
        raise ConfigurationError(
            f'input side {side_px} px: give a multiple of {_STRIDE_PX}, e.g. 640 or 1024'
        )
    clip.require_family('clip')
    model = load_checkpoint(checkpoint)
    with staged(folder) as stage:
        _write_segmenter(model, stage / 'segmenter.onnx', side_px)
        _write_image_encoder(clip, stage / 'image_encoder.onnx')
        for role in ('text_encoder', 'tokenizer'):
            source = clip.paths[role]
            shutil.copyfile(source, stage / f'{role}{source.suffix}')
        _write_manifest(stage, folder.name, clip, checkpoint, side_px)
        verify_fastsam(Bundle.load(stage), model)
    return Bundle.load(folder)


def load_checkpoint(checkpoint: Path) -> Any:
    """Return the torch network of a FastSAM checkpoint, ready to export.

    Raises ConfigurationError without ultralytics, BundleError for another network.
    """
    try:
        ultralytics = importlib.import_module('ultralytics')
    except ImportError as error:
        raise ConfigurationError(
            f'FastSAM checkpoints are read by ultralytics, which is not installed ({error}): '
            f'`pip install ultralytics` in an environment of its own. {LICENCE_NOTE}'
        ) from error
    _LOG.warning('%s: %s', checkpoint, LICENCE_NOTE)
    if not checkpoint.is_file():  # ultralytics would look for it on the network
        raise BundleError(f'{checkpoint}: no such file; give FastSAM-s.pt or FastSAM-x.pt')
    try:
        model = ultralytics.YOLO(str(checkpoint)).model.float()
    except Exception as error:  # unpickling raises whatever the file makes it raise
        raise BundleError(
            f'{checkpoint}: ultralytics cannot read it ({type(error).__name__}: {error}); fetch '
            'it again'
        ) from error
    head = model.model[-1]
    masks, classes = getattr(head, 'nm', 0), getattr(head, 'nc', 0)
    if masks < 1 or classes != 1 or getattr(head, 'end2end', False):
        raise BundleError(
            f'{checkpoint}: a {type(head).__name__} network of {classes} classes; FastSAM '
            'segments and knows one class, give FastSAM-s.pt or FastSAM-x.pt'
        )
    model = model.eval().fuse(verbose=False)
    for module in model.modules():
        if hasattr(module, 'export'):
            module.export, module.format = True, 'onnx'
    return model


def verify_fastsam(bundle: Bundle, model: Any) -> None:
    """Hold the bundle's graphs against the contract and its segmenter against torch.

    Raises BundleError with the largest difference.
    """
    roles = ('segmenter', 'image_encoder', 'text_encoder')
    segmenter = open_sessions(bundle, roles)['segmenter']
    size = bundle.manifest.input
    rng = np.random.default_rng(0)
    for _ in range(_CHECKED_IMAGES):
        coarse = rng.uniform(0.0, 1.0, (1, 3, size.height // 16, size.width // 16))
        pixels = coarse.repeat(16, axis=2).repeat(16, axis=3).astype(np.float32)
        with torch.no_grad():
            wanted = [each.numpy() for each in model(torch.from_numpy(pixels))]
        have = segmenter.run([PREDICTIONS, PROTOTYPES], {PIXEL_VALUES: pixels})
        path = bundle.paths['segmenter']
        _compare(path, 'boxes', have[0][:, :4], wanted[0][:, :4], MOST_BOX_ERROR_PX)
        _compare(path, 'confidences', have[0][:, 4:], wanted[0][:, 4:], MOST_ERROR)
        _compare(path, 'prototypes', have[1], wanted[1], MOST_ERROR)


def _compare(path: Path, what: str, have: NDArray[Any], wanted: NDArray[Any], most: float) -> None:
    error = float(np.abs(have - wanted).max()) if have.shape == wanted.shape else float('inf')
    _LOG.info('%s: %s differ from the reference by %.2g at most', path.name, what, error)
    if not error <= most:
        raise BundleError(
            f'{path}: {what} of shape {have.shape} differ from the reference {wanted.shape} by '
            f'{error:.3g} where {most} is allowed; export with other versions of torch and '
            'ultralytics'
        )


def free_batch(model: onnx.ModelProto) -> None:
    """Let a graph that was exported for one image take any number of them, in place.

    Reshapes copy their first axis instead of naming it, and constants that are joined to the
    images' arrays (the class token) are repeated. Whether that was enough is for a check of the
    result against single images to say.
    """
    graph = model.graph
    shapes = _shapes(graph)
    constants = _constants(graph)
    ranks = _ranks(model)
    batch = [
        helper.make_node('Shape', [PIXEL_VALUES], ['batch_shape']),
        helper.make_node('Slice', ['batch_shape', 'batch_from', 'batch_to'], ['batch_size']),
    ]
    nodes = []
    for node in graph.node:
        if node.op_type == 'Reshape' and node.input[0] not in constants:
            _copy_first_axis(graph, node, shapes)
        axis = next((each.i for each in node.attribute if each.name == 'axis'), 0)
        if node.op_type == 'Concat' and axis != 0 and not constants.issuperset(node.input):
            for index, name in enumerate(node.input):
                if name in constants:
                    nodes += _repeat(graph, node, index, ranks[node.output[0]])
        nodes.append(node)
    for name, value in (('batch_from', [0]), ('batch_to', [1])):
        graph.initializer.append(numpy_helper.from_array(np.array(value, np.int64), name))
    del graph.node[:]
    graph.node.extend(batch + nodes)
    del graph.value_info[:]
    for tensor in (*graph.input, *graph.output):
        tensor.type.tensor_type.shape.dim[0].dim_param = 'B'


def _constants(graph: onnx.GraphProto) -> set[str]:
    """Return the names of arrays that do not depend on the input."""
    names = {tensor.name for tensor in graph.initializer}
    for node in graph.node:
        if all(name in names or not name for name in node.input):
            names.update(node.output)
    return names


def _ranks(model: onnx.ModelProto) -> dict[str, int]:
    inferred = onnx.shape_inference.infer_shapes(model)
    return {each.name: len(each.type.tensor_type.shape.dim) for each in inferred.graph.value_info}


def _shapes(graph: onnx.GraphProto) -> dict[str, NDArray[Any]]:
    """Return the vectors of whole numbers that the graph holds, by name."""
    tensors = [(each.name, each) for each in graph.initializer]
    tensors += [
        (node.output[0], node.attribute[0].t)
        for node in graph.node
        if node.op_type == 'Constant' and node.attribute[0].name == 'value'
    ]
    return {
        name: numpy_helper.to_array(each)
        for name, each in tensors
        if each.data_type == onnx.TensorProto.INT64 and len(each.dims) == 1
    }


def _copy_first_axis(
    graph: onnx.GraphProto, node: onnx.NodeProto, shapes: dict[str, NDArray[Any]]
) -> None:
    shape = shapes.get(node.input[1])
    if shape is not None and shape.size > 1 and shape[0] == 1:
        name = f'{node.output[0]}_batched'
        first_as_in_input = np.concatenate([np.zeros(1, np.int64), shape[1:]])
        graph.initializer.append(numpy_helper.from_array(first_as_in_input, name))
        node.input[1] = name


def _repeat(
    graph: onnx.GraphProto, node: onnx.NodeProto, index: int, rank: int
) -> list[onnx.NodeProto]:
    """Make a constant of a concatenation as long as the batch; return the nodes for that."""
    name = node.input[index]
    ones, shape, repeated = f'{name}_ones', f'{name}_shape', f'{name}_repeated'
    graph.initializer.append(numpy_helper.from_array(np.ones(rank - 1, np.int64), ones))
    node.input[index] = repeated
    return [
        helper.make_node('Concat', ['batch_size', ones], [shape], axis=0),
        helper.make_node('Expand', [name, shape], [repeated]),
    ]


def _write_image_encoder(clip: Bundle, path: Path) -> None:
    """Write the CLIP bundle's image encoder, for any number of images.

    Raises BundleError when it does not give them what it gives single ones.
    """
    source = clip.paths['image_encoder']
    model = onnx.load(str(source))
    single = Session(source)
    if any(isinstance(each.shape[0], int) for each in single.graph.inputs):
        free_batch(model)
    onnx.save(model, str(path))
    size = clip.manifest.input
    pixels = np.random.default_rng(0).normal(
        0.0, 1.0, (_CHECKED_IMAGES, 3, size.height, size.width)
    )
    images = pixels.astype(np.float32)
    wanted = [single.run([IMAGE_EMBEDDING], {PIXEL_VALUES: image[None]})[0] for image in images]
    try:
        (have,) = Session(path).run([IMAGE_EMBEDDING], {PIXEL_VALUES: images})
    except BundleError as error:
        raise BundleError(
            f'{source}: takes one image at a time and could not be changed to take the segments '
            f'of a frame together ({error}); export CLIP with a free batch axis'
        ) from error
    lengths = np.linalg.norm(wanted, axis=-1).reshape(-1, 1)
    _compare(path, 'embeddings', have / lengths, np.concatenate(wanted) / lengths, MOST_ERROR)


def _write_segmenter(model: Any, path: Path, side_px: int) -> None:
    with torch.no_grad(), warnings.catch_warnings():
        # The newer exporter of torch needs one more package and names the axes its own way.
        warnings.simplefilter('ignore')
        torch.onnx.export(
            model,
            (torch.zeros(1, 3, side_px, side_px),),
            str(path),
            dynamo=False,
            opset_version=OPSET,
            input_names=[PIXEL_VALUES],
            output_names=[PREDICTIONS, PROTOTYPES],
        )


def _write_manifest(stage: Path, name: str, clip: Bundle, checkpoint: Path, side_px: int) -> None:
    manifest = clip.manifest
    files = {path.name: file_entry(path) for path in sorted(stage.iterdir())}
    square = {'width': side_px, 'height': side_px, 'resize': 'letterbox'}
    values = {
        'format': FORMAT,
        'name': name,
        'family': 'fastsam',
        'roles': {Path(file).stem: file for file in files},
        'input': square | {'mean': [0.0, 0.0, 0.0], 'std': [1.0, 1.0, 1.0]},
        'crop_input': {
            'width': manifest.input.width,
            'height': manifest.input.height,
            'resize': 'letterbox',
            'mean': list(manifest.input.mean),
            'std': list(manifest.input.std),
        },
        'logit_scale': manifest.logit_scale,
        'embedding_width': manifest.embedding_width,
        'context_length': manifest.context_length,
        'precision': manifest.precision,
        'files': files,
        'licence': f'AGPL-3.0 (segmenter, through ultralytics); {manifest.licence} (CLIP)',
        'provenance': (
            f'{checkpoint.name} (SHA-256 {sha256_of(checkpoint)}) '
            f'in fp32; CLIP: {manifest.name}, {manifest.provenance}'
        ),
        'recommended': {},
    }
    (stage / MANIFEST_NAME).write_text(json.dumps(values, indent=2) + '\n', encoding='utf-8')

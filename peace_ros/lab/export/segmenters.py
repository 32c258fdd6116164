# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where FastSAM's segmenter comes from: a checkpoint, an exported graph, or a network in memory.

Checkpoints are read by ultralytics, an optional extra under AGPL-3.0 that is imported here and
nowhere else; an exported graph needs neither ultralytics nor torch.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference.bundle import sha256_of
from peace_ros.core.inference.contract import PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.inference.session import Session

_LOG = logging.getLogger(__name__)

Outputs = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Predictions and prototypes."""

USUAL_SIDE_PX = 640
LICENCE_NOTE = (
    'ultralytics is under AGPL-3.0, and so is a FastSAM network that it reads and converts: who '
    'passes the bundle on, or lets others use it over a network, owes them the complete source '
    'code under AGPL-3.0, or needs a licence from Ultralytics'
)
_STRIDE_PX = 32
_FLOAT = onnx.TensorProto.FLOAT


@dataclass(frozen=True)
class SegmenterSource:
    """A segmenter of the family fastsam, not yet in its bundle."""

    name: str
    side_px: int
    """Of the square input."""
    licence: str
    provenance: str
    write: Callable[[Path], None]
    """Writes the fp32 graph, with the contract's names."""
    run: Callable[[NDArray[np.float32]], Outputs]
    """The reference: float32 [1, 3, side, side] -> what the graph must give."""


def load_segmenter(source: Path, side_px: int = 0) -> SegmenterSource:
    """Load FastSAM-s or -x from a checkpoint (.pt) or an exported graph (.onnx).

    Args:
        source: the file. Reading a checkpoint runs code that it may hold: take it from a source
            that you trust.
        side_px: of the square that frames are letterboxed into, a multiple of 32; 0: the graph's
            own, else 640.

    Raises:
        ConfigurationError: the side cannot be used, or ultralytics is missing.
        BundleError: the file cannot be read or holds another network.
    """
    if side_px and (side_px < _STRIDE_PX or side_px % _STRIDE_PX):
        raise ConfigurationError(
            f'input side {side_px} px: give a multiple of {_STRIDE_PX}, e.g. 640 or 1024'
        )
    if source.suffix == '.onnx':
        return _from_graph(source, side_px)
    return _from_checkpoint(source, side_px or USUAL_SIDE_PX)


def from_network(
    network: Any, name: str, side_px: int, *, licence: str, provenance: str
) -> SegmenterSource:
    """Wrap a network of torch that gives predictions and prototypes."""

    def write(path: Path) -> None:
        # Only here, because a graph that was exported elsewhere needs no torch.
        import torch  # noqa: PLC0415

        from peace_ros.lab.export.graphs import write_graph  # noqa: PLC0415

        pixels = torch.zeros(1, 3, side_px, side_px)
        write_graph(network, (pixels,), path, [PIXEL_VALUES], [PREDICTIONS, PROTOTYPES])

    def run(pixels: NDArray[np.float32]) -> Outputs:
        torch = importlib.import_module('torch')
        with torch.no_grad():
            predictions, prototypes = network(torch.from_numpy(pixels))
        return predictions.numpy(), prototypes.numpy()

    return SegmenterSource(name, side_px, licence, provenance, write, run)


def _from_checkpoint(checkpoint: Path, side_px: int) -> SegmenterSource:
    _require_file(checkpoint)  # ultralytics would look for it on the network
    try:
        ultralytics = importlib.import_module('ultralytics')
    except ImportError as error:
        raise ConfigurationError(
            f'FastSAM checkpoints are read by ultralytics, which is not installed ({error}): '
            '`pip install ultralytics` in an environment of its own, or give a graph that was '
            f'exported elsewhere (.onnx). {LICENCE_NOTE}'
        ) from error
    _LOG.warning('%s: %s', checkpoint, LICENCE_NOTE)
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
    return from_network(
        model,
        checkpoint.stem,
        side_px,
        licence='AGPL-3.0 (segmenter, through ultralytics)',
        provenance=_provenance(checkpoint),
    )


def _from_graph(path: Path, side_px: int) -> SegmenterSource:
    _require_file(path)
    try:
        model = onnx.load(str(path))
        onnx.checker.check_model(model)
    except Exception as error:  # protobuf, checker and file errors have no common base
        raise BundleError(
            f'{path}: no readable ONNX graph ({type(error).__name__}); export it again'
        ) from error
    names = _names(path, model.graph)
    own_px = _own_side_px(path, model.graph)
    if side_px and own_px and side_px != own_px:
        raise ConfigurationError(
            f'{path}: exported for {own_px} px, --side {side_px} cannot change that; export it '
            'anew or leave --side away'
        )
    side = own_px or side_px or USUAL_SIDE_PX
    licence = next((each.value for each in model.metadata_props if each.key == 'license'), '')
    if 'AGPL' in licence.upper():
        _LOG.warning('%s: %s', path, LICENCE_NOTE)
    session = Session(path)

    def write(target: Path) -> None:
        graph = model.graph
        _rename(graph, dict(zip(names, (PIXEL_VALUES, PREDICTIONS, PROTOTYPES), strict=True)))
        for axis, size in enumerate((1, 3, side, side)):
            graph.input[0].type.tensor_type.shape.dim[axis].dim_value = size
        onnx.save(model, str(target))

    def run(pixels: NDArray[np.float32]) -> Outputs:
        predictions, prototypes = session.run(names[1:], {names[0]: pixels})
        return predictions, prototypes

    return SegmenterSource(
        path.stem, side, licence or 'that of the graph', _provenance(path), write, run
    )


def _names(path: Path, graph: onnx.GraphProto) -> tuple[str, str, str]:
    """Return the names of input, predictions and prototypes; refuse a graph of another shape."""
    ranks = {each.name: _dims(each) for each in graph.output}
    predictions = [name for name, dims in ranks.items() if len(dims) == 3]
    prototypes = [name for name, dims in ranks.items() if len(dims) == 4]
    inputs = [each for each in graph.input if each.type.tensor_type.elem_type == _FLOAT]
    found = ', '.join(f'{name} {list(dims)}' for name, dims in ranks.items())
    fits = len(graph.input) == len(inputs) == len(predictions) == len(prototypes) == 1
    if fits:
        rows, masks = ranks[predictions[0]][1], ranks[prototypes[0]][1]
        fits = not (rows and masks) or rows == 5 + masks
    if not fits:
        raise BundleError(
            f'{path}: outputs {found}: FastSAM gives predictions [1, 5 + K, A] and prototypes '
            '[1, K, h, w] from one float32 image; export FastSAM-s.pt or FastSAM-x.pt with '
            '`yolo export format=onnx`, without nms and half'
        )
    return inputs[0].name, predictions[0], prototypes[0]


def _own_side_px(path: Path, graph: onnx.GraphProto) -> int:
    """Return the side of the graph's square input; 0 when it takes any."""
    _, channels, height, width = (*_dims(graph.input[0]), 0, 0, 0, 0)[:4]
    if height != width or channels not in (0, 3) or height % _STRIDE_PX:
        raise BundleError(
            f'{path}: input {list(_dims(graph.input[0]))}: an RGB square whose side is a multiple '
            f'of {_STRIDE_PX} px is needed; export it with imgsz=640'
        )
    return height


def _dims(tensor: onnx.ValueInfoProto) -> tuple[int, ...]:
    return tuple(each.dim_value for each in tensor.type.tensor_type.shape.dim)


def _rename(graph: onnx.GraphProto, names: dict[str, str]) -> None:
    for node in graph.node:
        node.input[:] = [names.get(each, each) for each in node.input]
        node.output[:] = [names.get(each, each) for each in node.output]
    for tensor in (*graph.input, *graph.output):
        tensor.name = names.get(tensor.name, tensor.name)


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise BundleError(f'{path}: no such file; give FastSAM-s.pt or FastSAM-x.pt, or its .onnx')


def _provenance(path: Path) -> str:
    return f'{path.name} (SHA-256 {sha256_of(path)})'

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Source -> verified bundle, put in place in one step or not at all."""

from __future__ import annotations

import json
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from peace_ros.domain import BundleError
from peace_ros.inference.bundle import MANIFEST_NAME, Bundle, file_entry, put_in_place
from peace_ros.inference.contract import IS_POSITIVE, PIXEL_VALUES, TEXT_EMBEDDING
from peace_ros.inference.export import graphs, pictures
from peace_ros.inference.export.precision import EVERY, NARROW, to_fp16, to_int8
from peace_ros.inference.export.verify import Agreement, compare
from peace_ros.inference.manifest import FORMAT, PRECISIONS, ROLES_BY_FAMILY
from peace_ros.inference.preprocess import Preprocessor
from peace_ros.inference.session import Session
from peace_ros.inference.tokenizer import Tokenizer

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from peace_ros.domain import Frame
    from peace_ros.inference.export.sources import Source

    Feeds = Mapping[str, NDArray[np.generic]]

_WRITERS = {'clip': graphs.write_clip_graphs, 'clipseg': graphs.write_clipseg_graphs}
_THRESHOLD = {'threshold': 0.5}


def build_bundle(
    source: Source,
    folder: Path,
    *,
    precision: str = 'fp32',
    frames: Sequence[Frame] | None = None,
    licence: str = 'that of the source',
) -> Agreement:
    """Export, verify and put in place.

    Args:
        source: the reference model.
        folder: the bundle; an older one there stays until the new one has been verified.
        precision: ``fp32``, ``fp16`` or ``int8`` (for CPUs; the text encoder stays fp32, it never
            runs on a frame's path).
        frames: images to calibrate and verify on; None: drawn ones.
        licence: of the weights, as the manifest will say.

    Returns:
        How well the bundle agrees with the reference.

    Raises:
        BundleError: it does not agree well enough, or cannot be written. Nothing changes then.
    """
    if precision not in PRECISIONS:
        raise BundleError(f'precision {precision!r}: choose one of {", ".join(PRECISIONS)}')
    frames = frames or pictures.draw_pictures(3)
    with staged(folder) as stage:
        _WRITERS[source.family](
            source.model,
            stage,
            side_px=source.input.height,
            end_of_text=source.vocabulary.end_of_text,
        )
        source.vocabulary.write(stage / 'tokenizer.json', source.context_length)
        if precision == 'fp16':
            for file in sorted(stage.glob('*.onnx')):
                to_fp16(file)
        elif precision == 'int8':
            _quantise(source, stage, frames)
        _write_manifest(source, stage, folder.name, precision, licence)
        agreement = compare(source, Bundle.load(stage), frames)
        agreement.refuse_if_poor(precision, source.name)
    return agreement


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Give a folder to fill; when that went well, it takes the place of ``folder``.

    Raises BundleError when there is no room or no right to write.
    """
    folder = folder.expanduser().absolute()
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=f'.{folder.name}.', dir=folder.parent))
        stage.chmod(0o755)
        try:
            yield stage
            put_in_place(stage, folder)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    except OSError as error:
        raise BundleError(
            f'{folder}: {error.strerror or error}; a full-size bundle needs up to 3 GB while it is '
            'made: free some space or choose another folder (a bundle that was there is untouched)'
        ) from error


def _quantise(source: Source, stage: Path, frames: Sequence[Frame]) -> None:
    preprocess = Preprocessor(source.input)
    pixels: list[Feeds] = [{PIXEL_VALUES: preprocess(each.image_rgb).copy()} for each in frames]
    encoder = stage / 'image_encoder.onnx'
    if source.family == 'clipseg':
        # The decoder is measured on features of the fp32 encoder, so it comes first.
        to_int8(stage / 'decoder.onnx', _decoder_samples(source, stage, pixels), NARROW)
    to_int8(encoder, pixels, EVERY)


def _decoder_samples(source: Source, stage: Path, pixels: Sequence[Feeds]) -> list[Feeds]:
    tokens = Tokenizer(stage / 'tokenizer.json', source.context_length)(pictures.TEXTS)
    text = Session(stage / 'text_encoder.onnx')
    feeds = {'input_ids': tokens.input_ids, 'attention_mask': tokens.attention_mask}
    (embeddings,) = text.run([TEXT_EMBEDDING], feeds)
    encoder = Session(stage / 'image_encoder.onnx')
    names = [each.name for each in encoder.graph.outputs]
    sides = np.array(pictures.IS_POSITIVE, np.float32)
    return [
        {
            **dict(zip(names, encoder.run(names, each), strict=True)),
            TEXT_EMBEDDING: embeddings,
            IS_POSITIVE: sides,
        }
        for each in pixels
    ]


def _write_manifest(source: Source, stage: Path, name: str, precision: str, licence: str) -> None:
    roles = {
        role: 'tokenizer.json' if role == 'tokenizer' else f'{role}.onnx'
        for role in ROLES_BY_FAMILY[source.family]
    }
    spec = source.input
    manifest: dict[str, Any] = {
        'format': FORMAT,
        'name': name,
        'family': source.family,
        'roles': roles,
        'input': {
            'width': spec.width,
            'height': spec.height,
            'resize': spec.resize,
            'interpolation': spec.interpolation,
            'mean': list(spec.mean),
            'std': list(spec.std),
        },
        'embedding_width': source.embedding_width,
        'context_length': source.context_length,
        'precision': precision,
        'files': {file: file_entry(stage / file) for file in roles.values()},
        'licence': licence,
        'provenance': f'exported from {source.name} and checked against it',
        'recommended': _THRESHOLD if source.family == 'clipseg' else {},
    }
    text = json.dumps(manifest, indent=2) + '\n'
    (stage / MANIFEST_NAME).write_text(text, encoding='utf-8')

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Source -> verified bundle, put in place in one step or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import MANIFEST_NAME, Bundle, file_entry
from peace_ros.core.inference.manifest import FORMAT, PRECISIONS, ROLES_BY_FAMILY
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.lab.export import graphs, pictures
from peace_ros.lab.export.precision import to_fp16
from peace_ros.lab.export.quantiser import Quantiser
from peace_ros.lab.export.staging import staged
from peace_ros.lab.export.verify import Agreement, compare

if TYPE_CHECKING:
    from collections.abc import Sequence

    from peace_ros.core.domain import Frame
    from peace_ros.lab.export.sources import ModelSource

_WRITERS = {'clip': graphs.write_clip_graphs, 'clipseg': graphs.write_clipseg_graphs}
_THRESHOLD = {'threshold': 0.5}


def build_bundle(
    source: ModelSource,
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
        frames: images to verify on; None: drawn ones. For int8 most of them are measured to find
            scales, and it is verified on the others.
        licence: of the weights, as the manifest will say.

    Returns:
        How well the bundle agrees with the reference.

    Raises:
        BundleError: it does not agree well enough, or cannot be written. Nothing changes then.
    """
    measured: Sequence[Frame] = ()
    if precision == 'int8':
        measured, frames = pictures.divide_pictures(frames)
    frames = frames or pictures.draw_pictures(3)
    with staged(folder) as stage:
        _fill(stage, source, folder.name, precision, measured, 'checked', licence)
        agreement = compare(source, Bundle.load(stage), frames)
        agreement.refuse_if_poor(precision, source.name)
        _note_agreement(stage / MANIFEST_NAME, agreement)
    return agreement


def build_unchecked(
    source: ModelSource, folder: Path, *, precision: str, frames: Sequence[Frame], licence: str
) -> None:
    """Export and put in place, for bundles that are only timed; the manifest says so.

    Takes and raises what :func:`build_bundle` does; all frames are measured.
    """
    with staged(folder) as stage:
        _fill(stage, source, folder.name, precision, frames, 'not checked', licence)


def _fill(
    stage: Path,
    source: ModelSource,
    name: str,
    precision: str,
    frames: Sequence[Frame],
    done: str,
    licence: str,
) -> None:
    if precision not in PRECISIONS:
        raise BundleError(f'precision {precision!r}: choose one of {", ".join(PRECISIONS)}')
    source.vocabulary.write(stage / 'tokenizer.json', source.context_length)
    _write_graphs(source, stage, precision, frames)
    _write_manifest(source, stage, name, precision, done, licence)


def _write_graphs(
    source: ModelSource, stage: Path, precision: str, frames: Sequence[Frame]
) -> None:
    tokens = Tokenizer(stage / 'tokenizer.json', source.context_length)(pictures.TEXTS)
    quantiser = Quantiser(source, frames, tokens) if precision == 'int8' else None
    _WRITERS[source.family](
        source.model,
        stage,
        side_px=source.input.height,
        end_of_text=source.vocabulary.end_of_text,
        prepare=graphs.as_it_is if quantiser is None else quantiser.prepare,
    )
    if quantiser is not None:
        quantiser.rewrite(stage)
    elif precision == 'fp16':
        for file in sorted(stage.glob('*.onnx')):
            to_fp16(file)


def _write_manifest(
    source: ModelSource, stage: Path, name: str, precision: str, done: str, licence: str
) -> None:
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
        'provenance': f'exported from {source.name} and {done} against it',
        'recommended': _THRESHOLD if source.family == 'clipseg' else {},
    }
    text = json.dumps(manifest, indent=2) + '\n'
    (stage / MANIFEST_NAME).write_text(text, encoding='utf-8')


def _note_agreement(manifest: Path, agreement: Agreement) -> None:
    values = json.loads(manifest.read_text(encoding='utf-8'))
    values['verification'] = agreement.as_numbers()
    manifest.write_text(json.dumps(values, indent=2) + '\n', encoding='utf-8')

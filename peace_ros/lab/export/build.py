# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Source -> verified bundle, put in place complete or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from peace_ros.core.domain import BundleError, Frame
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.manifest import PRECISIONS
from peace_ros.core.inference.tokenizer import Tokenizer
from peace_ros.lab.export import graphs, pictures
from peace_ros.lab.export.precision import to_fp16
from peace_ros.lab.export.quantiser import Quantiser
from peace_ros.lab.export.sources import ModelSource
from peace_ros.lab.export.staging import change_manifest, staged, write_manifest
from peace_ros.lab.export.verify import ModelAgreement, compare


def build_bundle(
    source: ModelSource,
    folder: Path,
    *,
    precision: str = 'fp32',
    frames: Sequence[Frame] | None = None,
    licence: str = 'that of the source',
) -> ModelAgreement:
    """Export, verify and put in place.

    Args:
        source: the reference model.
        folder: of the bundle; an older one there stays until the new one has been verified.
        precision: ``fp32``, ``fp16`` or ``int8`` (for CPUs; the text encoder stays fp32, since it
            does not run for every frame).
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
        change_manifest(stage, verification=agreement.as_numbers())
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
    stage: Path, source: ModelSource, name: str, precision: str, frames: Sequence[Frame],
    done: str, licence: str,
) -> None:  # fmt: skip
    if precision not in PRECISIONS:
        raise BundleError(f'precision {precision!r}: choose one of {", ".join(PRECISIONS)}')
    source.vocabulary.write(stage / 'tokenizer.json', source.context_length)
    tokens = Tokenizer(stage / 'tokenizer.json', source.context_length)(pictures.TEXTS)
    quantiser = Quantiser(source, frames, tokens) if precision == 'int8' else None
    write = graphs.write_clip_graphs if source.family == 'clip' else graphs.write_clipseg_graphs
    write(
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
    write_manifest(
        stage,
        name,
        source.family,
        {'input': source.input},
        embedding_width=source.embedding_width,
        context_length=source.context_length,
        precision=precision,
        licence=licence,
        provenance=f'exported from {source.name} and {done} against it',
        recommended={'threshold': 0.5} if source.family == 'clipseg' else {},
    )

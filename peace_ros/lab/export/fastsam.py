# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FastSAM's segmenter and a CLIP bundle -> a bundle of the family fastsam."""

from __future__ import annotations

import logging
import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import onnx
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, ConfigurationError, Frame
from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.inference.manifest import PRECISIONS, InputSpec
from peace_ros.core.inference.session import Session, open_sessions
from peace_ros.lab.export.agreement import Agreement, cosine, mask_iou
from peace_ros.lab.export.batching import free_batch
from peace_ros.lab.export.convolutions import to_int8_convolutions
from peace_ros.lab.export.pictures import divide_pictures, draw_pictures, plain_pixels
from peace_ros.lab.export.precision import require_finite, to_fp16
from peace_ros.lab.export.segmenters import Outputs, SegmenterSource, load_segmenter
from peace_ros.lab.export.staging import change_manifest, staged, write_manifest

_LOG = logging.getLogger(__name__)

MOST_BOX_ERROR_PX = 0.01
MOST_ERROR = 1e-3
"""Of confidences, coefficients and prototypes, in fp32."""
_SUREST = 50
_CHECKED_BATCH = 3


@dataclass(frozen=True)
class SegmenterAgreement(Agreement):
    """How well a segmenter and its reference agree; the worst over all images."""

    box_error_px: float
    error: float
    """Largest difference of a confidence, a coefficient or a prototype."""
    cosine: float
    """The least of those of boxes, confidences, coefficients and prototypes."""
    iou: float
    """Of the most confident masks of the reference, at the same anchors, taken together."""

    MOST = MappingProxyType({'box_error_px': MOST_BOX_ERROR_PX, 'error': MOST_ERROR})


def export_fastsam(
    source: Path | SegmenterSource,
    clip: Bundle,
    folder: Path,
    *,
    side_px: int = 0,
    precision: str = 'fp32',
    frames: Sequence[Frame] | None = None,
) -> SegmenterAgreement:
    """Write a fastsam bundle, compare it with the reference, and only then put it in place.

    Args:
        source: FastSAM-s.pt, FastSAM-x.pt or an exported graph, see :func:`load_segmenter`.
        clip: bundle of the family clip; its own precision stays.
        folder: where the bundle goes; an older one there stays until the new one is verified.
        side_px: of the input, for a source that is a file.
        precision: of the segmenter: fp32, fp16 (GPU) or int8 (CPU).
        frames: images to verify on; None: drawn ones. For int8 most of them are measured to find
            scales, and it is verified on the others.

    Returns:
        How well the segmenter agrees with its reference.

    Raises:
        ConfigurationError: the precision or side is unknown, or ultralytics is missing.
        BundleError: source, CLIP bundle or folder cannot be used, or the exported network answers
            differently from its reference. Nothing changes then.
    """
    if precision not in PRECISIONS:
        raise ConfigurationError(f'precision {precision!r}: choose one of {", ".join(PRECISIONS)}')
    clip.require_family('clip')
    segmenter = load_segmenter(source, side_px) if isinstance(source, Path) else source
    measured: Sequence[Frame] = ()
    if precision == 'int8':
        measured, frames = divide_pictures(frames)
    images = plain_pixels(frames or draw_pictures(_CHECKED_BATCH), segmenter.side_px)
    with staged(folder) as stage:
        graph = stage / 'segmenter.onnx'
        segmenter.write(graph)
        if precision == 'fp16':
            to_fp16(graph)
        elif precision == 'int8':
            to_int8_convolutions(graph, plain_pixels(measured, segmenter.side_px))
        _write_image_encoder(clip, stage / 'image_encoder.onnx')
        for role in ('text_encoder', 'tokenizer'):
            path = clip.paths[role]
            shutil.copyfile(path, stage / f'{role}{path.suffix}')
        of_clip = clip.manifest
        crops = replace(of_clip.input, resize='letterbox', interpolation='area')
        side = segmenter.side_px
        whole = InputSpec(side, side, 'letterbox', (0.0,) * 3, (1.0,) * 3)
        write_manifest(
            stage,
            folder.name,
            'fastsam',
            {'input': whole, 'crop_input': crops},
            logit_scale=of_clip.logit_scale,
            embedding_width=of_clip.embedding_width,
            context_length=of_clip.context_length,
            precision=precision,
            licence=f'{segmenter.licence}; {of_clip.licence} (CLIP)',
            provenance=f'{segmenter.provenance} in {precision}; CLIP in {of_clip.precision}: '
            f'{of_clip.name}, {of_clip.provenance}',
            recommended={},
        )
        agreement = verify_segmenter(Bundle.load(stage), segmenter, images)
        agreement.refuse_if_poor(precision, segmenter.name)
        change_manifest(stage, verification=agreement.as_numbers())
    return agreement


def verify_segmenter(
    bundle: Bundle, source: SegmenterSource, images: Sequence[NDArray[np.float32]]
) -> SegmenterAgreement:
    """Compare the bundle's graphs with the contract and its segmenter with the reference.

    Raises BundleError for graphs that do not fit.
    """
    session = open_sessions(bundle, ('segmenter', 'image_encoder', 'text_encoder'))['segmenter']
    worst = SegmenterAgreement(0.0, 0.0, 1.0, 1.0)
    for pixels in images:
        predictions, prototypes = session.run([PREDICTIONS, PROTOTYPES], {PIXEL_VALUES: pixels})
        require_finite([predictions, prototypes], bundle.manifest.precision, source.name)
        found = _compare((predictions, prototypes), source.run(pixels), source.side_px)
        worst = SegmenterAgreement(
            max(worst.box_error_px, found.box_error_px),
            max(worst.error, found.error),
            min(worst.cosine, found.cosine),
            min(worst.iou, found.iou),
        )
    _LOG.info('%s: %s', bundle.paths['segmenter'].name, worst)
    return worst


def _compare(have: Outputs, wanted: Outputs, side_px: int) -> SegmenterAgreement:
    if [each.shape for each in have] != [each.shape for each in wanted]:
        return SegmenterAgreement(float('inf'), float('inf'), 0.0, 0.0)
    pairs = [
        (have[0][:, rows], wanted[0][:, rows]) for rows in (slice(4), slice(4, 5), slice(5, None))
    ]
    pairs.append((have[1], wanted[1]))
    errors = [float(np.abs(ours - theirs).max()) for ours, theirs in pairs]
    return SegmenterAgreement(
        errors[0],
        max(errors[1:]),
        min(cosine(ours, theirs) for ours, theirs in pairs),
        _surest_iou(have, wanted, side_px),
    )


def _surest_iou(have: Outputs, wanted: Outputs, side_px: int) -> float:
    """Return the IoU of the reference's most confident masks together, in prototype cells."""
    surest = np.argsort(-wanted[0][0, 4])[:_SUREST]
    return mask_iou(*(_masks(each, surest, side_px) for each in (have, wanted)))


def _masks(outputs: Outputs, anchors: NDArray[np.intp], side_px: int) -> NDArray[np.bool_]:
    """Return the masks of these anchors inside their boxes, [N, h, w]."""
    rows, prototypes = outputs[0][0][:, anchors].T, outputs[1][0]
    count, height, width = prototypes.shape
    masks = (rows[:, 5:] @ prototypes.reshape(count, -1)).reshape(-1, height, width) > 0.0
    x_px = (np.arange(width, dtype=np.float32) + np.float32(0.5)) * np.float32(side_px / width)
    y_px = (np.arange(height, dtype=np.float32) + np.float32(0.5)) * np.float32(side_px / height)
    in_columns = (np.abs(x_px - rows[:, :1]) < rows[:, 2:3] / 2)[:, None, :]
    in_rows = (np.abs(y_px - rows[:, 1:2]) < rows[:, 3:4] / 2)[:, :, None]
    inside: NDArray[np.bool_] = masks & in_columns & in_rows
    return inside


def _write_image_encoder(clip: Bundle, path: Path) -> None:
    """Write the CLIP bundle's image encoder, for any number of images.

    Raises BundleError when it answers differently for several images than for single ones.
    """
    source = clip.paths['image_encoder']
    model = onnx.load(str(source))
    single = Session(source)
    if any(isinstance(each.shape[0], int) for each in single.graph.inputs):
        free_batch(model)
    onnx.save(model, str(path))
    size = clip.manifest.input
    shape = (_CHECKED_BATCH, 3, size.height, size.width)
    images = np.random.default_rng(0).normal(0.0, 1.0, shape).astype(np.float32)
    wanted = [single.run([IMAGE_EMBEDDING], {PIXEL_VALUES: image[None]})[0] for image in images]
    remedy = 'export CLIP with a free batch axis'
    try:
        (have,) = Session(path).run([IMAGE_EMBEDDING], {PIXEL_VALUES: images})
    except BundleError as error:
        raise BundleError(
            f'{source}: takes one image at a time and could not be changed to take the segments '
            f'of a frame together ({error}); {remedy}'
        ) from error
    single_ones = np.concatenate(wanted)
    lengths = np.linalg.norm(single_ones, axis=1)
    error_of_unit = float((np.linalg.norm(have - single_ones, axis=1) / lengths).max())
    # Sums in another order round to other integers: int8 and fp16 have their usual limit.
    exact = clip.manifest.precision == 'fp32'
    most = MOST_ERROR if exact else math.sqrt(2.0 - 2.0 * Agreement.LEAST['cosine'])
    if not error_of_unit <= most:
        raise BundleError(
            f'{source}: embeddings of several images differ by {error_of_unit:.2g} from those of '
            f'single ones where {most:.2g} is allowed; {remedy}'
        )

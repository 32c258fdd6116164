# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""FastSAM's segmenter and a CLIP bundle -> a bundle of the family fastsam."""

from __future__ import annotations

import json
import logging
import math
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from peace_ros.core.domain import BundleError, ConfigurationError, Frame
from peace_ros.core.inference.bundle import MANIFEST_NAME, Bundle, file_entry
from peace_ros.core.inference.contract import IMAGE_EMBEDDING, PIXEL_VALUES, PREDICTIONS, PROTOTYPES
from peace_ros.core.inference.manifest import FORMAT, PRECISIONS
from peace_ros.core.inference.session import Session, open_sessions
from peace_ros.lab.export.batching import free_batch
from peace_ros.lab.export.convolutions import to_int8_convolutions
from peace_ros.lab.export.pictures import divide_pictures, draw_pictures, plain_pixels
from peace_ros.lab.export.precision import require_finite, to_fp16
from peace_ros.lab.export.segmenters import Outputs, SegmenterSource, load_segmenter
from peace_ros.lab.export.staging import staged

_LOG = logging.getLogger(__name__)

MOST_BOX_ERROR_PX = 0.01
MOST_ERROR = 1e-3
"""Of confidences, coefficients and prototypes, against the reference, fp32."""
LEAST_COSINE = 0.999
LEAST_IOU = 0.98
"""Of the surest masks; both for fp16 and int8, as for the other families."""
_SUREST = 50
_CHECKED_BATCH = 3


@dataclass(frozen=True)
class SegmenterAgreement:
    """How well a segmenter and its reference agree; the worst over all images."""

    box_error_px: float
    error: float
    """Largest difference of a confidence, a coefficient or a prototype."""
    cosine: float
    """The least of those of boxes, confidences, coefficients and prototypes."""
    iou: float
    """Of the surest masks of the reference, at the same anchors and taken together."""

    def refuse_if_poor(self, precision: str, what: str) -> None:
        """Raise BundleError when the bundle must not be used."""
        if precision == 'fp32':
            is_good = self.box_error_px <= MOST_BOX_ERROR_PX and self.error <= MOST_ERROR
            limit = f'{MOST_BOX_ERROR_PX} px and {MOST_ERROR} are allowed'
            remedy = 'export with other versions of torch and ultralytics'
        else:
            is_good = self.cosine >= LEAST_COSINE and self.iou >= LEAST_IOU
            limit = f'a cosine of {LEAST_COSINE} and an IoU of {LEAST_IOU} are needed'
            remedy = 'choose a higher precision, or more pictures like those of the flight'
        if not is_good:
            raise BundleError(
                f'{what} in {precision} does not agree with its reference: {self}; {limit}. '
                f'Nothing was written; {remedy}'
            )

    def __str__(self) -> str:
        return (
            f'boxes differ by {self.box_error_px:.2g} px and the rest by {self.error:.2g} at most, '
            f'cosine {self.cosine:.5f}, mask IoU {self.iou:.4f}'
        )


def export_fastsam(
    source: Path | SegmenterSource,
    clip: Bundle,
    folder: Path,
    *,
    side_px: int = 0,
    precision: str = 'fp32',
    frames: Sequence[Frame] | None = None,
) -> SegmenterAgreement:
    """Write a fastsam bundle, hold it against the reference, and only then put it in its place.

    Args:
        source: FastSAM-s.pt, FastSAM-x.pt or an exported graph, see :func:`load_segmenter`.
        clip: bundle of the family clip; its own precision stays.
        folder: where the bundle goes; one that is there stays until the new one is verified.
        side_px: of the input, for a source that is a file.
        precision: of the segmenter: fp32, fp16 (GPU) or int8 (CPU).
        frames: images to verify on; None: drawn ones. For int8 most of them are measured to find
            scales, and it is verified on the others.

    Returns:
        How well the segmenter agrees with its reference.

    Raises:
        ConfigurationError: the precision or side is unknown, or ultralytics is missing.
        BundleError: source, CLIP bundle or folder cannot be used, or the exported network answers
            otherwise than its reference. Nothing changes then.
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
        _write_manifest(stage, folder.name, clip, segmenter, precision)
        agreement = verify_segmenter(Bundle.load(stage), segmenter, images)
        agreement.refuse_if_poor(precision, segmenter.name)
        _note_agreement(stage / MANIFEST_NAME, agreement)
    return agreement


def verify_segmenter(
    bundle: Bundle, source: SegmenterSource, images: Sequence[NDArray[np.float32]]
) -> SegmenterAgreement:
    """Hold the bundle's graphs against the contract and its segmenter against the reference.

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
        min(_cosine(ours, theirs) for ours, theirs in pairs),
        _mask_iou(have, wanted, side_px),
    )


def _cosine(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    flat, other = a.ravel().astype(np.float64), b.ravel().astype(np.float64)
    return float(flat @ other / max(np.linalg.norm(flat) * np.linalg.norm(other), 1e-12))


def _mask_iou(have: Outputs, wanted: Outputs, side_px: int) -> float:
    """Return the IoU of the surest masks of the reference, taken together, in prototype cells."""
    surest = np.argsort(-wanted[0][0, 4])[:_SUREST]
    ours, theirs = (_masks(each, surest, side_px) for each in (have, wanted))
    union = np.count_nonzero(ours | theirs)
    return float(np.count_nonzero(ours & theirs) / union) if union else 1.0


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


def _note_agreement(manifest: Path, agreement: SegmenterAgreement) -> None:
    values = json.loads(manifest.read_text(encoding='utf-8'))
    values['verification'] = asdict(agreement)
    manifest.write_text(json.dumps(values, indent=2) + '\n', encoding='utf-8')


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
    # Sums in another order end on other integers: int8 and fp16 are held to what they are
    # elsewhere.
    exact = clip.manifest.precision == 'fp32'
    most = MOST_ERROR if exact else math.sqrt(2.0 - 2.0 * LEAST_COSINE)
    if not error_of_unit <= most:
        raise BundleError(
            f'{source}: embeddings of several images differ by {error_of_unit:.2g} from those of '
            f'single ones where {most:.2g} is allowed; {remedy}'
        )


def _write_manifest(
    stage: Path, name: str, clip: Bundle, segmenter: SegmenterSource, precision: str
) -> None:
    manifest = clip.manifest
    files = {path.name: file_entry(path) for path in sorted(stage.iterdir())}
    square: dict[str, Any] = {
        'width': segmenter.side_px,
        'height': segmenter.side_px,
        'resize': 'letterbox',
    }
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
        'precision': precision,
        'files': files,
        'licence': f'{segmenter.licence}; {manifest.licence} (CLIP)',
        'provenance': (
            f'{segmenter.provenance} in {precision}; CLIP in {manifest.precision}: '
            f'{manifest.name}, {manifest.provenance}'
        ),
        'recommended': {},
    }
    (stage / MANIFEST_NAME).write_text(json.dumps(values, indent=2) + '\n', encoding='utf-8')

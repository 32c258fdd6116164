# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m peace_ros.lab.training.average``: mean of a bundle and the one it continued from.

Fine-tuned weights are better on new data and worse on old data; a point between them and their
start is often good on both (M. Wortsman et al., Robust fine-tuning of zero-shot models, CVPR 2022).
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import numpy as np
import onnx
import typer
from onnx import numpy_helper

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.bundle import MANIFEST_NAME
from peace_ros.lab.export.staging import change_manifest, file_entry, staged

_FLOATS = (np.float16, np.float32)


def average(before: Path, after: Path, out: Path, share: float) -> None:
    """Write ``(1 - share) * before + share * after`` as a new bundle.

    Raises:
        BundleError: one of them is incomplete.
        ConfigurationError: the share, or two bundles that are not of one architecture.
    """
    if not 0.0 <= share <= 1.0:
        raise ConfigurationError(f'--share {share}: give 0 (all of the first) to 1')
    first, second = Bundle.load(before), Bundle.load(after)
    if first.paths.keys() != second.paths.keys():
        raise ConfigurationError(f'{before} and {after}: not bundles of one family')
    with staged(out) as stage:
        for role, path in second.paths.items():
            if path.suffix == '.onnx':
                mixed = _mix(onnx.load(str(first.paths[role])), onnx.load(str(path)), share, role)
                onnx.save(mixed, str(stage / path.name))
            else:
                shutil.copy2(path, stage)
        shutil.copy2(second.folder / MANIFEST_NAME, stage)
        change_manifest(
            stage,
            files={name: file_entry(stage / name) for name in second.manifest.files},
            provenance=f'{second.manifest.provenance} Averaged: {share:g} of these weights and '
            f'{1.0 - share:g} of those it went on from.',
            recommended={},  # a threshold belongs to the weights that it was chosen for
        )


def _mix(
    before: onnx.ModelProto, after: onnx.ModelProto, share: float, role: str
) -> onnx.ModelProto:
    known = {each.name: each for each in before.graph.initializer}
    for each in after.graph.initializer:
        other = known.get(each.name)
        if other is None or list(other.dims) != list(each.dims):
            raise ConfigurationError(
                f'{role}: weight {each.name} is not in both bundles; a bundle can only be '
                'averaged with the one that it continued from'
            )
        values = numpy_helper.to_array(each)
        if values.dtype in _FLOATS:
            old = numpy_helper.to_array(other).astype(np.float64)
            mean = (1.0 - share) * old + share * values.astype(np.float64)
            each.CopyFrom(numpy_helper.from_array(mean.astype(values.dtype), each.name))
    return after


def main(
    before: Annotated[Path, typer.Argument(help='Bundle that the training went on from.')],
    after: Annotated[Path, typer.Argument(help='Bundle that it wrote.')],
    out: Annotated[Path, typer.Option(help='Folder of the new bundle.')],
    share: Annotated[float, typer.Option(help='Part of the later weights, 0 to 1.')] = 0.9,
) -> None:
    """Average two bundles of one training line; then choose a threshold with `peace evaluate`."""
    try:
        average(before, after, out, share)
    except (BundleError, ConfigurationError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(2) from None


if __name__ == '__main__':
    typer.run(main)

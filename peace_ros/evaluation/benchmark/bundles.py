# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bundles that are measured when none are given: true sizes, random weights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from peace_ros.domain import BundleError
from peace_ros.evaluation.benchmark.worker import run_apart
from peace_ros.inference import Bundle

if TYPE_CHECKING:
    from collections.abc import Callable

NAMES = ('clipseg-rd64-fp32', 'clipseg-rd64-int8', 'clip-vit-b-32-int8')
_MAKER = f'{__name__}:build_random'


def random_bundles(folder: Path, say: Callable[[str], None]) -> dict[str, Path]:
    """Return name -> bundle; those that are not there yet are made, each in its own process.

    Raises BenchmarkError when the ``export`` extra is missing or a bundle cannot be made.
    """
    bundles = {}
    for name in NAMES:
        bundles[name] = folder.expanduser() / name
        try:
            Bundle.load(bundles[name])
        except BundleError:
            say(f'making {name} with random weights ...')
            run_apart(_MAKER, name=name, folder=str(bundles[name]))
    return bundles


def build_random(name: str, folder: str) -> str:
    """Make one of NAMES; returns how well it agrees with its reference."""
    from peace_ros.inference.export.build import build_bundle  # noqa: PLC0415 - needs torch
    from peace_ros.inference.export.random_models import (  # noqa: PLC0415
        random_clip,
        random_clipseg,
    )
    from peace_ros.inference.export.sources import from_model  # noqa: PLC0415

    stem, _, precision = name.rpartition('-')
    family = stem.split('-', maxsplit=1)[0]
    model = random_clipseg() if family == 'clipseg' else random_clip('ViT-B/32')
    source = from_model(stem, family, model)
    licence = 'random weights, none'
    return str(build_bundle(source, Path(folder), precision=precision, licence=licence))

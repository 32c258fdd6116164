# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bundles that are measured when none are given: true sizes, random weights."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path

from peace_ros.core.domain import BundleError
from peace_ros.core.inference import Bundle
from peace_ros.lab.benchmark.worker import run_apart

NAMES = ('clipseg-rd64-fp32', 'clipseg-rd64-int8', 'clip-vit-b-32-int8', 'fastsam-s-fp32')
FASTSAM_CLIP = 'clip-vit-b-32-int8'
SEGMENTS = 50
"""Planted in the segmenter's answers, because random weights find none."""
_RECIPE = '7'
"""Folder of the bundles; counts on when the export makes them another way."""
_AT_ONCE = 2
"""Processes that make bundles beside each other: much of it runs on one core."""
_LICENCE = 'random weights, none'
_MAKER = f'{__name__}:build_random'


def random_bundles(
    folder: Path, say: Callable[[str], None], names: Sequence[str] = NAMES
) -> dict[str, Path]:
    """Return name -> bundle; those that are not there yet are made and kept.

    Raises BenchmarkError when the ``export`` extra is missing or a bundle cannot be made.
    """
    bundles = {name: folder.expanduser() / _RECIPE / name for name in names}
    missing = missing_bundles(folder, names)
    # The precisions of one model are made in one process: it is drawn and loaded once. FastSAM's
    # comes after that of CLIP, which its bundle takes in.
    chains: dict[str, list[list[str]]] = {}
    for stem, group in groupby(missing, key=_stem):
        say(f'making {stem} with random weights ...')
        chains.setdefault('clipseg' if stem.startswith('clipseg') else 'clip', []).append(
            list(group)
        )

    def make(chain: list[list[str]]) -> None:
        for group in chain:
            run_apart(_MAKER, names=group, folder=str(folder.expanduser() / _RECIPE))

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        list(pool.map(make, chains.values()))
    return bundles


def missing_bundles(folder: Path, names: Sequence[str] = NAMES) -> list[str]:
    """Return which random bundles would have to be made, which takes the ``export`` extra."""
    return [name for name in names if not _is_whole(folder.expanduser() / _RECIPE / name)]


def _is_whole(path: Path) -> bool:
    try:
        Bundle.load(path)
    except BundleError:
        return False
    return True


def _stem(name: str) -> str:
    return name.rpartition('-')[0]


def build_random(names: Sequence[str], folder: str) -> None:
    """Make some of NAMES, all of one model. They are only timed, so nothing is checked."""
    import torch  # noqa: PLC0415 - the export extra

    torch.set_num_threads(max(1, (os.cpu_count() or 1) // _AT_ONCE))
    if names[0].startswith('fastsam'):
        for name in names:
            _build_fastsam(Path(folder) / name)
        return
    from peace_ros.lab.export.build import build_unchecked  # noqa: PLC0415
    from peace_ros.lab.export.pictures import draw_pictures  # noqa: PLC0415
    from peace_ros.lab.export.random_models import (  # noqa: PLC0415
        random_clip,
        random_clipseg,
    )
    from peace_ros.lab.export.sources import from_model  # noqa: PLC0415

    stem = _stem(names[0])
    family = stem.split('-', maxsplit=1)[0]
    source = from_model(
        stem, family, random_clipseg() if family == 'clipseg' else random_clip('ViT-B/32')
    )
    frames = draw_pictures(1)
    for name in names:
        precision = name.rpartition('-')[2]
        build_unchecked(
            source, Path(folder) / name, precision=precision, frames=frames, licence=_LICENCE
        )


def _build_fastsam(folder: Path) -> None:
    from peace_ros.lab.export.fastsam import export_fastsam  # noqa: PLC0415 - needs torch
    from peace_ros.lab.export.pictures import draw_pictures  # noqa: PLC0415
    from peace_ros.lab.export.random_fastsam import random_fastsam  # noqa: PLC0415
    from peace_ros.lab.export.segmenters import from_network  # noqa: PLC0415

    network = random_fastsam('s', planted=SEGMENTS)
    source = from_network(
        network, 'fastsam-s', network.side_px, licence=_LICENCE, provenance='random weights'
    )
    export_fastsam(
        source,
        Bundle.load(folder.with_name(FASTSAM_CLIP)),
        folder,
        precision=folder.name.rpartition('-')[2],
        frames=draw_pictures(1),
    )

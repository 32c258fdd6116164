# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where training pixels come from: drawn scenes cached on disk, and real images by licence."""

from __future__ import annotations

import csv
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np

from peace_ros.core.domain import Label, WorldError
from peace_ros.lab.training.annotations import VEGETATION, Annotation, load_annotations, rasterise
from peace_ros.lab.training.arrays import Image
from peace_ros.simulation.drawing import draw_scene

FRAME_PX = 352
"""Side of the segmenter's input; frame sides below are given for it."""
SCENE_PX = 512
GSD_RANGE_M = (0.02, 0.5)
"""A 73 degree view of 352 px from 5 m to 120 m height."""
_BUILT_UP = ('suburb', 'city', 'village', 'park', 'riverside', 'industrial')
"""Layouts with the most classes; two scenes in five have one of these."""
VALIDATION_SEED = 10_000_000
"""Scenes with seeds from here on are never trained on."""


@dataclass(frozen=True)
class TrainingSource:
    """One image with its pixel classes, in sizes 1, 1/2, 1/4, ... for views from afar."""

    name: str
    kind: str
    """``drawn``, ``satellite`` or ``drone``."""
    images_rgb: tuple[Image, ...]
    classes: tuple[Image, ...]
    """Labels or partial classes, uint8."""
    gsd_m: float
    """Of the largest size; for real images an estimate that only sizes pasted things."""
    frame_side_px: tuple[float, float]
    """Smallest and largest side of a frame, in pixels of the largest size."""
    season: str = ''
    origin: str = ''
    """Publisher and licence of a real image."""


def build_source(
    name: str, kind: str, image_rgb: Image, classes: Image, gsd_m: float,
    frame_side_px: tuple[float, float], season: str = '', origin: str = '',
) -> TrainingSource:  # fmt: skip
    """Halve image and classes as often as the largest frame needs."""
    images, rasters = [image_rgb], [classes]
    while frame_side_px[1] / 2 ** len(images) > FRAME_PX * 0.75 and min(images[-1].shape[:2]) > 256:
        height, width = images[-1].shape[0] // 2, images[-1].shape[1] // 2
        half = cv2.resize(images[-1], (width, height), interpolation=cv2.INTER_AREA)
        raster = cv2.resize(rasters[-1], (width, height), interpolation=cv2.INTER_NEAREST)
        images.append(np.asarray(half, dtype=np.uint8))
        rasters.append(np.asarray(raster, dtype=np.uint8))
    return TrainingSource(
        name, kind, tuple(images), tuple(rasters), gsd_m, frame_side_px, season, origin
    )


_DUBAI = 'Semantic segmentation of aerial imagery, Humans in the Loop with MBRSC (CC0-1.0)'


def read_image(path: Path, flag: int = cv2.IMREAD_COLOR) -> Image:
    """Return an image, RGB or as the flag of OpenCV says; raises WorldError."""
    image = cv2.imread(str(path), flag)
    if image is None:
        raise WorldError(f'{path}: cannot be read as an image; download it again')
    if flag == cv2.IMREAD_COLOR:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    return np.ascontiguousarray(image, dtype=np.uint8)


def load_dubai(folder: Path) -> list[TrainingSource]:
    """Load the labelled satellite tiles of manifest.csv whose split is ``train``.

    Their vegetation class mixes lawn and trees, so it becomes the partial class of both.
    """
    sources = []
    with (folder / 'manifest.csv').open(newline='') as file:
        rows = [row for row in csv.DictReader(file) if row['split'] == 'train']
    for row in rows:
        classes = read_image(folder / row['label'], cv2.IMREAD_GRAYSCALE)
        classes[classes == Label.GRASS] = VEGETATION
        image = read_image(folder / row['image'])
        side = float(min(image.shape[:2]))
        sources.append(
            build_source(
                row['image'], 'satellite', image, classes, 0.35, (90.0, 1.1 * side), origin=_DUBAI
            )
        )
    return sources


def annotated_photographs(folder: Path, *, is_validation: bool) -> list[tuple[Annotation, Path]]:
    """Return those that lie in ``ortho`` of the folder, kept for validation or not."""
    paths = [(each, folder / 'ortho' / f'{each.name}.jpg') for each in load_annotations()]
    return [
        (each, path)
        for each, path in paths
        if each.is_validation == is_validation and path.is_file()
    ]


def load_drone(folder: Path) -> list[TrainingSource]:
    """Load the annotated photographs that lie in ``ortho`` of the folder, with our polygons.

    Those kept for validation are left out. All are under licences that allow derived weights.
    Missing pictures are left out: they come from many places, and the provenance lists the sources
    of those that a run had.
    """
    sources = []
    for annotation, path in annotated_photographs(folder, is_validation=False):
        image = read_image(path)
        classes = rasterise(annotation, image.shape[1], image.shape[0])
        origin = f'{annotation.origin} ({annotation.licence})'
        frame, gsd_m = annotation.frame_px, annotation.gsd_m
        sources.append(
            build_source(annotation.name, 'drone', image, classes, gsd_m, frame, origin=origin)
        )
    return sources


def load_real(folder: Path | None) -> list[TrainingSource]:
    """Load every real image that may be trained on; none when no folder is given."""
    if folder is None:
        return []
    return load_dubai(folder) + load_drone(folder)


def credits_of(sources: list[TrainingSource]) -> str:
    """Return `` and N real images: `` with their publishers and licences; empty without any."""
    real = [source for source in sources if source.kind != 'drawn']
    if not real:
        return ''
    return f' and {len(real)} real images: {", ".join(sorted({each.origin for each in real}))}'


def _draw_scene(path: Path, seed: int, size_px: int) -> None:
    cv2.setNumThreads(1)
    rng = np.random.default_rng([seed, 77])
    low, high = np.log(GSD_RANGE_M[0]), np.log(GSD_RANGE_M[1])
    gsd_m = float(np.exp(rng.uniform(low, high)))
    built_up = rng.random() < 0.4
    layout = _BUILT_UP[int(rng.integers(len(_BUILT_UP)))] if built_up else None
    if seed >= VALIDATION_SEED:
        layout = None
    scene = draw_scene(seed, size_px, gsd_m, layout=layout)
    unfinished = path.with_suffix('.part.npz')
    np.savez(
        unfinished, image=scene.image_rgb, labels=scene.labels, gsd_m=scene.gsd_m,
        season=str(scene.season),
    )  # fmt: skip
    # Only whole files carry the final name, also when the process is killed.
    unfinished.replace(path)


def load_drawn(
    cache: Path,
    seeds: range,
    *,
    size_px: int = SCENE_PX,
    workers: int = 2,
    report: Callable[[int], None] | None = None,
) -> list[TrainingSource]:
    """Draw the scenes of the seeds, or take them from the cache folder.

    ``report`` is called with the number of scenes that are ready. The cache must be emptied when
    the drawing code changes.
    """
    cache.mkdir(parents=True, exist_ok=True)
    paths = [cache / f'scene_{seed}_{size_px}.npz' for seed in seeds]
    jobs = [(path, seed) for path, seed in zip(paths, seeds, strict=True) if not path.exists()]
    draw = partial(_draw_scene, size_px=size_px)
    if jobs and workers > 1:
        # Not by forking: threads of torch or of a test runner may hold locks, which stay held.
        with ProcessPoolExecutor(workers, get_context('spawn')) as pool:
            for done, _ in enumerate(pool.map(draw, *zip(*jobs, strict=True), chunksize=4)):
                if report is not None:
                    report(len(paths) - len(jobs) + done + 1)
    else:
        for path, seed in jobs:
            draw(path, seed)
    return [_load_scene(path) for path in paths]


def _load_scene(path: Path) -> TrainingSource:
    with np.load(path) as stored:
        image = np.ascontiguousarray(stored['image'])
        side = float(image.shape[0])
        return build_source(
            path.stem,
            'drawn',
            image,
            np.ascontiguousarray(stored['labels']),
            float(stored['gsd_m']),
            (0.45 * side, 0.95 * side),
            str(stored['season']),
        )

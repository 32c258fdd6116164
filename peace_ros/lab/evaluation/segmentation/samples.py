# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Labelled images from folders, manifests, datasets as downloaded, and drawn scenes."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Label
from peace_ros.lab.evaluation.segmentation.classes import (
    ClassTable,
    Converter,
    dataset_names,
    find_table,
    parse_classes,
    read_yaml,
    whole_number,
)
from peace_ros.lab.evaluation.segmentation.errors import DatasetError, SampleError
from peace_ros.simulation.drawing import draw_scene
from peace_ros.simulation.picture_files import RasterError
from peace_ros.simulation.rasters import IMAGE_SUFFIXES, read_indices, read_photo

CAMERA_PX = 1056
"""Side of the drawn views, where that is not finer than FINEST_M."""
FINEST_M = 0.02
"""Metres of ground in the smallest pixel that is drawn: views from low down have fewer pixels."""
DRAWN_SEED = 20_000_000
"""First seed of drawn scenes here; training stays far below it."""
HEIGHTS_M = (5.0, 120.0)
"""Of the drawn views, under a lens of FOV_DEG; even in the logarithm."""
FOV_DEG = 73.0

_LARGEST_TABLE = 256 << 20

Pair = tuple[NDArray[np.uint8], NDArray[np.uint8]]
"""Image, height x width x 3 RGB, and its labels, height x width of Label."""


class Sample(Protocol):
    """One labelled image."""

    @property
    def name(self) -> str:
        """Name that is shown."""
        ...

    def load(self) -> Pair:
        """Return image and labels of one size; raises SampleError."""
        ...


@dataclass(frozen=True)
class Skipped:
    """Something that was not scored."""

    name: str
    reason: str


@dataclass(frozen=True)
class SampleSource:
    """Labelled images with one table of classes."""

    title: str
    samples: tuple[Sample, ...]
    skipped: tuple[Skipped, ...] = ()
    tile_px: int | None = None
    """Side of the square tiles that suits them; None: the shorter side of each image."""
    remarks: tuple[str, ...] = ()
    max_looks: int = 0
    """Looks per tile that suit them, see :mod:`peace_ros.core.segmentation.looks`; 0: no matter."""


@dataclass(frozen=True)
class FileSample:
    """An image file and a label file."""

    name: str
    image: Path
    label: Path
    convert: Converter

    def load(self) -> Pair:
        """Read both files."""
        try:
            image, known, orientation = read_photo(self.image)
            indices = self.convert.masks == 'indices'
            raster = read_indices(self.label) if indices else read_photo(self.label).rgb
        except RasterError as error:
            raise SampleError(str(error)) from error
        if raster.shape[:2] != image.shape[:2]:
            raise SampleError(
                f'labels of {raster.shape[1]} x {raster.shape[0]} px for an image of '
                f'{image.shape[1]} x {image.shape[0]} px'
                + (f', upright by its EXIF orientation {orientation}' if orientation != 1 else '')
                + ': both must be of one size'
            )
        labels = self.convert(raster)
        if known is not None:
            labels = np.where(known, labels, np.uint8(Label.UNLABELED))
        if not labels.any():
            raise SampleError('no pixel of a class that counts: nothing to score')
        return image, labels


@dataclass(frozen=True)
class DrawnSample:
    """A scene that is drawn when it is needed; the same seed gives the same view."""

    seed: int
    camera_px: int = CAMERA_PX
    """Most pixels on a side."""
    shape: float = 1.0
    """Width over height; wide frames are the middle rows of the square."""

    @property
    def name(self) -> str:
        """Seed and height."""
        return f'drawn {self.seed}, {self.height_m:.0f} m'

    @property
    def height_m(self) -> float:
        """Height of a camera of FOV_DEG that sees this much ground."""
        low, high = np.log(HEIGHTS_M)
        rng = np.random.Generator(np.random.PCG64([self.seed, 4]))
        return float(np.exp(rng.uniform(low, high)))

    def load(self) -> Pair:
        """Draw it."""
        extent_m = 2.0 * self.height_m * np.tan(np.radians(FOV_DEG / 2.0))
        side_px = min(self.camera_px, int(extent_m / FINEST_M))
        scene = draw_scene(self.seed, side_px, float(extent_m / side_px))
        rows = round(side_px / self.shape)
        middle = slice((side_px - rows) // 2, (side_px - rows) // 2 + rows)
        return np.ascontiguousarray(scene.image_rgb[middle]), scene.labels[middle]


def drawn_source(
    count: int, first_seed: int = DRAWN_SEED, camera_px: int = CAMERA_PX, shape: float = 1.0
) -> SampleSource:
    """Return scenes that no training has seen, as a camera so many pixels wide sees them."""
    seeds = range(first_seed, first_seed + count)
    low, high = HEIGHTS_M
    return SampleSource(
        f'{count} drawn scenes, seeds {first_seed} on, from {low:g} to {high:g} m, '
        f'{camera_px} px, {shape:.3g} : 1',
        tuple(DrawnSample(seed, camera_px, shape) for seed in seeds),
    )


def paired(
    pairs: Iterable[tuple[str, Path, Path | None, str]], convert: Converter
) -> tuple[tuple[Sample, ...], list[Skipped]]:
    """Return samples, and what has no label, of (name, image, label, reason for no label)."""
    found = list(pairs)
    samples = tuple(FileSample(name, image, at, convert) for name, image, at, _ in found if at)
    return samples, [Skipped(name, reason) for name, _, at, reason in found if at is None]


def folder_source(images: Path, labels: Path, classes: str, mixed: str) -> SampleSource:
    """Return the images of a folder (and those below it) with label files of the same stem.

    The label of ``a/b.jpg`` is ``a/b.png`` or ``a/b_label.png`` in the folder of labels.

    Raises DatasetError when a folder is missing, there is no image or the table is unusable.
    """
    for option, folder in (('--images', images), ('--labels', labels)):
        if not folder.is_dir():
            raise DatasetError(f'{option} {folder} is not a folder: give one')
    found = _images(images.rglob('*'))
    if not found:
        raise DatasetError(f'{images} holds no image ({", ".join(IMAGE_SUFFIXES)})')
    convert, remarks = _converter(classes, mixed)
    pairs: list[tuple[str, Path, Path | None, str]] = []
    for image in found:
        name = image.relative_to(images)
        choices = [labels / name.with_name(name.stem + end) for end in ('.png', '_label.png')]
        label = next((each for each in choices if each.is_file()), None)
        pairs.append((str(name), image, label, f'no label: {choices[0]} does not exist'))
    samples, skipped = paired(pairs, convert)
    used = {label for _, _, label, _ in pairs}
    skipped += [
        Skipped(str(path.relative_to(labels)), 'a label without an image')
        for path in _images(labels.rglob('*'))
        if path not in used and images.resolve() != labels.resolve()
    ]
    return SampleSource(str(images), samples, tuple(skipped), remarks=remarks)


def manifest_source(manifest: Path, split: str, classes: str, mixed: str) -> SampleSource:
    """Return the pairs that a CSV file lists in its columns image and label.

    Paths are relative to the file. With a split, only rows whose column ``split`` says so.

    Raises DatasetError.
    """
    rows = _csv_rows(manifest)
    columns = sorted(rows[0]) if rows else []
    if not {'image', 'label'} <= set(columns):
        raise DatasetError(
            f'{manifest} has the columns {", ".join(columns) or "of no row"}: give rows with the '
            'columns image and label'
        )
    chosen = [row for row in rows if not split or row.get('split') == split]
    if not chosen:
        known = sorted({row.get('split') or '' for row in rows})
        raise DatasetError(
            f'{manifest}: no row of split {split!r}: choose one of {", ".join(known)}'
        )
    convert, remarks = _converter(classes, mixed)
    folder, reason = manifest.parent, 'no label in the manifest'
    labels = [folder / row['label'] if row['label'] else None for row in chosen]
    names = [row['image'] for row in chosen]
    samples, skipped = paired(
        ((name, folder / name, at, reason) for name, at in zip(names, labels, strict=True)), convert
    )
    return SampleSource(
        f'{manifest}{f", split {split}" if split else ""}',
        samples,
        tuple(skipped),
        remarks=remarks,
        max_looks=_looks_of({row.get('dataset') or '' for row in chosen}),
    )


def _csv_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows by column, also as spreadsheets write them (byte order mark, ;)."""
    try:
        if (path.exists() and not path.is_file()) or path.stat().st_size > _LARGEST_TABLE:
            raise DatasetError(
                f'{path} is not a regular file of up to {_LARGEST_TABLE >> 20} MiB: give a CSV'
            )
        text = path.read_text(encoding='utf-8-sig')
        head = text.partition('\n')[0]
        delimiter = max(',;\t', key=head.count)
        table = csv.DictReader(StringIO(text, newline=''), delimiter=delimiter, restval='')
        return [
            {name.strip(): value.strip() for name, value in row.items() if isinstance(name, str)}
            for row in table
        ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DatasetError(f'{path} cannot be read as CSV: {error}') from error


def _looks_of(datasets: set[str]) -> int:
    """Return the looks that suit the dataset that all rows name, if it is one of the shipped."""
    (name, *others) = datasets
    if others or name not in dataset_names():
        return 0
    path = find_table(name)
    return whole_number(read_yaml(path), 'max_looks', 1, path) or 0


def mixed_remarks(table: ClassTable, mixed: str) -> tuple[str, ...]:
    """Return the sentences about classes that hold safe and unsafe ground alike."""
    told = {
        'ignore': 'is not counted',
        'safe': 'counts as safe, trees and roads in it too',
        'unsafe': 'counts as unsafe, lawn in it too',
    }[mixed]
    return tuple(
        f'class {each.name} holds safe and unsafe ground alike and {told} (--mixed {mixed})'
        for each in table.entries
        if each.side == 'mixed'
    )


def _converter(classes: str, mixed: str) -> tuple[Converter, tuple[str, ...]]:
    path = find_table(classes)
    table = parse_classes(read_yaml(path), str(path))
    return table.converter(table.masks(), mixed), mixed_remarks(table, mixed)


def _images(paths: Iterable[Path]) -> list[Path]:
    found = [path for path in paths if path.suffix.lower() in IMAGE_SUFFIXES and path.is_file()]
    return sorted(found)


def sampled(source: SampleSource, limit: int | None) -> SampleSource:
    """Return at most ``limit`` of the samples, evenly spread over the source."""
    count = len(source.samples)
    if limit is None or limit >= count:
        return source
    places = np.linspace(0, count - 1, limit).round().astype(int).tolist()
    chosen = tuple(source.samples[place] for place in places)
    return replace(source, title=f'{source.title}, {limit} of {count}', samples=chosen)


def nearest(labels: NDArray[np.uint8], width_px: int, height_px: int) -> NDArray[np.uint8]:
    """Return labels at another size, nearest neighbour."""
    if labels.shape == (height_px, width_px):
        return labels
    resized = cv2.resize(labels, (width_px, height_px), interpolation=cv2.INTER_NEAREST)
    return np.asarray(resized, np.uint8)

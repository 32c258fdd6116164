# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Datasets in the folders that users get when they download them, each described by a YAML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from peace_ros.lab.evaluation.segmentation.classes import (
    COMMON,
    MASKS,
    find_table,
    parse_classes,
    read_yaml,
    whole_number,
)
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.samples import (
    SampleSource,
    mixed_remarks,
    paired,
)
from peace_ros.simulation.rasters import IMAGE_SUFFIXES


def dataset_source(name: str, root: Path, split: str, mixed: str) -> SampleSource:
    """Return the images of a dataset as it was downloaded.

    Args:
        name: of a file in config/datasets, or such a file of one's own.
        root: folder that holds the dataset, or a folder above it.
        split: one of the dataset's splits, or empty for all images that have labels.
        mixed: how classes count that hold safe and unsafe ground alike, one of MIXED.

    Raises:
        DatasetError: the dataset, its root or the split is unknown, or the folders hold no image
            in any layout of the dataset.
    """
    if name == COMMON:
        raise DatasetError(f'dataset {name!r} has no folders of its own: use --images and --labels')
    path = find_table(name)
    content = read_yaml(path)
    table = parse_classes(content, str(path))
    if not root.is_dir():
        raise DatasetError(f'--root {root} is not a folder: give the one that holds {name}')
    layout, images = _find(content, root, path)
    chosen = _of_split(images, content, root, split, path)
    pairs: list[tuple[str, Path, Path | None, str]] = []
    for image in chosen:
        label, name = _label_of(image, layout), str(image.relative_to(root))
        there = label if label.is_file() else None
        pairs.append((name, image, there, f'no label: {label} does not exist'))
    samples, skipped = paired(pairs, table.converter(layout['masks'], mixed))
    title = f'{content.get("title", name)}{f", {split}" if split else ""}'
    remarks = [*mixed_remarks(table, mixed)]
    if not table.has_safe(mixed):
        remarks.append(
            f'{title} then has no safe ground: recall and IoU of safe mean nothing, the shares of '
            'hazards called safe do'
        )
    return SampleSource(
        title,
        samples,
        tuple(skipped),
        whole_number(content, 'tile_px', 16, path),
        tuple(remarks),
        whole_number(content, 'max_looks', 1, path) or 0,
    )


def _find(content: dict[str, Any], root: Path, path: Path) -> tuple[dict[str, Any], list[Path]]:
    """Return the first layout that fits a pair of files; else the first that fits an image."""
    fallback = None
    layouts = content.get('layouts') or []
    for layout in layouts:
        _check_layout(layout, path)
        ending = layout.get('ending', '')
        images = sorted(
            each
            for each in root.glob(layout['images'])
            if each.suffix.lower() in IMAGE_SUFFIXES and each.name.endswith(ending)
        )
        if any(_label_of(each, layout).is_file() for each in images):
            return layout, images
        if images and fallback is None:
            fallback = layout, images
    if fallback is None:
        globs = ', '.join(dict.fromkeys(str(layout['images']) for layout in layouts))
        raise DatasetError(
            f'{root} holds no image in a layout of {path.stem} ({globs or "it has none"}): give '
            'the folder that was unpacked'
        )
    return fallback


def _check_layout(layout: Any, path: Path) -> None:
    texts = ('images', 'label', 'masks')
    fits = isinstance(layout, dict) and all(isinstance(layout.get(key), str) for key in texts)
    if not fits or layout['masks'] not in MASKS:
        raise DatasetError(
            f'{path}: layout {layout!r}: give images, label and masks ({" or ".join(MASKS)})'
        )


def _label_of(image: Path, layout: dict[str, Any]) -> Path:
    ending = layout.get('ending') or image.suffix
    folder = str(image.parent)
    for old, new in (layout.get('swap') or {}).items():
        folder = folder.replace(old, new)
    stem = image.name[: -len(ending)]
    text: str = layout['label'].replace('{folder}', folder).replace('{stem}', stem)
    return Path(text)


def _of_split(
    images: list[Path], content: dict[str, Any], root: Path, split: str, path: Path
) -> list[Path]:
    if not split:
        return images
    splits = content.get('splits') or {}
    if split not in splits:
        raise DatasetError(
            f'split {split!r} of {path.stem}: choose one of {", ".join(splits) or "none"}'
        )
    names = [str(each) for each in splits[split]]
    stems: set[str] = set()
    for listed in (name for name in names if name.endswith('.txt')):
        for file in sorted(root.rglob(listed)):
            stems |= {Path(line.strip()).stem for line in file.read_text().splitlines()}
    chosen = [
        image
        for image in images
        if image.stem in stems or set(image.relative_to(root).parts) & set(names)
    ]
    if not chosen:
        raise DatasetError(
            f'{root} holds no image of split {split!r}: looked for {", ".join(names)}'
        )
    return chosen

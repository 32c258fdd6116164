# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Class tables: which label each value or colour of a label raster stands for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core import yaml_files
from peace_ros.core.domain import SAFE_LABELS, ConfigurationError, Label
from peace_ros.core.resources import config_dir
from peace_ros.lab.evaluation.segmentation.errors import DatasetError, SampleError

COMMON = 'common'
SIDES = ('safe', 'unsafe', 'mixed', 'ignore')
MIXED = ('ignore', 'safe', 'unsafe')
"""How a class that holds safe and unsafe ground alike may count."""
MASKS = ('indices', 'colours')
_UNKNOWN = 255
_SHOWN = 5


@dataclass(frozen=True)
class ClassEntry:
    """One class of a dataset."""

    name: str
    side: str
    """One of SIDES."""
    label: Label
    """UNLABELED on the side ``ignore``; on ``mixed`` what it is when it counts as safe."""
    or_label: Label
    """On ``mixed`` what it is when it counts as unsafe; else ``label``."""
    index: int | None
    colour_rgb: tuple[int, int, int] | None

    def counted_as(self, mixed: str) -> Label:
        """Return the label that it counts as; ``mixed`` is one of MIXED."""
        if self.side != 'mixed':
            return self.label
        return {'safe': self.label, 'unsafe': self.or_label}.get(mixed, Label.UNLABELED)


class ClassTable:
    """The classes of a dataset, by index and by colour."""

    def __init__(self, where: str, entries: tuple[ClassEntry, ...]) -> None:
        self.where = where
        self.entries = entries

    def masks(self) -> str:
        """Return whether it lists indices (which go first) or colours."""
        return 'indices' if all(each.index is not None for each in self.entries) else 'colours'

    def has_safe(self, mixed: str) -> bool:
        """Tell whether any class counts as safe."""
        return any(each.counted_as(mixed) in SAFE_LABELS for each in self.entries)

    def converter(self, masks: str, mixed: str) -> Converter:
        """Return what turns rasters into labels.

        Raises DatasetError when a class has no index (``masks`` = indices) or colour (colours).
        """
        keys: dict[int, Label] = {}
        for each in self.entries:
            key = each.index if masks == 'indices' else _packed(each.colour_rgb)
            if key is None:
                raise DatasetError(
                    f'{self.where}: class {each.name} is not among the {masks}, which its label '
                    'images need: add its index or colour'
                )
            if key in keys:
                raise DatasetError(f'{self.where}: class {each.name}: its value is used twice')
            keys[key] = each.counted_as(mixed)
        return Converter(masks, keys)


class Converter:
    """Turns label rasters of one dataset into those of this project."""

    def __init__(self, masks: str, keys: dict[int, Label]) -> None:
        self._masks = masks
        self._table = np.full(256 if masks == 'indices' else 1 << 24, _UNKNOWN, np.uint8)
        for key, label in keys.items():
            self._table[key] = label

    @property
    def masks(self) -> str:
        """One of MASKS."""
        return self._masks

    def __call__(self, raster: NDArray[Any]) -> NDArray[np.uint8]:
        """Return height x width uint8 of :class:`Label`.

        Args:
            raster: height x width of indices, or height x width x 3 RGB uint8.

        Raises SampleError that names values that are in no class, and how many pixels have them.
        """
        if self._masks == 'colours':
            values = raster[..., 0].astype(np.uint32)
            for channel in (1, 2):
                values <<= 8
                values |= raster[..., channel]
        else:
            values = raster
            if values.max(initial=0) > 255:
                raise SampleError(
                    f'label value {int(values.max())} is in no class: indices are 0 to 255'
                )
        labels: NDArray[np.uint8] = self._table[values]
        unknown = labels == _UNKNOWN
        if unknown.any():
            raise SampleError(self._complaint(values[unknown], labels.size))
        return labels

    def _complaint(self, values: NDArray[Any], total: int) -> str:
        found, counts = np.unique(values, return_counts=True)
        order = np.argsort(-counts)[:_SHOWN]
        names = ', '.join(
            f'{self._text(int(found[i]))} ({int(counts[i])} px)' for i in order.tolist()
        )
        more = f' and {len(found) - _SHOWN} more' if len(found) > _SHOWN else ''
        return (
            f'label value {names}{more} in no class, {values.size} of {total} px: '
            'correct the label image or the class table'
        )

    def _text(self, value: int) -> str:
        if self._masks == 'indices':
            return str(value)
        return f'RGB ({value >> 16}, {value >> 8 & 255}, {value & 255})'


def datasets_dir() -> Path:
    """Return the folder of the shipped dataset tables."""
    return config_dir() / 'datasets'


def dataset_names() -> list[str]:
    """Return the names of the shipped datasets."""
    return sorted(path.stem for path in datasets_dir().glob('*.yaml') if path.stem != COMMON)


def find_table(name_or_path: str) -> Path:
    """Return the file of a shipped table's name (``common``, ``uavid``) or of a path.

    Raises DatasetError.
    """
    path = Path(name_or_path).expanduser()
    if path.suffix in {'.yaml', '.yml'} and path.is_file():
        return path
    shipped = datasets_dir() / f'{name_or_path.lower().replace("-", "_")}.yaml'
    if Path(name_or_path).name == name_or_path and shipped.is_file():
        return shipped
    raise DatasetError(
        f'class table {name_or_path!r} does not exist: give a YAML file or one of '
        f'{", ".join([COMMON, *dataset_names()])}'
    )


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file; raises DatasetError."""
    try:
        content = yaml_files.read_yaml(path, 'give a class table as in config/datasets')
    except ConfigurationError as error:
        raise DatasetError(str(error)) from error
    if not isinstance(content, dict) or not isinstance(content.get('classes'), dict):
        raise DatasetError(f'{path}: has no table "classes"; see config/datasets/common.yaml')
    return content


def whole_number(content: dict[str, Any], key: str, least: int, path: Path) -> int | None:
    """Return a number that a dataset's file may give; raises DatasetError."""
    number = content.get(key)
    if number is None or (type(number) is int and number >= least):
        return number
    raise DatasetError(f'{path}: {key} {number!r}: give {least} or more')


def parse_classes(content: dict[str, Any], where: str) -> ClassTable:
    """Read the table ``classes`` of a dataset's YAML.

    Raises DatasetError that names the file and the class: an unknown side or label, a label that
    stands on the wrong side, neither index nor colour.
    """
    entries = []
    for side, rows in content['classes'].items():
        if side not in SIDES or not isinstance(rows, list):
            raise DatasetError(f'{where}: classes.{side}: give lists under {", ".join(SIDES)}')
        entries += [_entry(side, row, where) for row in rows]
    if not entries:
        raise DatasetError(f'{where}: no classes; see config/datasets/common.yaml')
    return ClassTable(where, tuple(entries))


def _entry(side: str, row: Any, where: str) -> ClassEntry:
    if not isinstance(row, dict) or not isinstance(row.get('name'), str):
        raise DatasetError(f'{where}: {row!r}: give a class with name, label, and index or colour')
    where = f'{where}: class {row["name"]}'
    unknown = set(row) - {'name', 'index', 'colour', 'label', 'or'}
    if unknown:
        raise DatasetError(f'{where}: {", ".join(sorted(unknown))}: unknown, remove it')
    label = or_label = Label.UNLABELED
    if side != 'ignore':
        label = _label(row.get('label'), where, safe=side != 'unsafe')
        or_label = _label(row.get('or'), where, safe=False) if side == 'mixed' else label
    index, colour = row.get('index'), row.get('colour')
    if index is None and colour is None:
        raise DatasetError(f'{where}: has neither index nor colour: give one')
    if index is not None and not _are_bytes([index]):
        raise DatasetError(f'{where}: index {index!r}: give 0 to 255')
    fits = isinstance(colour, list) and len(colour) == 3 and _are_bytes(colour)
    if colour is not None and not fits:
        raise DatasetError(f'{where}: colour {colour!r}: give [red, green, blue], 0 to 255')
    return ClassEntry(row['name'], side, label, or_label, index, colour and tuple(colour))


def _are_bytes(values: list[Any]) -> bool:
    return all(type(each) is int and 0 <= each <= 255 for each in values)


def _label(name: Any, where: str, *, safe: bool) -> Label:
    fitting = {
        each.name.lower(): each
        for each in Label
        if each != Label.UNLABELED and (each in SAFE_LABELS) == safe
    }
    if str(name) not in fitting:
        raise DatasetError(
            f'{where}: label {name!r} on this side: give one of {", ".join(fitting)}'
        )
    return fitting[str(name)]


def _packed(colour_rgb: tuple[int, int, int] | None) -> int | None:
    return None if colour_rgb is None else int.from_bytes(bytes(colour_rgb), 'big')

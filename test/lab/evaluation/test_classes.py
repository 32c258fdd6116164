# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Label rasters mean what their table says, and what no table says is never guessed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import Label
from peace_ros.lab.evaluation.segmentation.classes import (
    dataset_names,
    find_table,
    parse_classes,
    read_yaml,
)
from peace_ros.lab.evaluation.segmentation.errors import DatasetError, SampleError


def table_of(name: str) -> Any:
    path = find_table(name)
    return parse_classes(read_yaml(path), str(path))


def test_common_indices_are_those_of_the_project() -> None:
    raster = np.arange(10, dtype=np.uint8)[None]
    converted = table_of('common').converter('indices', 'ignore')(raster)
    assert converted.tolist() == [[int(label) for label in Label]]


def test_values_of_no_class_are_named_and_counted() -> None:
    raster = np.array([[0, 1, 42], [42, 42, 17]], np.uint8)
    with pytest.raises(SampleError, match=r'label value 42 \(3 px\), 17 \(1 px\).*4 of 6 px'):
        table_of('common').converter('indices', 'ignore')(raster)


def test_colours_are_told_apart_by_all_three_channels() -> None:
    convert = table_of('uavid').converter('colours', 'ignore')
    row = np.array([[(128, 64, 128), (0, 128, 0), (128, 128, 0), (0, 0, 0)]], np.uint8)
    assert convert(row).tolist() == [[Label.PAVED, Label.TREE, Label.GRASS, Label.UNLABELED]]
    row[0, 0] = (128, 64, 129)
    with pytest.raises(SampleError, match=r'RGB \(128, 64, 129\)'):
        convert(row)


@pytest.mark.parametrize(
    ('mixed', 'label'), [('ignore', Label.UNLABELED), ('safe', Label.GRASS), ('unsafe', Label.TREE)]
)
def test_a_mixed_class_counts_as_the_user_says(mixed: str, label: Label) -> None:
    convert = table_of('udd6').converter('indices', mixed)
    assert convert(np.array([[3]], np.uint8)) == label
    assert table_of('udd6').has_safe(mixed) == (mixed == 'safe')


@pytest.mark.parametrize('name', dataset_names())
def test_shipped_tables_are_whole(name: str) -> None:
    table = table_of(name)
    layouts = read_yaml(find_table(name))['layouts']
    assert layouts
    for layout in layouts:
        assert table.converter(layout['masks'], 'ignore')
    assert any(entry.side == 'unsafe' for entry in table.entries)


@pytest.mark.parametrize(
    ('classes', 'complaint'),
    [
        ({'safe': [{'name': 'a', 'index': 1, 'label': 'water'}]}, "label 'water' on this side"),
        ({'unsafe': [{'name': 'a', 'index': 1, 'label': 'grass'}]}, "label 'grass' on this side"),
        ({'nice': []}, 'give lists under safe, unsafe, mixed, ignore'),
        ({'safe': [{'name': 'a', 'label': 'grass'}]}, 'neither index nor colour'),
        ({'safe': [{'name': 'a', 'index': 256, 'label': 'grass'}]}, 'index 256'),
        ({'safe': [{'name': 'a', 'colour': [1, 2], 'label': 'grass'}]}, r'colour \[1, 2\]'),
        ({'safe': [{'name': 'a', 'index': 1, 'lable': 'grass'}]}, 'lable: unknown'),
    ],
)
def test_wrong_tables_are_refused(classes: Any, complaint: str) -> None:
    with pytest.raises(DatasetError, match=complaint):
        parse_classes({'classes': classes}, 'mine.yaml')


def test_two_classes_of_one_index_are_refused() -> None:
    rows = [{'name': name, 'index': 1, 'label': 'grass'} for name in 'ab']
    with pytest.raises(DatasetError, match='class b: its value is used twice'):
        parse_classes({'classes': {'safe': rows}}, 'mine.yaml').converter('indices', 'ignore')


def test_unknown_tables_are_refused_with_the_known_ones() -> None:
    with pytest.raises(DatasetError, match=r"'nowhere' does not exist.*common.*uavid"):
        find_table('nowhere')

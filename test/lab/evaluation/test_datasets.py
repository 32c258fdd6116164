# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Datasets are found in the folders that users get, and what is missing is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Label
from peace_ros.lab.evaluation.segmentation.classes import dataset_names, find_table, read_yaml
from peace_ros.lab.evaluation.segmentation.datasets import dataset_source
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.samples import SampleSource

AS_DOWNLOADED = {
    'uavid': ('uavid_val/seq16/Images/000000.png', 'uavid_val/seq16/Labels/000000.png', 'val'),
    'semantic_drone': (
        'semantic_drone_dataset/training_set/images/001.jpg',
        'semantic_drone_dataset/training_set/gt/semantic/label_images/001.png',
        '',
    ),
    'vdd': ('VDD/val/src/DJI_1.JPG', 'VDD/val/gt/DJI_1.png', 'val'),
    'udd5': ('UDD5/train/src/DJI_0285.JPG', 'UDD5/train/gt/DJI_0285.png', 'train'),
    'udd6': ('UDD6/val/src/000001.JPG', 'UDD6/val/gt/000001.png', 'val'),
    'aeroscapes': (
        'aeroscapes/JPEGImages/000001_001.jpg',
        'aeroscapes/SegmentationClass/000001_001.png',
        'val',
    ),
    'floodnet': (
        'FloodNet-Supervised_v1.0/test/test-org-img/6336.jpg',
        'FloodNet-Supervised_v1.0/test/test-label-img/6336_lab.png',
        'test',
    ),
    'dronedeploy': (
        'dataset-medium/images/15efe_INSPIRE-ortho.tif',
        'dataset-medium/labels/15efe_INSPIRE-label.png',
        '',
    ),
    'dubai': ('Tile 5/images/image_part_001.jpg', 'Tile 5/masks/image_part_001.png', 'val'),
}


def write(path: Path, array: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), array)


def stripes(name: str, masks: str, side: str) -> tuple[Any, list[str]]:
    """Return a label image with a stripe for each class of a side, and the labels."""
    rows = read_yaml(find_table(name))['classes'].get(side, [])
    labels = [row.get('label', 'unlabeled') for row in rows]
    if masks == 'indices':
        return np.array([[row['index']] * 4 for row in rows], np.uint8), labels
    return np.array([[row['colour'][::-1]] * 4 for row in rows], np.uint8), labels


def load_all(source: SampleSource) -> list[Any]:
    return [sample.load() for sample in source.samples]


def test_every_shipped_dataset_is_tried_here() -> None:
    assert set(AS_DOWNLOADED) == set(dataset_names())


@pytest.mark.parametrize('name', AS_DOWNLOADED)
def test_a_dataset_is_read_as_it_was_downloaded(name: str, tmp_path: Path) -> None:
    image, label, split = AS_DOWNLOADED[name]
    masks = read_yaml(find_table(name))['layouts'][-1]['masks']
    raster, labels = stripes(name, masks, 'unsafe')
    write(tmp_path / image, np.full((len(raster), 4, 3), 90, np.uint8))
    write(tmp_path / label, raster)
    if name == 'aeroscapes':
        (tmp_path / 'aeroscapes/ImageSets').mkdir()
        (tmp_path / 'aeroscapes/ImageSets/val.txt').write_text('000001_001\n')
    source = dataset_source(name, tmp_path, split, 'ignore')
    (pair,) = load_all(source)
    assert [Label(value).name.lower() for value in pair[1][:, 0]] == labels
    assert pair[0].shape == (*pair[1].shape, 3)


def test_index_masks_go_before_coloured_ones_and_coloured_ones_will_do(tmp_path: Path) -> None:
    kaggle = tmp_path / 'dataset/semantic_drone_dataset'
    for masks, folder in (
        ('colours', tmp_path / 'RGB_color_image_masks/RGB_color_image_masks'),
        ('indices', kaggle / 'label_images_semantic'),
    ):
        raster, labels = stripes('semantic_drone', masks, 'unsafe')
        write(kaggle / 'original_images/000.jpg', np.full((len(raster), 4, 3), 90, np.uint8))
        write(folder / '000.png', raster)
        source = dataset_source('semantic_drone', tmp_path, '', 'ignore')
        assert getattr(source.samples[0], 'label').resolve() == (folder / '000.png').resolve()  # noqa: B009
        ((_, found),) = load_all(source)
        assert [Label(value).name.lower() for value in found[:, 0]] == labels


def test_images_without_labels_are_listed(tmp_path: Path) -> None:
    raster, _ = stripes('vdd', 'indices', 'unsafe')
    for stem in ('a', 'b'):
        write(tmp_path / f'test/src/{stem}.JPG', np.zeros((len(raster), 4, 3), np.uint8))
    write(tmp_path / 'test/gt/a.png', raster)
    source = dataset_source('vdd', tmp_path, 'test', 'ignore')
    assert len(source.samples) == 1
    assert source.skipped[0].name == 'test/src/b.JPG'
    assert 'no label' in source.skipped[0].reason


def test_a_dataset_without_safe_ground_says_so(tmp_path: Path) -> None:
    raster, _ = stripes('vdd', 'indices', 'unsafe')
    write(tmp_path / 'val/src/a.JPG', np.zeros((len(raster), 4, 3), np.uint8))
    write(tmp_path / 'val/gt/a.png', raster)
    ignoring = ' '.join(dataset_source('vdd', tmp_path, '', 'ignore').remarks)
    assert 'vegetation holds safe and unsafe ground alike and is not counted' in ignoring
    assert 'no safe ground' in ignoring
    assert 'no safe ground' not in ' '.join(dataset_source('vdd', tmp_path, '', 'safe').remarks)


@pytest.mark.parametrize(
    ('options', 'complaint'),
    [
        ({}, 'images from no source: give exactly one'),
        ({'drawn': 2, 'dataset': 'vdd'}, 'images from --dataset and --drawn'),
        ({'dataset': 'vdd'}, 'without --root'),
        ({'images': Path('/')}, 'without --labels'),
        ({'drawn': 2, 'mixed': 'both'}, '--mixed both'),
        ({'manifest': Path('/nowhere.csv')}, 'cannot be read as CSV'),
    ],
)
def test_options_that_name_no_images_are_refused(options: Any, complaint: str) -> None:
    with pytest.raises(DatasetError, match=complaint):
        open_source(EvaluationInputs(**options))


def test_unknown_datasets_splits_and_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match='holds no image in a layout of vdd'):
        dataset_source('vdd', tmp_path, '', 'ignore')
    with pytest.raises(DatasetError, match="'nothing' does not exist"):
        dataset_source('nothing', tmp_path, '', 'ignore')
    with pytest.raises(DatasetError, match='is not a folder'):
        dataset_source('vdd', tmp_path / 'x', '', 'ignore')
    write(tmp_path / 'train/src/a.JPG', np.zeros((2, 4, 3), np.uint8))
    with pytest.raises(DatasetError, match="split 'spring' of vdd: choose one of train, val"):
        dataset_source('vdd', tmp_path, 'spring', 'ignore')
    with pytest.raises(DatasetError, match="no image of split 'val'"):
        dataset_source('vdd', tmp_path, 'val', 'ignore')


@pytest.mark.parametrize(
    'text',
    [
        '\ufeffimage,label\na.png,b.png\n',
        'image;label\na.png;b.png\n',
        'image, label\na.png , b.png\n',
    ],
    ids=['byte order mark', 'semicolons', 'blanks'],
)
def test_a_manifest_is_read_as_spreadsheets_write_it(tmp_path: Path, text: str) -> None:
    for name in ('a.png', 'b.png'):
        write(tmp_path / name, np.zeros((4, 4), np.uint8))
    (tmp_path / 'manifest.csv').write_text(text, encoding='utf-8')
    source = open_source(EvaluationInputs(manifest=tmp_path / 'manifest.csv'))
    assert [each.name for each in source.samples] == ['a.png']


def test_a_manifest_without_its_columns_tells_those_that_it_has(tmp_path: Path) -> None:
    (tmp_path / 'manifest.csv').write_text('picture,label\na.png,b.png\n')
    with pytest.raises(DatasetError, match='has the columns label, picture: give'):
        open_source(EvaluationInputs(manifest=tmp_path / 'manifest.csv'))


def test_a_manifest_gives_the_rows_of_a_split(tmp_path: Path) -> None:
    for stem in ('a', 'b'):
        write(tmp_path / f'{stem}.png', np.zeros((2, 2, 3), np.uint8))
        write(tmp_path / f'{stem}_l.png', np.ones((2, 2), np.uint8))
    manifest = tmp_path / 'manifest.csv'
    manifest.write_text('image,label,split\na.png,a_l.png,train\nb.png,b_l.png,val\n')
    source = open_source(EvaluationInputs(manifest=manifest, split='val'))
    assert [sample.name for sample in source.samples] == ['b.png']
    with pytest.raises(DatasetError, match="split 'x': choose one of train, val"):
        open_source(EvaluationInputs(manifest=manifest, split='x'))


def test_drawn_scenes_are_the_same_each_time_and_vary_in_height() -> None:
    first, again = (open_source(EvaluationInputs(drawn=5)) for _ in range(2))
    names = [sample.name for sample in first.samples]
    assert names == [sample.name for sample in again.samples]
    assert len({name.split(', ')[1] for name in names}) > 1
    image, labels = first.samples[0].load()
    assert np.array_equal(image, again.samples[0].load()[0])
    assert labels.any()
    assert len(open_source(EvaluationInputs(drawn=9, limit=3)).samples) == 3


def test_wide_frames_are_the_middle_of_the_square():
    square, wide = (
        open_source(EvaluationInputs(drawn=1, drawn_px=320, drawn_shape=shape)).samples[0].load()
        for shape in ('1:1', '16:9')
    )
    assert wide[0].shape == (180, 320, 3)
    np.testing.assert_array_equal(wide[0], square[0][70:250])
    np.testing.assert_array_equal(wide[1], square[1][70:250])


@pytest.mark.parametrize('shape', ['16', '9:16', '16:0', 'a:b', '5:1', 'nan:1'])
def test_a_shape_is_width_to_height(shape):
    with pytest.raises(DatasetError, match='--drawn-shape'):
        open_source(EvaluationInputs(drawn=1, drawn_shape=shape))

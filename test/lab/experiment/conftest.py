# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A small labelled orthophoto, over which a flight takes a second or two."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Label
from peace_ros.recording import save_picture

GSD_M = 0.5
COLOURS = {Label.GRASS: (70, 130, 50), Label.PAVED: (120, 120, 120), Label.BUILDING: (150, 60, 50)}


def meadow_in_town(size_m: float = 300.0, meadow_m: float = 20.0) -> np.ndarray:
    """Return labels: paved ground and blocks, and a round meadow near the middle."""
    size = round(size_m / GSD_M)
    labels = np.full((size, size), Label.PAVED, np.uint8)
    labels[::40, :] = labels[:, ::40] = Label.BUILDING
    if meadow_m:
        middle = (size // 2 + 20, size // 2 - 10)
        cv2.circle(labels, middle, round(meadow_m / GSD_M), int(Label.GRASS), -1)
    return labels


def save_world(folder: Path, labels: np.ndarray, name: str = 'town') -> Path:
    image = np.zeros((*labels.shape, 3), np.uint8)
    for label, colour in COLOURS.items():
        image[labels == label] = colour
    save_picture(image, folder / f'{name}.png')
    save_picture(labels, folder / f'{name}_label.png')
    return folder / f'{name}.png'


@pytest.fixture
def town(tmp_path: Path) -> Path:
    return save_world(tmp_path, meadow_in_town())


@pytest.fixture
def stones(tmp_path: Path) -> Path:
    return save_world(tmp_path, meadow_in_town(meadow_m=0.0), 'stones')


@pytest.fixture(scope='session')
def shared_town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same for fixtures that many tests share."""
    return save_world(tmp_path_factory.mktemp('world'), meadow_in_town())

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Vocabularies are read strictly; every refusal names the file and the word."""

from __future__ import annotations

from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.prompting import Vocabularies, load_vocabularies

GOOD = 'resolution: [3D]\nframe: [image, view]\nenvironment: [winter, heat-map]\n'


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / 'words.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def test_words_keep_the_order_of_the_file(tmp_path: Path) -> None:
    got = load_vocabularies(write(tmp_path, GOOD))
    assert got == Vocabularies(('3D',), ('image', 'view'), ('winter', 'heat-map'))
    assert got.words('frame') == ('image', 'view')


def test_the_shipped_words_are_those_of_the_authors() -> None:
    got = load_vocabularies()
    assert got.resolution == ('3D', '3D rendered', 'rendered', 'blurred')
    assert (len(got.frame), len(got.environment)) == (18, 21)
    assert {'screenshot', 'artwork'} <= set(got.frame)
    assert {'heat-map', 'damp', 'sunny'} <= set(got.environment)


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        (GOOD.replace('view', 'image'), "frame: 'image' is there twice"),
        (GOOD.replace('view', 'Image'), "frame: 'Image' is there twice"),
        (GOOD.replace('[3D]', '[]'), 'resolution: empty; give at least one word'),
        (GOOD.replace('view', 'no'), 'frame: False is not a text; put it in quotes'),
        (GOOD.replace('view', "' '"), "frame: ' '; give a word"),
        (GOOD.replace('view', "'{term}'"), 'without braces'),
        (GOOD.replace('frame', 'frames'), 'resolution, frames, environment; give the lists'),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=rf'words\.yaml: .*{says}'):
        load_vocabularies(write(tmp_path, text))

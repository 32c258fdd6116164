# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Terms are read strictly: what is safe must never be ambiguous."""

from __future__ import annotations

from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.segmentation import Terms, load_terms


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / 'terms.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def test_case_and_spaces_are_tidied(tmp_path: Path) -> None:
    terms = load_terms(
        write(tmp_path, 'positive: [" Dead   Grass ,Lawn"]\nnegative: [CAR, Bare tree]\n')
    )
    assert terms == Terms(('dead grass, lawn',), ('car', 'bare tree'))
    assert terms.all == ('dead grass, lawn', 'car', 'bare tree')
    assert len(terms) == 3


def test_the_shipped_terms_are_thirteen_and_water_is_negative() -> None:
    terms = load_terms()
    assert len(terms) == 13
    assert {'grass', 'bare ground'} <= set(terms.positive)
    assert {'building', 'road', 'car', 'person', 'tree', 'water'} <= set(terms.negative)


def test_the_papers_terms_hold_water_for_safe() -> None:
    terms = load_terms('terms_paper.yaml')
    assert terms.positive == ('grass', 'garden', 'yard', 'water', 'patio', 'park')
    assert terms.negative == ('building', 'house', 'person', 'car', 'street', 'sidewalk')


def test_doveseis_groups_share_one_prompt_each() -> None:
    terms = load_terms('terms_dovesei.yaml')
    assert (len(terms.positive), len(terms.negative)) == (3, 10)
    assert 'water, lake, river, swimming pool' in terms.negative
    assert 'parking lot, sidewalk, gravel, dirt, sand, concrete floor, asphalt' in terms.positive


def test_negative_terms_may_be_absent(tmp_path: Path) -> None:
    assert load_terms(write(tmp_path, 'positive: [grass]\nnegative: []\n')).negative == ()


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('positive: []\nnegative: [car]\n', 'positive terms are empty'),
        ('positive: [grass, water]\nnegative: [Water]\n', "'water' is positive and negative"),
        ('positive: [grass, sand]\nnegative: ["road,  Sand"]\n', "'sand' is positive and neg"),
        ('positive: [grass, GRASS]\nnegative: [car]\n', "'grass' is there twice"),
        ('positive: [grass]\nnegative: ["car, car"]\n', "'car' is there twice"),
        ('positive: [no]\nnegative: []\n', 'False is not a text'),
        ('positive: ["grass, "]\nnegative: []\n', 'empty places'),
        ('positive: [""]\nnegative: []\n', 'empty places'),
        ('positive: ["{term}"]\nnegative: []\n', 'without braces'),
        ('positive: [grass]\n', 'give the lists'),
        ('positive: [grass]\nnegative: [car]\nneutral: [sky]\n', 'neutral; give the lists'),
        (f'positive: {[f"w{i}" for i in range(200)]}\nnegative: []\n', '200 terms: at most 128'),
    ],
)
def test_bad_files_are_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=rf'terms\.yaml: .*{says}'):
        load_terms(write(tmp_path, text))

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A file of words means exactly what it says, or it is refused with its name and the remedy."""

from __future__ import annotations

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.word_lists import find_word_lists, read_word_lists

NAMES = ('good', 'bad')


def test_words_come_as_they_are_written(tmp_path):
    path = tmp_path / 'words.yaml'
    path.write_text('bad: []\ngood: [" Dead  grass", lawn]\n', encoding='utf-8')
    assert read_word_lists(path, NAMES) == {'good': (' Dead  grass', 'lawn'), 'bad': ()}


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('good: grass\nbad: []\n', "good: 'grass'; give a list"),
        ('good: [grass, 3]\nbad: []\n', 'good: 3 is not a text; put it in quotes'),
        ('good: [no]\nbad: []\n', 'good: False is not a text'),
        ('good: [grass]\n', 'has good; give the lists good and bad, each once'),
        ('good: [grass]\nbad: []\nugly: []\n', 'has good, bad, ugly'),
        ('good: [grass]\nbad: []\nbad: [car]\n', r'bad is there twice \(line 3\).* each once'),
        ('[grass]\n', 'no lists'),
        ('', 'no lists'),
        ('good: [grass', 'not usable YAML'),
    ],
)
def test_anything_else_is_refused(tmp_path, text, says):
    path = tmp_path / 'words.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ConfigurationError, match=rf'words\.yaml: .*{says}'):
        read_word_lists(path, NAMES)


def test_a_missing_or_binary_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r'none\.yaml: No such file'):
        read_word_lists(tmp_path / 'none.yaml', NAMES)
    binary = tmp_path / 'binary.yaml'
    binary.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ConfigurationError, match=r'binary\.yaml: not usable YAML'):
        read_word_lists(binary, NAMES)


def test_a_file_of_the_user_goes_before_the_shipped_one_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_word_lists('terms.yaml').parent.name == 'config'
    (tmp_path / 'terms.yaml').write_text('', encoding='utf-8')
    assert find_word_lists('terms.yaml').resolve() == tmp_path / 'terms.yaml'
    assert find_word_lists('./none.yaml').name == 'none.yaml'

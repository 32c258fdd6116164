# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""YAML is read as ROS reads it, so that a replay and a node take one file for the same values."""

from __future__ import annotations

import os
from math import inf, isnan
from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.yaml_files import read_sections, read_yaml, value_of

DATA = Path(__file__).resolve().parents[1] / 'data'
AS_ROS = {
    # PyYAML takes these for texts.
    '1e5': 1e5,
    '-1E-3': -1e-3,
    '1.e2': 100.0,
    '08': 8.0,
    'y': True,
    'N': False,
    'inf': inf,
    '-Inf': -inf,
    'infinity': inf,
    # PyYAML takes these for numbers, dates, nothing, or truths of its own.
    '1_000': '1_000',
    '0b11': '0b11',
    '1:30': '1:30',
    '2026-11-30': '2026-11-30',
    '~': '~',
    'null': 'null',
    '=': '=',
    '9223372036854775808': 2.0**63,
    # Both agree.
    '010': 8,
    '-010': -8,
    '0x1F': 31,
    '+5': 5,
    '9223372036854775807': 2**63 - 1,
    '.5': 0.5,
    '5.': 5.0,
    '.inf': inf,
    'yes': True,
    'off': False,
    'tRue': 'tRue',
    '0o17': '0o17',
    '1e400': '1e400',
    '1.0f': '1.0f',
    '"5"': '5',
    "'yes'": 'yes',
    '[1, 2]': [1, 2],
    '[y, no]': [True, False],
    '[a, "1"]': ['a', '1'],
}
"""What stands in test/data/plain_words.yaml -> what ROS takes it for."""


def test_words_without_quotes_mean_what_they_mean_to_ros():
    values = list(read_sections(DATA / 'plain_words.yaml')['/**'].values())
    read = dict(zip(AS_ROS, values, strict=True))
    assert read == AS_ROS
    assert {text: type(value) for text, value in read.items()} == {
        text: type(value) for text, value in AS_ROS.items()
    }


@pytest.mark.parametrize('text', ['nan', 'NaN', '-nan', '.nan', '.NaN'])
def test_what_is_not_a_number_to_ros_is_none_here(tmp_path, text):
    path = tmp_path / 'a.yaml'
    path.write_text(f'a: {text}\n')
    assert isnan(read_yaml(path, '')['a'])


def test_names_are_texts_whatever_they_look_like(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('y: 1\n010: 2\n')
    assert read_yaml(path, '') == {'y': 1, '010': 2}


def test_a_name_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('a: 1\nb: 2\na: 3\n')
    with pytest.raises(ConfigurationError, match=r'a is there twice \(line 3\).*; give it once'):
        read_yaml(path, 'give it once')


def test_a_number_of_any_length_is_read(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text(f'a: {"9" * 5000}\nb: 0x{"f" * 5000}\n')
    assert read_yaml(path, '') == {'a': '9' * 5000, 'b': '0x' + 'f' * 5000}


@pytest.mark.parametrize(
    'text',
    [
        'a: !!int x\n',
        'a: !!int ""\n',
        'a: !!float x\n',
        'a: !!bool x\n',
        'a: !!timestamp x\n',
        f'a: {"[" * 2000}{"]" * 2000}\n',
    ],
)
def test_a_value_that_does_not_fit_its_tag_is_refused(tmp_path, text):
    path = tmp_path / 'a.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match='not usable YAML'):
        read_yaml(path, 'give it once')


@pytest.mark.parametrize('text', ['a: &a {b: *a}\n', 'a:\n  ros__parameters: &a\n    b: *a\n'])
def test_a_section_that_holds_itself_is_refused(tmp_path, text):
    path = tmp_path / 'a.yaml'
    path.write_text(text)
    with pytest.raises(ConfigurationError, match='not usable YAML'):
        read_sections(path)


def test_aliases_that_stand_for_a_billion_values_are_refused(tmp_path) -> None:
    lines = ['l0: &l0 [x, x, x, x, x, x, x, x, x, x]']
    lines += [f'l{k}: &l{k} [{", ".join([f"*l{k - 1}"] * 10)}]' for k in range(1, 10)]
    path = tmp_path / 'bomb.yaml'
    path.write_text('\n'.join(lines))
    with pytest.raises(ConfigurationError, match='values, at most 200000 are read') as told:
        read_yaml(path, 'give another')
    assert '\n' not in str(told.value)


def test_deep_nesting_is_one_sentence(tmp_path) -> None:
    path = tmp_path / 'deep.yaml'
    path.write_text('a: ' + '[' * 20_000)
    with pytest.raises(ConfigurationError, match='not usable YAML') as told:
        read_yaml(path, 'give another')
    assert '\n' not in str(told.value)


def test_devices_and_pipes_are_not_read(tmp_path) -> None:
    os.mkfifo(tmp_path / 'pipe.yaml')
    for path in (tmp_path / 'pipe.yaml', Path('/dev/zero')):
        with pytest.raises(ConfigurationError, match='not a regular file'):
            read_yaml(path, 'give another')


def test_a_single_value_is_read_as_on_the_command_line():
    assert value_of('0.7') == 0.7
    assert value_of('y') is True
    assert value_of('[a, 1:30]') == ['a', '1:30']
    assert value_of("'0.7'") == '0.7'
    with pytest.raises(ConfigurationError, match='no YAML'):
        value_of('[a')

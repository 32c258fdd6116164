# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files: read by name or path, and refused where a node would refuse them."""

from __future__ import annotations

from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.landing import LandingParameters
from peace_ros.core.presets import load_preset, preset_names
from peace_ros.core.prompting import PromptingParameters
from peace_ros.core.resources import config_dir
from peace_ros.core.segmentation import SegmentationParameters
from peace_ros.core.vehicle import VehicleParameters


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / 'mine.yaml'
        path.write_text(text)
        return path

    return write


def section(name: str, *lines: str) -> str:
    return f'{name}:\n  ros__parameters:\n' + ''.join(f'    {line}\n' for line in lines)


def test_every_shipped_file_can_be_used():
    assert len(preset_names()) == 6
    for name in preset_names():
        load_preset(name)
    for name in ('defaults.yaml', 'dovesei_simulator.yaml'):
        load_preset(config_dir() / name)


def test_a_preset_fills_parameters_and_what_is_given_goes_before():
    preset = load_preset('DD-CS')
    assert preset.fill('prompt_generator', PromptingParameters).template == 'DD'
    given = preset.fill('prompt_generator', PromptingParameters, threads=1, bundle='')
    assert (given.threads, given.bundle) == (1, PromptingParameters().bundle)
    assert preset.fill('landing', LandingParameters) == LandingParameters()


def test_the_last_value_in_the_file_counts_as_in_ros(write):
    own = section('segmentation', 'threads: 3')
    all_nodes = section('/**', 'threads: 4', 'use_sim_time: true')
    for text, threads in ((all_nodes + own, 3), (own + all_nodes, 4)):
        preset = load_preset(write(text))
        assert preset.fill('segmentation', SegmentationParameters).threads == threads
        assert preset.fill('prompt_generator', PromptingParameters).threads == 4


@pytest.mark.parametrize('name', ['landing', '/landing', '/**/landing', '/*', '/**'])
def test_sections_that_ros_gives_to_a_node(write, name):
    preset = load_preset(write(section(name, 'safety_radius_m: 3')))
    assert preset.fill('landing', LandingParameters).safety_radius_m == 3.0


def test_groups_may_be_nested_or_dotted(write):
    for lines in (['vehicle: {signing_key_file: a}'], ['vehicle.signing_key_file: a']):
        preset = load_preset(write(section('landing', *lines)))
        assert preset.fill('landing', VehicleParameters).signing_key_file == 'a'


def test_numbers_are_read_as_ros_reads_them(write):
    preset = load_preset(write(section('landing', 'safety_radius_m: 5e0')))
    assert preset.fill('landing', LandingParameters).safety_radius_m == 5.0


def test_a_section_for_all_nodes_may_hold_what_only_others_know(write):
    load_preset(write(section('/**', 'robot_description: x', 'map_server.port: 3')))


def test_sections_of_the_simulators_are_left_to_them(write):
    load_preset(write(section('satellite_view', 'world_seed: 3')))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (
            section('landing', 'safety_treshold: 0.98'),
            'parameter safety_treshold of landing is unknown: did you mean safety_threshold',
        ),
        (section('segmentation', 'fusoin: soft'), 'did you mean fusion?'),
        (section('segmentation', 'safety_threshold: 0.9'), 'safety_threshold of segmentation'),
        (section('landing', 'vehicle: {signing_key_fiel: x}'), 'vehicle.signing_key_file?'),
        (section('/**', 'safty_threshold: 0.9'), 'did you mean safety_threshold?'),
        (section('lnding', 'rate: 30.0'), 'node lnding is unknown: did you mean landing?'),
        (section('/drone/landing', 'rate: 30.0'), 'node /drone/landing is unknown'),
        ('drone:\n  landing:\n    ros__parameters: {rate: 30.0}\n', 'node drone/landing'),
        (section('camera_driver', 'rate: 30.0'), 'node camera_driver is unknown: choose among'),
        (section('landing', 'rate: fast'), "landing: parameter rate = 'fast': give a number"),
        (section('landing', 'rate: 1.0'), 'rate = 1.0 Hz'),
        (section('landing', 'vehicle: {signing_key_file: 3}'), 'vehicle.signing_key_file = 3'),
        (section('segmentation', 'threads: 2.5'), 'threads = 2.5: give an integer'),
        (section('segmentation', 'threads: true'), 'threads = True'),
        (section('segmentation', 'providers: CPU'), "providers = 'CPU': give a list"),
        (section('/**', 'rate: 1.0'), 'landing: parameter rate = 1.0'),
        (section('landing', 'rate: 30.0', 'rate: 40.0'), 'rate is there twice'),
        ('landing: 3\n', 'landing has no ros__parameters'),
        ('landing: {ros__parameters: 3}\n', 'landing has no ros__parameters'),
        ('- a\n', 'holds no node'),
        ('a: [\n', 'not usable YAML'),
    ],
)
def test_what_a_node_would_refuse_is_refused_in_one_sentence(write, text, words):
    path = write(text)
    with pytest.raises(ConfigurationError) as caught:
        load_preset(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_preset_that_does_not_exist_names_those_that_do():
    with pytest.raises(ConfigurationError, match='peace_cs'):
        load_preset('no_such')


def test_other_values_go_before_those_of_every_section(write):
    path = write(
        section('/**', 'use_sim_time: true')
        + section('landing', 'safety_threshold: 0.75')
        + section('/**/segmentation', 'template: DD')
    )
    preset = load_preset(path)
    changed = preset.with_values('landing', {'safety_threshold': 0.9})
    changed.check()
    assert changed.fill('landing', LandingParameters).safety_threshold == 0.9
    assert preset.fill('landing', LandingParameters).safety_threshold == 0.75
    assert changed.sections['/**/segmentation'] == {'template': 'DD'}
    with pytest.raises(ConfigurationError, match='did you mean safety_threshold'):
        preset.with_values('landing', {'safety_treshold': 0.7}).check()

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters: declared once, refused in one sentence, equal in code, YAML and documentation."""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import ParameterSet, describe, parameter
from peace_ros.core.node_parameters import named
from peace_ros.core.yaml_files import read_sections
from peace_ros.lab.parameter_docs import (
    NODE_PARAMETERS,
    allowed,
    defaults_yaml,
    markdown,
)
from peace_ros.nodes.node import PeaceNode

ROOT = Path(__file__).resolve().parents[2]
PRESETS = ROOT / 'config' / 'presets'


@dataclass(frozen=True)
class Sample(ParameterSet):
    speed: float = parameter(1.5, 'Speed over ground', unit='m/s', low=0.0, high=5.0)
    count: int = parameter(3, 'How many', low=1)
    name: str = parameter('a', 'Which one', choices=('a', 'b'))
    active: bool = parameter(default=False, description='Whether')
    providers: tuple[str, ...] = parameter(('x', 'y'), 'In order')


@dataclass(frozen=True)
class Live(ParameterSet):
    low: float = parameter(0.5, 'Lower end', low=0.0, high=5.0, live=True)
    high: float = parameter(1.0, 'Upper end', low=0.0, high=5.0, live=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low > self.high:
            raise ConfigurationError(f'low {self.low} above high {self.high}')


def node_with(**values: object) -> PeaceNode:
    given = [Parameter(name.replace('__', '.'), value=value) for name, value in values.items()]
    return PeaceNode('sample', ('', Sample), ('group', Sample), parameter_overrides=given)


def test_defaults_bounds_and_meaning_reach_ros():
    node = node_with()
    descriptor = node.describe_parameter('group.speed')
    assert node.filled(Sample) == Sample()
    assert node.get_parameter('providers').value == ['x', 'y']
    assert descriptor.description == 'Speed over ground [m/s]'
    assert descriptor.read_only
    assert descriptor.floating_point_range[0].to_value == 5.0
    assert node.describe_parameter('count').integer_range[0].from_value == 1
    assert 'a, b' in node.describe_parameter('name').additional_constraints
    node.destroy_node()


def test_a_given_value_arrives_and_a_whole_number_serves_as_a_float():
    node = node_with(group__speed=2, group__providers=['z'], group__active=True)
    assert node.filled(Sample) == Sample(speed=2.0, providers=('z',), active=True)
    assert node.get_parameter('group.speed').value == 2.0
    node.destroy_node()


def test_a_parameter_that_is_not_live_is_read_only():
    node = node_with()
    (result,) = node.set_parameters([Parameter('speed', value=2.0)])
    assert not result.successful
    assert 'read-only' in result.reason
    node.destroy_node()


def change(node: PeaceNode, **values: object):
    given = [Parameter(name, value=value) for name, value in values.items()]
    return node.set_parameters_atomically(given)


def test_live_parameters_change_together_or_not_at_all():
    node = PeaceNode('sample', ('', Live))
    assert change(node, low=2.0, high=3.0).successful
    assert node.filled(Live) == Live(low=2.0, high=3.0)
    refused = change(node, low=4.0, high=3.5)
    assert (refused.successful, refused.reason) == (False, 'low 4.0 above high 3.5')
    assert not change(node, low=2.5, high=99.0).successful
    assert node.filled(Live) == Live(low=2.0, high=3.0)
    assert node.get_parameter('low').value == 2.0
    node.destroy_node()


def test_what_the_node_itself_refuses_does_not_change():
    class Busy(PeaceNode):
        def change(self, filled):
            raise ConfigurationError('busy')

    node = Busy('sample', ('', Live))
    refused = change(node, low=0.7)
    assert (refused.successful, refused.reason) == (False, 'busy')
    assert node.filled(Live) == Live()
    node.destroy_node()


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'speed': 7.0}, ['speed = 7.0 m/s', '5']),
        ({'speed': float('nan')}, ['speed = nan']),
        ({'speed': 'fast'}, ["speed = 'fast'", 'a number', '1.5']),
        ({'count': 0}, ['count = 0', '1']),
        ({'count': 2.5}, ['count = 2.5', 'an integer']),
        ({'count': True}, ['count = True']),
        ({'name': 'c'}, ["name = 'c'", 'a, b']),
        ({'active': 1}, ['active = 1', 'true or false']),
        ({'providers': 'x'}, ["providers = 'x'", 'a list']),
        ({'providers': [1, 2]}, ['providers', 'a list']),
        ({'sped': 1.0}, ['sped of sample is unknown', 'speed']),
        ({'use_sim_time': 1}, ['use_sim_time = 1', 'true or false']),
        ({'group__cuont': 1}, ['group.cuont', 'did you mean group.count?']),
    ],
)
def test_a_bad_value_is_refused_in_one_sentence(values, words):
    with pytest.raises(ConfigurationError) as caught:
        node_with(**values)
    assert all(word in str(caught.value) for word in words)
    assert '\n' not in str(caught.value)


@pytest.fixture
def node_from(tmp_path, monkeypatch):
    """Start a node with a parameter file."""

    def start(text: str, *remaps: str) -> PeaceNode:
        path = tmp_path / 'given.yaml'
        path.write_text(text)
        arguments = ['--ros-args', '--params-file', str(path)]
        arguments += [each for remap in remaps for each in ('-r', remap)]
        monkeypatch.setattr('sys.argv', ['sample', *arguments])
        return PeaceNode('sample', ('', Sample), cli_args=arguments)

    return start


IN_DRONE, RENAMED = '__ns:=/drone', '__node:=other'


@pytest.mark.parametrize(
    ('section', 'remaps'),
    [
        ('sample', []),
        ('/sample', []),
        ('/**/sample', []),
        ('/**/sample', [IN_DRONE]),
        ('/*/sample', [IN_DRONE]),
        ('/**/sample', ['__ns:=/fleet/drone']),
        ('/drone/sample', [IN_DRONE]),
        ('/**/other', [RENAMED]),
        ('/**', [IN_DRONE, RENAMED]),
    ],
)
def test_a_section_reaches_the_node_that_ros_says_it_is_for(node_from, section, remaps):
    node = node_from(f'{section}:\n  ros__parameters: {{count: 7}}\n', *remaps)
    assert node.filled(Sample).count == 7
    node.destroy_node()


@pytest.mark.parametrize(
    ('section', 'remaps', 'remedy'),
    [
        ('sample', [IN_DRONE], '/**/sample'),
        ('/sample', [IN_DRONE], '/**/sample'),
        ('/*/sample', [], '/**/sample'),
        ('/swarm/sample', [IN_DRONE], '/**/sample'),
        ('/**/sample', [RENAMED], '/**/other'),
    ],
)
def test_a_file_that_ros_would_ignore_is_refused(node_from, section, remaps, remedy):
    with pytest.raises(ConfigurationError, match='would be ignored') as caught:
        node_from(f'{section}:\n  ros__parameters: {{count: 7}}\n', *remaps)
    assert str(caught.value).endswith(f'name the section {remedy}')


WILDCARD = '/**:\n  ros__parameters:\n    count: 7\n'
OTHERS = 'camera:\n  ros__parameters:\n    sped: 1.0\n'


def test_a_section_for_all_nodes_may_hold_what_this_one_does_not_have(node_from):
    node = node_from(f'{WILDCARD}    robot_description: x\n{OTHERS}')
    assert node.filled(Sample).count == 7
    node.destroy_node()


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (f'{WILDCARD}    sped: 1.0\n', 'sped of section /** is unknown: did you mean speed?'),
        (f'{WILDCARD}    count: -1\n', 'count is there twice'),
        (f'{WILDCARD}    x: 1\nsample:\n  ros__parameters: {{x: 2}}\n', 'x of sample is unknown'),
        ('sample:\n  ros__parameters: {robot_description: x}\n', 'robot_description of sample'),
    ],
)
def test_a_file_with_a_misspelt_parameter_is_refused(node_from, text, words):
    with pytest.raises(ConfigurationError) as caught:
        node_from(text)
    assert words in str(caught.value)


def test_an_empty_list_of_a_file_is_an_empty_list(node_from):
    node = node_from('sample:\n  ros__parameters: {providers: []}\n')
    assert node.filled(Sample).providers == ()
    node.destroy_node()
    with pytest.raises(ConfigurationError, match=r'speed = \[\]: give a number'):
        node_from('sample:\n  ros__parameters: {speed: []}\n')


def test_parameters_of_ros_itself_are_known():
    node = node_with(use_sim_time=False, **{'qos_overrides./image.subscription.depth': 1})
    node.destroy_node()


def flat(section: dict, prefix: str = '') -> dict:
    found = {}
    for name, value in section.items():
        if isinstance(value, dict):
            found.update(flat(value, f'{prefix}{name}.'))
        else:
            found[prefix + name] = value
    return found


@pytest.mark.parametrize('node', sorted(NODE_PARAMETERS))
def test_code_yaml_and_documentation_agree(node):
    defaults = {name: info.default for name, info in named(NODE_PARAMETERS[node]).items()}
    plain = {
        name: list(value) if isinstance(value, tuple) else value for name, value in defaults.items()
    }
    shipped = yaml.safe_load((ROOT / 'config' / 'defaults.yaml').read_text())
    written = flat(shipped[f'/**/{node}']['ros__parameters'])
    assert written == plain
    assert {name: type(value) for name, value in written.items()} == {
        name: type(value) for name, value in plain.items()
    }
    text = (ROOT / 'docs' / 'parameters.md').read_text()
    table = re.split(r'^## ', text, flags=re.MULTILINE)
    (section,) = [part for part in table if part.startswith(f'{node}\n')]
    rows = [line.split(' | ') for line in section.splitlines() if line.startswith('| `')]
    documented = {row[0].strip('|` '): yaml.safe_load(row[1].strip('`')) for row in rows}
    assert documented == plain


def test_generated_files_are_fresh():
    assert (ROOT / 'docs' / 'parameters.md').read_text() == markdown()
    assert (ROOT / 'config' / 'defaults.yaml').read_text() == defaults_yaml()


def test_no_name_is_declared_twice_on_a_node():
    for groups in NODE_PARAMETERS.values():
        count = sum(len(describe(each)) for _, each in groups)
        assert len(named(groups)) == count


def test_every_number_has_bounds():
    for node, groups in NODE_PARAMETERS.items():
        for name, info in named(groups).items():
            if isinstance(info.default, int | float) and not isinstance(info.default, bool):
                assert allowed(info), f'{node}.{name}'


def test_presets_are_the_six_of_the_paper_and_their_values_exist():
    names = {path.stem for path in PRESETS.glob('*.yaml')}
    assert names == {
        f'{prompt}_{model}' for prompt in ('dd', 'd', 'peace') for model in ('cs', 'fs')
    }
    for path in PRESETS.glob('*.yaml'):
        for wildcard, section in yaml.safe_load(path.read_text()).items():
            node = wildcard.removeprefix('/**/')
            known = named(NODE_PARAMETERS[node])
            for name, value in section['ros__parameters'].items():
                assert type(value) is type(known[name].default), f'{path.name}: {node}.{name}'
            prompt, model = path.stem.split('_')
            assert section['ros__parameters']['template'] == prompt.upper()
        family = yaml.safe_load(path.read_text())['/**/segmentation']['ros__parameters']['family']
        assert family == {'cs': 'clipseg', 'fs': 'fastsam'}[model]


def test_rcl_takes_a_file_for_the_same_values_as_the_reader_of_replay():
    path = ROOT / 'test' / 'data' / 'plain_words.yaml'
    read = read_sections(path)['/**']
    context = Context()
    context.init(['--ros-args', '--params-file', str(path)])
    node = Node(
        'sample',
        context=context,
        automatically_declare_parameters_from_overrides=True,
        start_parameter_services=False,
    )
    try:
        taken = {name: node.get_parameter(name).value for name in read}
    finally:
        node.destroy_node()
        context.shutdown()
    taken = {name: list(each) if isinstance(each, array) else each for name, each in taken.items()}
    assert taken == read
    assert {name: type(each) for name, each in taken.items()} == {
        name: type(each) for name, each in read.items()
    }

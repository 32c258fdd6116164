# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file: against ROS's launch where it is installed, else against a stand-in.

There are no wheels of launch and launch_ros. (``launch`` on PyPI is another project.)
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from peace_ros.core.node_parameters import named
from peace_ros.core.presets import preset_names
from peace_ros.core.resources import config_dir
from peace_ros.lab.parameter_docs import NODE_PARAMETERS

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILE = ROOT / 'launch_scripts' / 'landing.launch.py'
HAS_LAUNCH = importlib.util.find_spec('launch_ros') is not None


@dataclass
class Made:
    kind: str
    given: tuple[Any, ...]
    options: dict[str, Any]


class StandIn:
    """Records what the launch file makes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        names = {
            'launch': ['LaunchContext', 'LaunchDescription'],
            'launch.actions': ['DeclareLaunchArgument', 'OpaqueFunction'],
            'launch.substitutions': ['EnvironmentVariable'],
            'launch_ros': [],
            'launch_ros.actions': ['Node'],
        }
        for name, kinds in names.items():
            module = ModuleType(name)
            for kind in kinds:
                setattr(module, kind, self._maker(kind))
            monkeypatch.setitem(sys.modules, name, module)

    @staticmethod
    def _maker(kind: str) -> Callable[..., Made]:
        return lambda *given, **options: Made(kind, given, options)

    def launch(self, *arguments: str) -> dict[str, dict[str, Any]]:
        """Return executable -> options of the nodes that the arguments start."""
        entities = load().generate_launch_description().given[0]
        declared = {
            each.given[0]: each.options for each in entities if each.kind == 'DeclareLaunchArgument'
        }
        values = {
            name: 'LOCALHOST' if isinstance(each['default_value'], Made) else each['default_value']
            for name, each in declared.items()
        }
        values.update(argument.split(':=') for argument in arguments)
        for name, each in declared.items():
            assert each['choices'] is None or values[name] in each['choices']
        context = SimpleNamespace(argv=list(arguments), launch_configurations=values)
        (function,) = [each for each in entities if each.kind == 'OpaqueFunction']
        nodes = [each.options for each in function.options['function'](context)]
        return {each['executable']: each for each in nodes}


def load() -> Any:
    spec = importlib.util.spec_from_file_location('landing_launch', LAUNCH_FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def launch(monkeypatch) -> Callable[..., dict[str, dict[str, Any]]]:
    monkeypatch.setattr('sys.argv', ['ros2', 'launch', 'peace_ros', LAUNCH_FILE.name])
    return StandIn(monkeypatch).launch


def test_starts_the_nodes_on_board(launch):
    nodes = launch()
    assert list(nodes) == ['prompt_generator', 'segmentation', 'landing', 'recorder']
    assert all(each['package'] == 'peace_ros' for each in nodes.values())
    assert all(each['name'] == executable for executable, each in nodes.items())


def test_by_default_the_preset_decides_and_nothing_goes_before_it(launch):
    for name, node in launch().items():
        path, given = node['parameters']
        assert path == str(config_dir() / 'presets' / 'peace_cs.yaml')
        managed = {} if name == 'recorder' else {'autostart': True}
        assert given == {'use_sim_time': False, **managed}


def test_the_recorder_is_told_where_to_write_and_may_be_left_out(launch):
    nodes = launch('recordings:=/data', 'image_transport:=compressed')
    assert nodes['recorder']['parameters'][-1] == {
        'use_sim_time': False,
        'recordings': '/data',
        'image_transport': 'compressed',
    }
    assert 'recordings' not in nodes['landing']['parameters'][-1]
    assert list(launch('record:=false')) == ['prompt_generator', 'segmentation', 'landing']


def test_a_parameter_file_goes_before_the_preset_and_an_argument_before_both(launch, tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('/**/landing:\n  ros__parameters: {mavlink: tcp:127.0.0.1:5760}\n')
    nodes = launch('preset:=d_fs', f'params_file:={path}', 'mavlink:=udpin:0.0.0.0:14550')
    preset, mine, given = nodes['landing']['parameters']
    assert (Path(preset).name, mine) == ('d_fs.yaml', str(path))
    assert given['mavlink'] == 'udpin:0.0.0.0:14550'
    assert 'mavlink' not in nodes['segmentation']['parameters'][-1]


def test_arguments_that_are_parameters_exist_on_their_nodes(launch):
    names = load().OF_LANDING
    for executable, node in launch(*(f'{name}:=x' for name in names)).items():
        given = node['parameters'][-1]
        assert set(given) - {'use_sim_time'} <= set(named(NODE_PARAMETERS[executable]))
        assert given['image_transport'] == 'x'


@pytest.mark.parametrize(
    ('image', 'beside'),
    [
        ('image', 'camera_info'),
        ('/camera/image_raw', '/camera/camera_info'),
        ('front/image', 'front/camera_info'),
    ],
)
def test_a_calibration_elsewhere_takes_the_place_of_that_beside_the_image(launch, image, beside):
    for node in launch(f'image:={image}', 'camera_info:=/calibrated').values():
        assert (beside, '/calibrated') in node['remappings']
    for node in launch(f'image:={image}').values():
        assert all('camera_info' not in topic for topic, _ in node['remappings'])


def test_every_argument_changes_what_is_started(launch, tmp_path):
    path = tmp_path / 'mine.yaml'
    path.touch()
    others = {
        'preset': 'dd_cs',
        'params_file': str(path),
        'use_sim_time': 'true',
        'log_level': 'debug',
        'autostart': 'false',
        'use_composition': 'true',
        'use_respawn': 'true',
        'discovery_range': 'SUBNET',
        'record': 'false',
    }
    usual = launch()
    for name, *_ in load().ARGUMENTS:
        assert launch(f'{name}:={others.get(name, "other")}') != usual, name


def test_composed_perception_is_one_process_whose_nodes_keep_their_names(launch):
    nodes = launch('use_composition:=true')
    assert list(nodes) == ['perception', 'landing', 'recorder']
    assert nodes['perception']['name'] is None
    assert nodes['perception']['parameters'] == launch()['segmentation']['parameters']


@pytest.mark.parametrize('name', ['use_sim_time', 'autostart', 'use_composition', 'use_respawn'])
def test_booleans_are_taken_in_both_spellings(launch, name):
    assert launch(f'{name}:=True') == launch(f'{name}:=true')
    assert launch(f'{name}:=False') == launch(f'{name}:=false')
    assert launch(f'{name}:=True') != launch(f'{name}:=False')


def test_a_landing_that_ended_is_not_started_again(launch):
    respawns = {name: each['respawn'] for name, each in launch('use_respawn:=true').items()}
    assert respawns.pop('landing') is False
    assert respawns == {'prompt_generator': True, 'segmentation': True, 'recorder': True}


def test_discovery_stays_on_the_machine(launch):
    for node in launch().values():
        assert node['additional_env']['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'


def test_a_profile_of_fast_dds_that_is_set_is_kept(launch, monkeypatch):
    name = 'FASTRTPS_DEFAULT_PROFILES_FILE'
    monkeypatch.delenv(name, raising=False)
    assert launch()['landing']['additional_env'][name] == str(config_dir() / 'fastdds.xml')
    monkeypatch.setenv(name, '/mine.xml')
    assert launch()['landing']['additional_env'][name] == '/mine.xml'


@pytest.mark.parametrize(
    ('argument', 'words'),
    [
        ('prest:=d_cs', 'prest is unknown: did you mean preset?'),
        ('colour:=red', 'colour is unknown: --show-args'),
        ('params_file:=/nowhere.yaml', '/nowhere.yaml does not exist'),
    ],
)
def test_what_cannot_be_meant_stops_the_launch(launch, argument, words):
    with pytest.raises(RuntimeError, match=words):
        launch(argument)


def test_arguments_of_a_launch_file_that_includes_this_one_are_left_to_it(launch, monkeypatch):
    monkeypatch.setattr('sys.argv', ['ros2', 'launch', 'bringup.launch.py'])
    assert launch('colour:=red')
    with pytest.raises(RuntimeError, match='did you mean preset'):
        launch('prest:=d_cs')


@pytest.mark.skipif(not HAS_LAUNCH, reason='launch_ros comes with ROS, not as a wheel')
class TestWithLaunch:
    """What a stand-in cannot show: that ROS's launch takes all of it."""

    @pytest.fixture
    def launch(self, monkeypatch, capfd):
        """Launch ``echo`` in place of each node; return the exit status and what was printed."""
        from launch import LaunchService
        from launch_ros.substitutions import ExecutableInPackage

        monkeypatch.setattr('sys.argv', ['ros2', 'launch', 'peace_ros', LAUNCH_FILE.name])
        monkeypatch.setattr(ExecutableInPackage, 'perform', lambda self, context: '/bin/echo')

        def run(*arguments: str) -> tuple[int, str]:
            service = LaunchService(argv=list(arguments))
            service.context.launch_configurations.update(each.split(':=') for each in arguments)
            service.include_launch_description(load().generate_launch_description())
            status = service.run(shutdown_when_idle=True)
            return status, ''.join(capfd.readouterr())

        return run

    def test_each_node_gets_namespace_preset_and_remaps(self, launch):
        status, printed = launch(
            'namespace:=drone_1', 'preset:=d_cs', 'image:=/camera/image_raw', 'log_level:=warn'
        )
        lines = [line for line in printed.splitlines() if '--ros-args' in line]
        assert (status, len(lines)) == (0, 3)
        for line in lines:
            assert '__ns:=/drone_1' in line
            assert f'--params-file {config_dir() / "presets" / "d_cs.yaml"}' in line
            assert '-r image:=/camera/image_raw' in line
            assert '-r image/compressed:=/camera/image_raw/compressed' in line
            assert '--log-level warn' in line

    def test_a_composed_process_gets_no_name(self, launch):
        _, printed = launch('use_composition:=true', 'namespace:=drone_1')
        (line, _) = [line for line in printed.splitlines() if '--ros-args' in line]
        assert '__ns:=/drone_1' in line
        assert '__node' not in line

    def test_a_preset_that_is_none_is_refused_with_those_that_are(self, launch):
        status, printed = launch('preset:=peace')
        assert status == 1
        assert '"preset" provided value "peace"' in printed
        assert all(name in printed for name in preset_names())

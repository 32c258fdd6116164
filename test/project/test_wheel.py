# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wheel carries what flies, and little else; the source archive carries all."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIMIT_BYTES = 1_000_000
OF_A_CHECKOUT = ('peace_ros/lab/training/', 'peace_ros/lab/damage/')
BUILD = """
import sys
from setuptools import build_meta

out = sys.argv[1]  # setuptools puts its own words into sys.argv
build_meta.build_wheel(out)
build_meta.build_sdist(out)
"""


def _tracked() -> list[str]:
    command = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split('\0') if name and (ROOT / name).is_file()]


@pytest.fixture(scope='module')
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[zipfile.ZipFile, set[str]]:
    """The wheel, and the names in the source archive, from what git knows of this checkout."""
    if not find_spec('setuptools.command.bdist_wheel'):
        pytest.skip('setuptools makes wheels by itself from version 70.1')
    checkout, out = tmp_path_factory.mktemp('checkout'), tmp_path_factory.mktemp('out')
    for name in _tracked():
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, checkout / name)
    command = [sys.executable, '-c', BUILD, str(out)]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with tarfile.open(next(out.glob('*.tar.gz'))) as archive:
        names = {each.name.partition('/')[2] for each in archive.getmembers()}
    return zipfile.ZipFile(next(out.glob('*.whl'))), names


def test_without_models_the_wheel_is_small(built) -> None:
    wheel, _ = built
    models = sum(
        each.compress_size
        for each in wheel.infolist()
        if each.filename.startswith('peace_ros/models/')
    )
    assert models > LIMIT_BYTES
    assert Path(wheel.filename).stat().st_size - models < LIMIT_BYTES


def test_the_wheel_carries_every_module_but_those_of_a_checkout(built) -> None:
    wheel, _ = built
    expected = {
        name
        for name in _tracked()
        if name.startswith('peace_ros/') and not name.startswith(OF_A_CHECKOUT)
    }
    assert {name for name in expected if name.startswith(('peace_ros/core/', 'peace_ros/nodes/'))}
    assert {name for name in wheel.namelist() if name.endswith('.py')} == {
        name for name in expected if name.endswith('.py')
    } | {name for name in wheel.namelist() if name.endswith('landing.launch.py')}


def test_the_wheel_carries_configuration_and_models_but_no_annotations(built) -> None:
    wheel, _ = built
    shipped = {
        name
        for name in _tracked()
        if name.startswith(('config/', 'models/'))
        and not name.startswith(('config/ament/', 'config/annotations/'))
    }
    inside = {
        name.partition('/')[2]
        for name in wheel.namelist()
        if name.startswith(('peace_ros/config/', 'peace_ros/models/'))
    }
    assert inside == shipped
    assert {
        'config/defaults.yaml',
        'config/terms.yaml',
        'config/vocabularies.yaml',
        'config/presets/peace_cs.yaml',
        'models/clipseg-small/manifest.json',
    } <= inside


def test_what_ros_looks_for_is_under_share(built) -> None:
    wheel, _ = built
    shared = {
        name.partition('/share/')[2] for name in wheel.namelist() if '.data/data/share/' in name
    }
    presets = {f'peace_ros/config/presets/{each.name}' for each in ROOT.glob('config/presets/*')}
    assert presets
    assert shared >= presets | {
        'ament_index/resource_index/packages/peace_ros',
        'peace_ros/package.xml',
        'peace_ros/launch/landing.launch.py',
        'peace_ros/config/defaults.yaml',
    }
    assert not any('annotations' in name or 'datasets' in name for name in shared)


def test_the_source_archive_carries_what_a_checkout_trains_with(built) -> None:
    _, archive = built
    expected = {
        name
        for name in _tracked()
        if name.startswith(('config/', 'models/', 'peace_ros/', 'launch_scripts/'))
    }
    assert any(name.startswith('config/annotations/') for name in expected)
    assert any(name.startswith('peace_ros/lab/training/') for name in expected)
    assert expected <= archive

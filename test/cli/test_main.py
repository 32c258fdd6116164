# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: quick help, verbs that work, refusals in one sentence."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from peace_ros import __version__
from peace_ros.core.resources import models_dir

SMALL_BUNDLES = ('clip-small', 'clipseg-small')


def test_version_and_help(peace) -> None:
    assert peace('--version').output.strip() == f'peace_ros {__version__}'
    told = peace('--help').output
    assert all(verb in told for verb in ('demo', 'replay', 'models'))


@pytest.mark.parametrize(
    ('verb', 'options'),
    [
        ('demo', '--world --gsd --labels --start --config --speed --seed --run-dir --timeout'),
        ('demo', '--mavlink --pose-mavlink'),
        ('replay', '--image-topic --pose-topic --config --out --fov --altitude --every --hz'),
        (
            'replay',
            '--limit --set --golden --remake-golden --junit --compare --segment --engage-at',
        ),
        ('benchmark', '--reference --quick --json --provider --threads'),
        ('models export', '--name --out --precision --images --licence --clip --side'),
        ('models fetch', '--index --out'),
    ],
)
def test_the_verbs_have_their_options(peace, verb, options) -> None:
    told = peace(*verb.split(), '--help', env={'COLUMNS': '200'}).output
    for option in options.split():
        assert option in told


def test_help_imports_nothing_heavy() -> None:
    code = (
        'import sys\n'
        'from peace_ros.cli.main import app\n'
        'heavy = {"cv2", "rclpy", "onnxruntime", "pymavlink", "rosbags"} & set(sys.modules)\n'
        'print(*sorted(heavy))\n'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        (('demo', '--world', '/nowhere.jpg', '--gsd', '0.1'), '/nowhere.jpg'),
        (('demo', '--start', 'there'), '--start'),
        (('demo', '--config', 'no_such'), 'peace_cs'),
        (('demo', '--seed', '-1'), '--seed'),
        (('replay', '/nowhere.mcap'), '/nowhere.mcap'),
        (('replay', '/nowhere.mcap', '--every', '0'), '--every'),
        (('replay', '/nowhere.mcap', '--junit', 'a.xml'), '--golden'),
        (('replay', '/nowhere.mcap', '--compare', 'd_cs', 'dd_cs', '--golden', 'a'), '--compare'),
        (('replay', '/nowhere.mcap', '--segment', '9:3'), '--segment 9:3'),
        (('replay', '/nowhere.mcap', '--segment', 'begin'), '--segment'),
        (('replay', '/nowhere.mcap', '--engage-at', '-3'), '--engage-at'),
        (('replay', '/nowhere.mcap', '--set', 'landing.safety_treshold=1'), 'safety_threshold'),
        (('replay', '/nowhere.mcap', '--set', 'lander.rate=1'), 'segmentation'),
        (('replay', '/nowhere.mcap', '--set', 'landing.rate'), 'NODE.PARAMETER=VALUE'),
        (('models', 'verify', 'no-such'), 'no-such'),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_sentence(peace, words, told) -> None:
    result = peace(*words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert 'Traceback' not in result.output


def test_the_bundled_models_are_listed_shown_and_whole(peace) -> None:
    listed = peace('models', 'list').output
    for name in SMALL_BUNDLES:
        assert name in listed
        assert 'files are whole' in peace('models', 'verify', name).output
        assert '"provenance"' in peace('models', 'info', name).output


def test_own_bundles_are_listed_too_and_a_broken_one_is_said(peace, tmp_path, monkeypatch) -> None:
    own = shutil.copytree(models_dir() / SMALL_BUNDLES[0], tmp_path / 'my-own')
    (tmp_path / 'broken').mkdir()
    (tmp_path / 'broken' / 'manifest.json').write_text('{')
    (tmp_path / '.cut.part').mkdir()
    shutil.copy(own / 'manifest.json', tmp_path / '.cut.part')
    monkeypatch.setenv('PEACE_MODELS_DIR', str(tmp_path))
    listed = peace('models', 'list').output
    assert 'my-own' in listed
    assert 'broken  cannot be used' in listed
    assert '.cut' not in listed
    assert 'files are whole' in peace('models', 'verify', 'my-own').output


def test_a_verb_that_is_handed_on_refuses_in_one_sentence(peace, monkeypatch) -> None:
    monkeypatch.delenv('PEACE_MODELS_INDEX', raising=False)
    result = peace('models', 'fetch', 'clipseg')
    assert result.exit_code == 2
    assert 'give --index' in result.stderr
    assert peace('benchmark', '--no-such-option').exit_code == 2

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording as a regression test: its golden file, and the recipe of the docs."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import pytest
import yaml

from peace_ros.core.domain import RecordingError
from peace_ros.lab.replay import ReplayOptions, SourceOptions
from peace_ros.lab.replay.regression import GoldenOptions, replay_regression
from peace_ros.recording import BagReader, BagWriter

ROOT = Path(__file__).resolve().parents[3]
SMALL = ROOT / 'test' / 'data' / 'small.mcap'
GOLDEN = ROOT / 'test' / 'data' / 'small.golden'
RECIPE = ROOT / 'docs' / 'replay.md'


def recipe_commands() -> list[list[str]]:
    """Return the commands of each continuous integration of the page."""
    found = []
    for block in re.findall(r'```yaml\n(.*?)```', RECIPE.read_text(), re.DOTALL):
        page = yaml.safe_load(block)
        job = page.get('jobs', page)['replay']
        steps = [each.get('run') for each in job.get('steps', ())] or job['script']
        found.append([each for each in steps if each])
    return found


def test_both_recipes_run_the_same_commands() -> None:
    hosted, gitlab = recipe_commands()
    assert hosted == gitlab
    assert [each.split()[0] for each in hosted] == ['pip', 'peace']


def test_the_recipe_passes_on_the_small_bag_and_fails_with_other_parameters(tmp_path) -> None:
    (tmp_path / 'flights').mkdir()
    shutil.copy(SMALL, tmp_path / 'flights' / 'field.mcap')
    shutil.copy(GOLDEN, tmp_path / 'flights' / 'field.golden')
    command = tmp_path / 'bin' / 'peace'
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m peace_ros.cli.main "$@"\n')
    command.chmod(0o755)
    path = f'{command.parent}:{os.environ["PATH"]}'
    environment = {**os.environ, 'PATH': path, 'PYTHONPATH': str(ROOT), 'OMP_NUM_THREADS': '1'}

    def run(line: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ['bash', '-c', line],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )

    _, line = recipe_commands()[0]
    done = run(line)
    assert done.returncode == 0, done.stdout + done.stderr
    suites = ET.fromstring((tmp_path / 'replay.xml').read_text())  # noqa: S314 (our own)
    assert (suites.get('tests'), suites.get('failures')) == ('8', '0')

    done = run(f'{line} --set landing.safety_threshold=0.97 --out changed')
    assert done.returncode == 1, done.stdout + done.stderr
    suites = ET.fromstring((tmp_path / 'replay.xml').read_text())  # noqa: S314 (our own)
    failed = {
        case.get('name') for case in suites.iter('testcase') if case.find('failure') is not None
    }
    assert 'states' in failed
    assert not failed & {'frames', 'prompts', 'heatmaps'}
    told = json.loads((tmp_path / 'changed' / 'golden.json').read_text())
    assert told['passed'] is False
    assert told['first_difference_ns'] > 1_000_000_000
    picture = cv2.imread(str(tmp_path / 'changed' / 'difference.png'))
    assert picture.shape[1] > 3 * 300
    assert picture.std() > 10.0
    assert 'first difference at' in done.stdout


def test_a_golden_file_is_made_and_made_again_only_on_request(tmp_path) -> None:
    def run(name: str, **options) -> object:
        replayed = ReplayOptions(
            SMALL, 'dd_cs', tmp_path / name, SourceOptions(limit=options.pop('limit'))
        )
        return replay_regression(replayed, GoldenOptions(tmp_path / 'a.golden', **options))

    assert run('made', limit=3).golden is None
    content = (tmp_path / 'a.golden').read_bytes()
    again = run('again', limit=3)
    assert again.passed
    assert len(again.checks) == 8
    fewer = run('fewer', limit=2)
    assert [each.name for each in fewer.checks if not each.passed][:2] == ['frames', 'frames used']
    assert (tmp_path / 'fewer' / 'difference.png').is_file()
    assert (tmp_path / 'a.golden').read_bytes() == content
    assert run('remade', limit=2, remake=True).golden is None
    assert len(run('remade_again', limit=2).found.masks) == 2


def test_what_engaged_nothing_does_not_become_golden(tmp_path) -> None:
    path = tmp_path / 'no_pose.mcap'
    with BagReader(SMALL) as bag, BagWriter(path) as writer:
        for topic, stamp_ns, message in bag.messages([*bag.topics]):
            if topic.startswith('/ground_truth'):
                # Poses that end before the first frame.
                message.header.stamp.sec = max(0, message.header.stamp.sec - 60)
            writer.write(topic, stamp_ns, message)
    options = ReplayOptions(path, 'dd_cs', tmp_path / 'out', SourceOptions(limit=3))
    with pytest.raises(RecordingError, match=r'proves nothing and .*a\.golden was not written'):
        replay_regression(options, GoldenOptions(tmp_path / 'a.golden'))
    assert not (tmp_path / 'a.golden').exists()


def test_continuous_integration_does_not_make_what_it_compares_with(tmp_path) -> None:
    golden = GoldenOptions(tmp_path / 'none.golden', junit=tmp_path / 'replay.xml')
    with pytest.raises(RecordingError, match='make it without --junit'):
        golden.expected()

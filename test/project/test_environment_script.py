# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scripts find an interpreter that fits, and say what is missing where there is none."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIND = f'source {ROOT}/launch_scripts/environment.sh && find_python'


def _find(**variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ['bash', '-c', FIND],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def _interpreter(
    path: Path, version: tuple[int, int], name: str = 'CPython', more: str = ''
) -> str:
    """Write a program that answers as a Python of another version would."""
    path.write_text(
        f'#!{sys.executable}\n'
        'import platform, sys\n'
        f'sys.version_info = {(*version, 0)}\n'
        f'platform.python_implementation = lambda: {name!r}\n'
        f'{more}\n'
        'exec(sys.argv[2])\n'
    )
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize('minor', range(10, 15))
def test_cpython_3_10_to_3_14_is_taken(tmp_path: Path, minor: int) -> None:
    python = _interpreter(tmp_path / 'python', (3, minor))
    found = _find(PYTHON=python)
    assert (found.returncode, found.stdout.strip()) == (0, python)


@pytest.mark.parametrize(
    ('version', 'name', 'more', 'words'),
    [
        ((3, 9), 'CPython', '', 'is CPython 3.9, need CPython 3.10 to 3.14'),
        ((3, 15), 'CPython', '', 'is CPython 3.15, need CPython 3.10 to 3.14'),
        ((3, 12), 'PyPy', '', 'is PyPy 3.12, need CPython'),
        ((3, 12), 'CPython', 'sys.modules["ensurepip"] = None', 'without ensurepip (Debian'),
    ],
)
def test_refusal_names_what_is_missing(
    tmp_path: Path, version: tuple[int, int], name: str, more: str, words: str
) -> None:
    python = _interpreter(tmp_path / 'python', version, name, more)
    refused = _find(PYTHON=python)
    assert refused.returncode == 2
    assert words in refused.stderr
    assert python in refused.stderr


def test_one_that_fits_is_found_behind_one_that_does_not(tmp_path: Path) -> None:
    _interpreter(tmp_path / 'python3.12', (3, 12), 'CPython', 'sys.modules["ensurepip"] = None')
    fits = _interpreter(tmp_path / 'python3.13', (3, 13))
    found = _find(PATH=f'{tmp_path}:{os.environ["PATH"]}')
    assert (found.returncode, found.stdout.strip()) == (0, fits)


def test_a_name_that_leads_nowhere_is_refused() -> None:
    refused = _find(PYTHON='/no/such/python3')
    assert refused.returncode == 2
    assert '/no/such/python3: not found' in refused.stderr

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every example is short, listed, and runs from an empty folder; so does that of the README."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'docs/examples'
EXAMPLES = sorted(path.name for path in FOLDER.glob('*.py'))
SHOWN = {
    'segment_image.py': '% of the image is called safe',
    'rank_words.py': 'of grass',
    'land_on_heatmaps.py': 'HANDOVER: ',
    'custom_segmenter.py': '% of the image is called safe',
    'judge_bag.py': 'state at the end: ',
    'custom_dialect.py': 'poshold',
}
"""What an example must have printed."""


def _run(path: Path, folder: Path, *arguments: str) -> str:
    result = subprocess.run(
        [sys.executable, path, *arguments],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize('name', EXAMPLES)
def test_example_runs_from_an_empty_folder(name: str, tmp_path: Path) -> None:
    printed = _run(FOLDER / name, tmp_path)
    assert SHOWN.get(name, '\n') in printed


@pytest.mark.parametrize('name', EXAMPLES)
def test_example_is_short_and_listed(name: str) -> None:
    most = 40 if name == 'custom_segmenter.py' else 30
    assert len((FOLDER / name).read_text().splitlines()) <= most
    assert f']({name})' in (FOLDER / 'README.md').read_text()


def test_examples_show_what_they_are_meant_to() -> None:
    assert set(SHOWN) <= set(EXAMPLES)


def test_image_example_takes_a_file(tmp_path: Path) -> None:
    image = ROOT / 'docs/images/closer_looks.jpg'
    printed = _run(FOLDER / 'segment_image.py', tmp_path, str(image))
    assert 'of the image is called safe' in printed
    assert (tmp_path / 'overlay.png').stat().st_size > 10_000


def test_lines_of_the_readme_give_a_heatmap(tmp_path: Path) -> None:
    (lines,) = re.findall(r'```python\n(.*?)```', (ROOT / 'README.md').read_text(), re.DOTALL)
    assert len([line for line in lines.splitlines() if line]) <= 5
    program = tmp_path / 'program.py'
    program.write_text(lines + 'assert heatmap.safety.min() < 0.5 < heatmap.safety.max()\n')
    shutil.copy(ROOT / 'docs/images/closer_looks.jpg', tmp_path / 'photo.jpg')
    assert '[' in _run(program, tmp_path)

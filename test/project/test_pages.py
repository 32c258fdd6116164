# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pages hold no broken link, on GitHub and as a site."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r'\]\((?![a-z]+:|#)([^)\s#]+)')
LOADED = re.compile(r'<(?:script|img|link|iframe)\b[^>]*?\b(?:src|href)="?(?:https?:)?//')
"""A tag that makes a browser fetch something from another machine."""


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip('mkdocs', reason='comes with the extra docs')
    folder = tmp_path_factory.mktemp('site')
    built = subprocess.run(
        [sys.executable, '-m', 'mkdocs', 'build', '--strict', '--site-dir', str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'NO_MKDOCS_2_WARNING': '1'},
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_links_between_files_lead_somewhere() -> None:
    listed = subprocess.run(
        ['git', 'ls-files', '--cached', '--others', '--exclude-standard', '*.md'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    pages = [ROOT / name for name in listed]
    assert len(pages) > 10
    broken = [
        f'{page.relative_to(ROOT)}: {target}'
        for page in pages
        for target in LINK.findall(page.read_text())
        if not (page.parent / target).exists()
    ]
    assert not broken


def test_the_site_has_every_page_and_the_api(site: Path) -> None:
    for page in (
        'index',
        'bundled_models',
        'contributing',
        *(p.stem for p in (ROOT / 'docs').glob('*.md')),
    ):
        assert (site / f'{page}.html').is_file(), page
    assert 'add_heatmap' in (site / 'api/core.landing.html').read_text()


def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob('*.html'))
    assert len(pages) > 20
    assert LOADED.search('<link href="https://fonts.example/css">')
    assert not [str(page) for page in pages if LOADED.search(page.read_text())]

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No file uses a phrase that the word list of CONTRIBUTING.md bans."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORD_LIST = ROOT / '.github/CONTRIBUTING.md'


def _files(*patterns: str) -> list[Path]:
    listed = subprocess.run(
        ['git', 'ls-files', '--cached', '--others', '--exclude-standard', *patterns],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return [ROOT / name for name in listed if (ROOT / name).is_file()]


def _unwanted_phrases() -> list[str]:
    table = WORD_LIST.read_text().split('<!-- words: begin -->')[1].split('<!-- words: end -->')[0]
    rows = [line.split('|') for line in table.splitlines() if line.startswith('|')]
    return [row[2].strip() for row in rows[2:]]


def test_no_file_uses_a_phrase_that_the_word_list_bans() -> None:
    phrases = _unwanted_phrases()
    assert len(phrases) > 5
    unwanted = re.compile('|'.join(re.escape(phrase) for phrase in phrases), re.IGNORECASE)
    assert unwanted.search(f'see {phrases[0].upper()}.')
    found = []
    for path in _files('*.py', '*.md', '*.sh', '*.yml', '*.yaml', '*.cfg', '*.toml'):
        if path != WORD_LIST:
            text = re.sub(r'[\s#*]+', ' ', path.read_text())  # a phrase may break over two lines
            found += [f'{path.relative_to(ROOT)}: {hit}' for hit in unwanted.findall(text)]
    assert not found

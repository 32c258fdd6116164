# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every source file says whose it is and under which licence."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def _sources() -> list[Path]:
    listed = subprocess.run(
        ['git', 'ls-files', '--cached', '--others', '--exclude-standard', '*.py', '*.sh', '.ci/*'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return [ROOT / name for name in listed]


def test_every_source_has_a_licence_header() -> None:
    sources = _sources()
    assert len(sources) > 20
    missing = [
        str(path.relative_to(ROOT))
        for path in sources
        if 'SPDX-License-Identifier: Apache-2.0' not in path.read_text()[:300]
        or 'Copyright 2026 The peace_ros authors' not in path.read_text()[:300]
    ]
    assert not missing


def test_the_licence_itself_is_there() -> None:
    assert 'Apache License' in (ROOT / 'LICENSE').read_text()[:300]

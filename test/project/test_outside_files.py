# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The files that other tools read are what these tools accept."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = {
    '.github/workflows/ci.yml': 'github-workflows',
    '.github/ISSUE_TEMPLATE/config.yml': 'github-issue-config',
    '.github/ISSUE_TEMPLATE/defect.yml': 'github-issue-forms',
    '.github/ISSUE_TEMPLATE/proposal.yml': 'github-issue-forms',
    'CITATION.cff': 'citation-file-format',
}


def _check(schema: str, path: Path) -> subprocess.CompletedProcess[str]:
    pytest.importorskip('check_jsonschema', reason='comes with the extra test')
    return subprocess.run(
        [sys.executable, '-m', 'check_jsonschema', '--builtin-schema', f'vendor.{schema}', path],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize('name', SCHEMAS)
def test_file_fits_its_schema(name: str) -> None:
    result = _check(SCHEMAS[name], ROOT / name)
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_damaged_workflow_is_noticed(tmp_path: Path) -> None:
    damaged = tmp_path / 'ci.yml'
    damaged.write_text((ROOT / '.github/workflows/ci.yml').read_text().replace('runs-on', 'run-on'))
    assert _check('github-workflows', damaged).returncode != 0


def test_every_file_for_github_is_checked() -> None:
    found = {str(path.relative_to(ROOT)) for path in (ROOT / '.github').rglob('*.yml')}
    assert found == {name for name in SCHEMAS if name.startswith('.github')}


def test_the_workflow_runs_what_every_machine_runs() -> None:
    workflow = yaml.safe_load((ROOT / '.github/workflows/ci.yml').read_text())
    steps = workflow['jobs']['checks']['steps']
    assert '.ci/run' in [step.get('run') for step in steps]


def test_commit_hooks_run_tools_of_the_environment() -> None:
    pytest.importorskip('mypy', reason='comes with the extra test')
    hooks = [
        hook
        for repo in yaml.safe_load((ROOT / '.pre-commit-config.yaml').read_text())['repos']
        for hook in repo['hooks']
    ]
    tools = {hook['entry'].split()[0] for hook in hooks}
    assert tools == {'ruff', 'mypy', 'lint-imports', 'shellcheck'}
    for tool in tools:
        command = [str(Path(sys.executable).with_name(tool)), '--help']
        assert subprocess.run(command, capture_output=True, check=False).returncode == 0, tool

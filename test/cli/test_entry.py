# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The console scripts lead to what they are named after, and stop quietly while they import."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from peace_ros.cli import entry

ROOT = Path(__file__).resolve().parents[2]
SLOW = 'import time\nprint("importing", flush=True)\ntime.sleep(60)\n'
CALL = (
    'import signal, sys\n'
    # As in a terminal; a suite that runs in the background hands on interrupts that are ignored.
    'signal.signal(signal.SIGINT, signal.default_int_handler)\n'
    'from peace_ros.cli.entry import start\n'
    'sys.exit(start(sys.argv[1]))\n'
)


def start(folder: Path, source: str) -> subprocess.Popen[str]:
    (folder / 'slow_to_import.py').write_text(source)
    return subprocess.Popen(
        [sys.executable, '-c', CALL, 'slow_to_import'],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join((str(folder), str(ROOT)))},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def test_an_interrupt_during_imports_is_quiet(tmp_path: Path) -> None:
    with start(tmp_path, SLOW) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'importing\n'
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == ''
        assert process.wait(20) == 130


def test_main_gets_the_interrupts_after_the_import_and_gives_the_status(tmp_path: Path) -> None:
    source = (
        'import os, signal\n'
        'def main():\n'
        '    try:\n'
        '        os.kill(os.getpid(), signal.SIGINT)\n'
        '    except KeyboardInterrupt:\n'
        '        return 7\n'
    )
    with start(tmp_path, source) as process:
        assert process.wait(20) == 7


def declared_nodes() -> tuple[str, ...]:
    tree = ast.parse((ROOT / 'setup.py').read_text())
    values = {
        each.targets[0].id: each.value
        for each in tree.body
        if isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name)
    }
    return tuple(ast.literal_eval(values['NODES']))


@pytest.mark.parametrize('name', ['peace', *declared_nodes()])
def test_every_declared_script_runs_a_module_with_a_main(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(entry, 'start', asked.append)
    getattr(entry, name)()
    (module,) = asked
    assert module.rpartition('.')[2] == ('main' if name == 'peace' else name)
    path = ROOT / Path(*module.split('.')).with_suffix('.py')
    assert any(
        isinstance(each, ast.FunctionDef) and each.name == 'main'
        for each in ast.parse(path.read_text()).body
    )

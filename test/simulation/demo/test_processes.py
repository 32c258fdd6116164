# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No process of a demo outlives it, however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from peace_ros.simulation.demo.processes import ProcessError, ProcessGroup

SLEEPER = 'import time\nprint("ready", flush=True)\ntime.sleep(60)\n'
STUBBORN = (
    'import signal, time\n'
    'signal.signal(signal.SIGINT, signal.SIG_IGN)\n'
    'signal.signal(signal.SIGTERM, signal.SIG_IGN)\n' + SLEEPER
)
PARENT_OF_ONE = (
    'import subprocess, sys, time\n'
    'child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])\n'
    'print(child.pid, flush=True)\n'
    'print("ready", flush=True)\n'
    'time.sleep(60)\n'
)
FAILING = 'print("cannot open the model", flush=True)\nraise SystemExit(3)\n'


def alive(pid: int) -> bool:
    try:
        state = Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()[0]
    except OSError:
        return False
    return state != 'Z'


def wait_until(holds: Callable[[], bool], limit_s: float = 10.0) -> bool:
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        if holds():
            return True
        time.sleep(0.02)
    return False


@pytest.fixture
def modules(tmp_path: Path) -> Callable[[str, str], dict[str, str]]:
    """Write a module and return an environment in which it can be imported."""

    def write(name: str, text: str) -> dict[str, str]:
        (tmp_path / f'{name}.py').write_text(text)
        root = Path(__file__).resolve().parents[3]
        return {**os.environ, 'PYTHONPATH': f'{tmp_path}{os.pathsep}{root}'}

    return write


def says_ready(log: Path) -> Callable[[], bool]:
    return lambda: log.is_file() and 'ready' in log.read_text()


def test_leaving_the_group_stops_every_process(tmp_path, modules) -> None:
    environment = modules('fake_sleeper', SLEEPER)
    with ProcessGroup(tmp_path / 'logs', environment) as group:
        group.start('one', 'fake_sleeper')
        group.start('two', 'fake_sleeper')
        pids = group.pids
        assert wait_until(says_ready(tmp_path / 'logs' / 'one.log'))
        assert wait_until(says_ready(tmp_path / 'logs' / 'two.log'))
        group.check()
        assert all(alive(pid) for pid in pids.values())
    assert not any(alive(pid) for pid in pids.values())
    assert 'Traceback' not in (tmp_path / 'logs' / 'one.log').read_text()


def test_a_process_that_ignores_polite_signals_is_killed(tmp_path, modules, monkeypatch) -> None:
    monkeypatch.setattr('peace_ros.simulation.demo.processes._INTERRUPT_S', 0.3)
    with ProcessGroup(tmp_path, modules('fake_stubborn', STUBBORN)) as group:
        group.start('stubborn', 'fake_stubborn')
        assert wait_until(says_ready(tmp_path / 'stubborn.log'))
        pid = group.pids['stubborn']
    assert wait_until(lambda: not alive(pid), 2.0)


def test_children_of_a_process_end_with_it(tmp_path, modules) -> None:
    with ProcessGroup(tmp_path, modules('fake_parent', PARENT_OF_ONE)) as group:
        group.start('parent', 'fake_parent')
        assert wait_until(says_ready(tmp_path / 'parent.log'))
        grandchild = int((tmp_path / 'parent.log').read_text().split()[0])
        assert alive(grandchild)
    assert wait_until(lambda: not alive(grandchild), 2.0)


def test_a_process_that_dies_is_reported_with_its_last_words(tmp_path, modules) -> None:
    with ProcessGroup(tmp_path, modules('fake_failing', FAILING)) as group:
        group.start('segmentation', 'fake_failing')

        def reported() -> bool:
            try:
                group.check()
            except ProcessError as error:
                return 'status 3' in str(error) and 'cannot open the model' in str(error)
            return False

        assert wait_until(reported)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_a_demo_that_is_ended_from_outside(tmp_path, modules, number) -> None:
    environment = modules('fake_sleeper', SLEEPER)
    modules(
        'fake_demo',
        'import sys, time\n'
        'from pathlib import Path\n'
        'from peace_ros.simulation.demo.processes import ProcessGroup\n'
        'from peace_ros.simulation.demo.signals import interruptible\n'
        'with interruptible(), ProcessGroup(Path(sys.argv[1])) as group:\n'
        '    group.start("node", "fake_sleeper")\n'
        '    print(group.pids["node"], flush=True)\n'
        '    time.sleep(60)\n',
    )
    with subprocess.Popen(
        [sys.executable, '-m', 'fake_demo', str(tmp_path / 'logs')],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as demo:
        assert demo.stdout is not None
        pid = int(demo.stdout.readline())
        assert wait_until(says_ready(tmp_path / 'logs' / 'node.log'))
        demo.send_signal(number)
        demo.wait(10)
    assert wait_until(lambda: not alive(pid), 5.0)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVProxy, a process of its own (GPL): commands are typed, and what it prints is read."""

import contextlib
import queue
import re
import shutil
import subprocess
import threading
import time

import pytest

MAVPROXY = shutil.which('mavproxy.py')
LIMIT_S = 30.0

pytestmark = pytest.mark.skipif(
    MAVPROXY is None,
    reason='no mavproxy.py on the PATH: install MAVProxy in an environment of its own',
)


class Shell:
    """MAVProxy's shell: type a command, wait for what it prints."""

    def __init__(self, process):
        self._process = process
        self._lines = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.printed = []

    def _read(self):
        with contextlib.suppress(ValueError):  # closed at the end of the test
            for line in self._process.stdout:
                self._lines.put(line)

    def wait(self, *wanted, again=''):
        """Wait for a line with each of these patterns, in any order.

        Without output for a second a command is typed again.
        """
        end_s, missing = time.monotonic() + LIMIT_S, set(wanted)
        while time.monotonic() < end_s:
            try:
                line = self._lines.get(timeout=1.0)
            except queue.Empty:
                self.say(again)
                continue
            self.printed.append(line)
            missing -= {each for each in missing if re.search(each, line)}
            if not missing:
                return
        pytest.fail(f'MAVProxy did not print {missing}: {"".join(self.printed[-20:])}')

    def say(self, command):
        """Type a command."""
        self._process.stdin.write(f'{command}\n')
        self._process.stdin.flush()

    def type(self, command, *wanted):
        """Type a command and wait for a line with each of these patterns, in any order."""
        self.say(command)
        self.wait(*wanted)


@pytest.fixture
def shell(port, tmp_path):
    command = [MAVPROXY, f'--master=udpout:127.0.0.1:{port}', f'--state-basedir={tmp_path}']
    with subprocess.Popen(
        [*command, '--nowait', '--default-modules=param,mode,arm,wp,cmdlong,misc,rc,signing,fence'],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=tmp_path,
    ) as process:
        yield Shell(process)
        process.kill()


@pytest.mark.parametrize('autopilot', ['ardupilot'], indirect=True)
def test_mavproxy_flies_an_ardupilot(shell, tmp_path):
    shell.wait('Received 17 parameters')
    shell.say('param set RTL_ALT_M 8')
    shell.wait('RTL_ALT_M        8.0', again='param show RTL_ALT_M')
    plan = tmp_path / 'plan.txt'
    rows = [f'{n}\t0\t3\t16\t0\t0\t0\t0\t48.858{n}\t2.342\t10\t1' for n in range(3)]
    plan.write_text('\n'.join(['QGC WPL 110', *rows]) + '\n')
    shell.type(f'wp load {plan}', 'Sent all 3 waypoints')
    shell.type('wp list', '16 3 48.8581')
    shell.type('mode GUIDED', 'Mode GUIDED')
    shell.type('arm throttle', 'ARMED')
    shell.type('takeoff 6', 'NAV_TAKEOFF: ACCEPTED')
    shell.wait(r'relative_alt : (59|60)\d\d,', again='status GLOBAL_POSITION_INT')
    shell.say('position 4 0 -2')
    shell.wait(r'relative_alt : (79|80)\d\d,', again='status GLOBAL_POSITION_INT')
    shell.type('setspeed 3', 'DO_CHANGE_SPEED: ACCEPTED')
    shell.type('mode LOITER', 'Mode LOITER')
    # In fast time the vehicle may have landed before MAVProxy prints the mode.
    shell.type('mode RTL', 'Mode RTL', 'DISARMED')


@pytest.mark.parametrize('autopilot', ['px4'], indirect=True)
def test_mavproxy_reads_and_flies_a_px4(shell):
    shell.wait('Received 16 parameters')
    shell.type('param show RTL_RETURN_ALT', 'RTL_RETURN_ALT   15.0')
    shell.type('arm throttle', 'ARMED')
    shell.type('takeoff 41', 'NAV_TAKEOFF: ACCEPTED', 'Mode TAKEOFF', 'Mode LOITER')
    # MAVProxy's own `mode` sends nothing to a PX4.
    shell.type('long NAV_LAND 0 0 0 0 0 0 0', 'NAV_LAND: ACCEPTED', 'DISARMED')

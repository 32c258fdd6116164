# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real clients, real processes, UDP: what they are told is judged, not how."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SPEED = 10.0
LIMIT_S = 60.0
"""Of one flight, on a busy machine; it takes about 7 s."""


@pytest.fixture(params=['ardupilot', 'px4'])
def autopilot(request):
    """Return the name of the autopilot that is played."""
    return request.param


@pytest.fixture
def port(autopilot):
    """Start a simulated autopilot and return its UDP port."""
    command = [sys.executable, HERE / 'vehicle.py', autopilot, str(SPEED)]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True) as vehicle:
        yield int(vehicle.stdout.readline())
        vehicle.stdin.close()
        assert vehicle.wait(timeout=10.0) == 0, 'the simulation ended without a defect'


@pytest.fixture
def flown(autopilot, port):
    """Let a script of this folder fly the vehicle; return what it was answered."""

    def fly(script, *arguments):
        command = [sys.executable, '-W', 'ignore', HERE / script, *arguments, autopilot]
        done = subprocess.run(
            [each.format(port=port) if isinstance(each, str) else each for each in command],
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return fly

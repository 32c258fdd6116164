# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The documented example of a dialect of one's own flies, and its name is taken from then on."""

import subprocess
import sys
from pathlib import Path

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.core.vehicle import ArduPilot, register_dialect
from peace_ros.core.vehicle.dialects import choose_dialect, dialect_names

EXAMPLE = Path(__file__).resolve().parents[3] / 'docs' / 'examples' / 'custom_dialect.py'


def test_the_example_holds_by_its_own_mode(hovering):
    with hovering(20.0, 1.0) as sim:
        run = subprocess.run(
            [sys.executable, str(EXAMPLE), sim.url],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        assert 'poshold' in run.stdout
        assert run.stdout.split()[-1] == 'POSHOLD'
        assert sim.flight.mode.name == 'POSHOLD'


@pytest.mark.parametrize('name', ['auto', 'ardupilot', 'px4'])
def test_a_taken_name_is_refused(name):
    with pytest.raises(VehicleError, match='exists already'):
        register_dialect(name, ArduPilot)


def test_a_registered_dialect_is_chosen_by_its_name_and_only_for_its_autopilot(monkeypatch):
    monkeypatch.setattr('peace_ros.core.vehicle.dialects._DIALECTS', {'ardupilot': ArduPilot})
    register_dialect('mine', lambda hold_mode: ArduPilot(hold_mode=hold_mode, name='mine'))
    assert dialect_names() == ('auto', 'ardupilot', 'mine')
    assert choose_dialect('mine', 3, 'LOITER').hold_mode == 'LOITER'
    assert choose_dialect('mine', 3).name == 'mine'
    assert choose_dialect('auto', 3).name == 'ardupilot'
    with pytest.raises(VehicleError, match='MAV_AUTOPILOT'):
        choose_dialect('mine', 12)

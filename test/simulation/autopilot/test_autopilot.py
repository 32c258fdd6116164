# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulation as a whole: clock, ground truth, repeatability."""

import threading
import time
from itertools import pairwise

import pytest

from peace_ros.core.domain.errors import ConfigurationError
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim


def test_its_clock_runs_at_its_speed():
    with AutopilotSim(AutopilotParameters(port=0, speed=20.0)) as sim:
        begin_ns, begin = sim.time_ns, time.monotonic()
        time.sleep(0.5)
        rate = (sim.time_ns - begin_ns) / 1e9 / (time.monotonic() - begin)
    assert 10.0 < rate < 21.0, 'near 20, less on a machine that is busy, never more'


def test_a_long_stall_is_not_made_up_for_in_a_burst():
    seen = []

    def stall(sim):
        seen.append(sim.time_ns / 1e9)
        time.sleep(0.3)

    sim = AutopilotSim(AutopilotParameters(port=0))
    try:
        stop = threading.Event()
        threading.Timer(1.0, stop.set).start()
        sim.run(stop, stall)
    finally:
        sim.close()
    steps = [b - a for a, b in pairwise(seen)]
    assert max(steps) <= 0.16


def test_a_short_stall_is_made_up_for_little_by_little():
    stalled = []

    def stall_once(sim):
        if not stalled and sim.time_ns > 2 * 10**8:
            stalled.append(time.monotonic())
            time.sleep(0.4)

    sim = AutopilotSim(AutopilotParameters(port=0))
    stop = threading.Event()
    begin = time.monotonic()
    threading.Timer(1.8, stop.set).start()
    sim.run(stop, stall_once)
    wall_s = time.monotonic() - begin
    sim.close()
    assert stalled
    assert wall_s - 0.25 < sim.time_ns / 1e9 <= wall_s


def test_truth_is_where_it_was_put_relative_to_home():
    sim = AutopilotSim(AutopilotParameters(port=0, start_north_m=30.0, start_east_m=-20.0))
    sim.step(1.0)
    truth = sim.truth()
    sim.close()
    assert (truth.north_m, truth.east_m, truth.down_m) == (30.0, -20.0, 0.0)
    assert truth.altitude_agl_m == 0.0
    assert truth.stamp_ns == sim.time_ns == pytest.approx(1e9, abs=1e7)


def test_two_runs_with_one_seed_are_equal():
    ends = []
    for _ in range(2):
        sim = AutopilotSim(AutopilotParameters(port=0, gust_m_s=2.0, wind_to_north_m_s=4.0, seed=9))
        sim.step(43.0)
        assert sim.pilot_mode('GUIDED')
        sim.flight.arm()
        sim.flight.take_off(10.0)
        for _ in range(20):
            sim.step(1.0)
        ends.append(sim.truth())
        sim.close()
    assert ends[0] == ends[1]
    assert ends[0].altitude_agl_m == pytest.approx(10.0, abs=0.5)
    assert abs(ends[0].north_m) < 2.0, 'holds its place in gusts'


def test_a_reboot_starts_the_boot_clock_again_but_not_the_simulated_one():
    sim = AutopilotSim(AutopilotParameters(port=0))
    sim.step(45.0)
    sim.reboot()
    sim.step(1.0)
    assert sim.flight.time_s == pytest.approx(1.0, abs=0.02)
    assert sim.time_ns == pytest.approx(46e9, abs=1e8)
    assert not sim.flight.has_position
    sim.close()


def test_parameters_out_of_bounds_are_refused():
    with pytest.raises(ConfigurationError, match='speed'):
        AutopilotParameters(speed=1000.0)

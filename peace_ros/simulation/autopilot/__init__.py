# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A small MAVLink autopilot that behaves as ArduCopter 4.7 was measured to behave."""

from peace_ros.simulation.autopilot.autopilot import AutopilotSim
from peace_ros.simulation.autopilot.modes import LandedState, Mode
from peace_ros.simulation.autopilot.parameters import AutopilotParameters

__all__ = ['AutopilotParameters', 'AutopilotSim', 'LandedState', 'Mode']

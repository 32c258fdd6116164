# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All faults, and how a user names some of them."""

from __future__ import annotations

from collections.abc import Iterable

from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.faults import (
    link_faults,
    perception_faults,
    thread_faults,
    vehicle_faults,
    world_faults,
)
from peace_ros.lab.faults.fault import Fault

FAULTS: tuple[Fault, ...] = (
    *perception_faults.FAULTS,
    *world_faults.FAULTS,
    *link_faults.FAULTS,
    *vehicle_faults.FAULTS,
    *thread_faults.FAULTS,
)
"""The matrix, in the order of the documentation."""
REPRESENTATIVE = (
    'camera_stops',
    'pilot_takes_over_landing',
    'altitude_nan',
    'executor_stalls',
    'thread_setpoint_sender',
)
"""What continuous integration runs: one of each kind."""


def groups() -> tuple[str, ...]:
    """Return the names of the groups, in order."""
    return tuple(dict.fromkeys(fault.group for fault in FAULTS))


def choose(names: Iterable[str]) -> tuple[Fault, ...]:
    """Return the faults of these names or groups, all of them when there are none.

    Raises:
        ConfigurationError: nothing has that name.
    """
    wanted = list(names)
    known = {fault.name for fault in FAULTS} | set(groups())
    for name in wanted:
        if name not in known:
            raise ConfigurationError(
                f'fault {name!r} is unknown: --list shows all; groups are {", ".join(groups())}'
            )
    chosen = [f for f in FAULTS if not wanted or f.name in wanted or f.group in wanted]
    # Faults of one setting share their processes.
    order = list(dict.fromkeys(fault.setting for fault in FAULTS))
    return tuple(sorted(chosen, key=lambda fault: order.index(fault.setting)))


def named(name: str) -> Fault:
    """Return one fault.

    Raises:
        ConfigurationError: there is none of that name.
    """
    (fault,) = (each for each in choose([name]) if each.name == name)
    return fault

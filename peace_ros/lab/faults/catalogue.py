# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All faults, read from ``config/faults.yaml``, and how they are chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.resources import config_dir
from peace_ros.lab.faults.fault import (
    GOING,
    LOOKING_AGAIN,
    UNDER_WAY,
    Expected,
    Fault,
    FlightSetting,
    Moment,
)
from peace_ros.lab.faults.injections import injection

_SEVERAL = {'GOING': GOING, 'LOOKING_AGAIN': LOOKING_AGAIN, 'UNDER_WAY': UNDER_WAY}
_LISTS = ('reaches', 'allowed', 'recovers')
REPRESENTATIVE = (
    'camera_stops',
    'pilot_takes_over_landing',
    'altitude_nan',
    'executor_stalls',
    'thread_setpoint_sender',
)
"""What continuous integration runs: one of each kind."""


def load(file: Path) -> tuple[Fault, ...]:
    """Read a matrix of faults.

    Raises:
        ConfigurationError: the file or one of its faults cannot be used.
    """
    try:
        groups = yaml.safe_load(file.read_text(encoding='utf-8'))['groups']
        rows = [(group, *row) for group, faults in groups.items() for row in faults.items()]
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(f'faults {file} cannot be read: {error}') from error
    return tuple(_fault(group, name, values) for group, name, values in rows)


def _fault(group: str, name: str, values: dict[str, Any]) -> Fault:
    makers: dict[str, Callable[[Any], Any]] = {
        'injection': injection,
        'lead': injection,
        'expected': _expected,
        'at': lambda given: Moment(**given),
        'setting': lambda given: FlightSetting(**given),
    }
    try:
        made = {key: makers[key](each) for key, each in values.items() if key in makers}
        return Fault(**{**values, **made, 'name': name, 'group': group})
    except (TypeError, ValueError, KeyError, AttributeError, ConfigurationError) as error:
        raise ConfigurationError(f'fault {name} of group {group}: {error}') from error


def _expected(given: dict[str, Any]) -> Expected:
    lists = {
        key: tuple(state for name in given[key] for state in _SEVERAL.get(name, (name,)))
        for key in _LISTS
        if key in given
    }
    says = {'says': tuple(given['says'])} if 'says' in given else {}
    return Expected(**{**given, **lists, **says})


FAULTS = load(config_dir() / 'faults.yaml')
"""The matrix, in the order of the documentation."""


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

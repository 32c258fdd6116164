# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters are declared once, as fields of a frozen dataclass, with unit, bounds and meaning.

The nodes declare their ROS parameters from such a class, the documentation table is generated
from it, and a test holds the shipped YAML against it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from math import isnan
from typing import Any, cast

from peace_ros.core.domain.errors import ConfigurationError

_METADATA_KEY = 'peace_ros.parameter'
_UNITS = {'_m_s': 'm/s', '_m': 'm', '_s': 's', '_deg': 'deg'}
"""Units of parameters by the ends of their names."""


@dataclass(frozen=True)
class ParameterInfo:
    """What is known of one parameter."""

    name: str
    default: Any
    unit: str
    low: float | None
    """Smallest allowed value, or of a list the smallest allowed element."""
    high: float | None
    choices: tuple[str, ...]
    """Allowed strings; empty when any is."""
    description: str
    live: bool = False
    """It may change while the node runs."""


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> Any:
    """Declare a field of a parameter dataclass; lists are given as tuples.

    A unit that the name ends with (``_m_s``, ``_m``, ``_s``, ``_deg``) need not be given. With
    ``live`` it may change while the node runs.
    """
    info = ParameterInfo('', default, unit, low, high, choices, description, live)
    return field(default=default, metadata={_METADATA_KEY: info})


def describe(parameters: type[Any] | Any) -> tuple[ParameterInfo, ...]:
    """Return what is known of every parameter of a dataclass, in its order."""
    infos = []
    for each in fields(parameters):
        info = cast('ParameterInfo', each.metadata[_METADATA_KEY])
        by_name = next((unit for end, unit in _UNITS.items() if each.name.endswith(end)), '')
        infos.append(replace(info, name=each.name, unit=info.unit or by_name))
    return tuple(infos)


class ParameterSet:
    """What dataclasses of parameters inherit: a value outside its bounds is refused at once."""

    def __post_init__(self) -> None:
        """Raise ConfigurationError when a value lies outside its bounds."""
        for info in describe(self):
            value = getattr(self, info.name)
            if info.choices and value not in info.choices:
                raise ConfigurationError(
                    f'parameter {info.name} = {value!r}: choose one of {", ".join(info.choices)}'
                )
            if isinstance(value, bool) or not isinstance(value, int | float):
                continue
            below = info.low is not None and not value >= info.low
            above = info.high is not None and not value <= info.high
            if below or above or isnan(value):
                raise ConfigurationError(
                    f'parameter {info.name} = {value} {info.unit}'.rstrip()
                    + f': must lie between {info.low} and {info.high}'
                )

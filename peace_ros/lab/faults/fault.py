# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fault as data: what is done when, and what has to happen within which time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.landing import State
from peace_ros.lab.faults.walker import Walker
from peace_ros.nodes.status import FAILED

if TYPE_CHECKING:
    from peace_ros.lab.faults.bench import FlightBench

GOING = ('SEARCHING', 'AIMING', 'LANDING', 'HANDOVER')
"""States of a landing that is not disturbed."""
LOOKING_AGAIN = ('WAITING', 'CLIMBING', 'RESTARTING', 'SEARCHING')
"""States of a landing that has lost its site."""
UNDER_WAY = ('AIMING', 'LANDING', 'HANDOVER')
"""States of a landing that has a site."""
LEAD_BELOW_M = 45.0
"""True altitude at which a fault's lead begins."""
ABSENT = ''
"""In place of a state: the landing node is silent."""


@dataclass
class Injection:
    """Something that goes wrong; the companion is not told."""

    happens: Callable[[FlightBench], AbstractContextManager[Walker | None]]
    """The fault is there while the context lasts; its value is a person who walks below."""
    walker: Walker | None = None
    """That person, once the fault has begun."""
    _ending: ExitStack = field(default_factory=ExitStack)

    def begin(self, bench: FlightBench) -> None:
        """Begin; what an earlier flight left open stays as it is."""
        self._ending = ExitStack()
        self.walker = self._ending.enter_context(self.happens(bench))

    def end(self) -> None:
        """End it."""
        self._ending.close()


@dataclass(frozen=True)
class Moment:
    """When a fault is injected."""

    state: str = State.LANDING.value
    below_m: float = inf
    """True altitude, at which or below which."""
    after_s: float = 0.0
    """So long after both were seen."""

    def __str__(self) -> str:
        below = '' if self.below_m == inf else f' below {self.below_m:g} m'
        return f'in {self.state}{below}' + (f' for {self.after_s:g} s' if self.after_s else '')


@dataclass(frozen=True)
class Expected:
    """What has to happen; each limit counts from the injection unless it says otherwise."""

    reaches: tuple[str, ...] = ()
    """One of these states is reached; empty asks for none."""
    within_s: float = 0.0
    allowed: tuple[str, ...] = ()
    """No other state occurs while the fault lasts; empty allows all."""
    still_within_s: float | None = None
    """From then on, while the fault lasts, the vehicle truly does not descend."""
    silent_within_s: float | None = None
    """From then on no set-point is on the wire, also after the fault."""
    zero_within_s: float | None = None
    """From then on every set-point on the wire is zero while the fault lasts."""
    recovers: tuple[str, ...] = ()
    """One of these states is reached after the fault; empty asks for none."""
    recovers_within_s: float = 0.0
    """Counted from the end of the fault."""
    stays: str = ''
    """After the fault nothing but this state is seen until the end."""
    ends_processes: tuple[str, ...] = ()
    """Processes that end by themselves because of the fault, with a sentence in their log."""
    ends_within_s: float | None = None
    """They end within this time, with a status that is not 0."""
    refuses: bool = False
    """The engagement is refused with a sentence."""
    says: tuple[str, ...] = ()
    """Each of these words is part of a reason in the status since the injection."""
    over_person_s: float | None = None
    """The vehicle descends within its safety radius of a person for no longer than this."""
    flies: bool = True
    """The vehicle is held in the air; False where the autopilot itself lets go."""

    def __post_init__(self) -> None:
        known = {state.value for state in State} | {ABSENT, FAILED}
        for name in (*self.reaches, *self.allowed, *self.recovers, self.stays):
            if name not in known:
                raise ConfigurationError(f'state {name!r} of a fault: choose one of {known}')
        if bool(self.reaches) != (self.within_s > 0.0):
            raise ConfigurationError(f'{self.reaches} within {self.within_s} s: give both or none')


@dataclass(frozen=True)
class FlightSetting:
    """The flight that a fault is put into; faults of one setting share their processes."""

    world: str = 'meadow'
    """``meadow``: open ground below the start; ``crowded``: the same, every part of it occupied;
    ``roofs``: the start lies over buildings, with open ground in sight."""
    prompts: bool = False
    """With the prompt generator; otherwise the prompt is static."""
    sim_time: bool = False
    """All nodes take their time from ``/clock``."""
    signed: bool = False
    """Companion and autopilot share a key of MAVLink 2 signing."""
    autopilot: str = 'ardupilot'
    """What the simulated autopilot plays."""
    after_handover: str = 'hold'
    """Parameter of the landing node."""
    at_origin: bool = False
    """The flight begins at the origin of the local frame, where a mirrored position is the same."""


@dataclass(frozen=True)
class Fault:
    """One row of the matrix."""

    name: str
    goes_wrong: str
    """In words."""
    injection: Injection
    expected: Expected
    behaviour: str
    """What the landing does about it: one sentence for the documentation."""
    at: Moment = Moment(below_m=45.0)
    lasts_s: float = 5.0
    """The fault ends after this; and earlier when ``until_reached`` and the state is there."""
    until_reached: bool = False
    lead: Injection | None = None
    """Brings a landing below 45 m to the state of the moment; it ends with the fault."""
    setting: FlightSetting = FlightSetting()
    note: str = ''
    """What the test of this fault does not show."""
    group: str = ''
    """Its part of the documentation."""

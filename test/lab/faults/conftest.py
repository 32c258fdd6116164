# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Records as a well-behaved landing leaves them, to be spoilt by the tests."""

from __future__ import annotations

import pytest

from peace_ros.lab.faults.fault import Expected, Fault
from peace_ros.lab.faults.injections import injection
from peace_ros.lab.faults.record import Record, Said, Sent, TruthSample


@pytest.fixture
def stopping() -> Fault:
    """A fault after which the landing has to hold and to go on."""
    expected = Expected(
        reaches=('HOLD',),
        within_s=2.5,
        still_within_s=3.0,
        zero_within_s=2.8,
        recovers=('LANDING',),
        recovers_within_s=4.0,
    )
    return Fault(
        'stops', 'Something stops.', injection({'kill': 'segmentation'}), expected, 'HOLD.'
    )


def landing(*, hold_s: float = 2.0, fault_s: float = 5.0, end_s: float = 8.0) -> Record:
    """Descend at 2 m/s, hold, and go on half a second after the fault."""

    def state(at_s: float) -> str:
        return 'HOLD' if hold_s <= at_s < fault_s + 0.5 else 'LANDING'

    record = Record(state_before='LANDING', altitude_before_m=40.0, injected_s=3.0)
    record.ended_s, record.closed_s = fault_s, end_s
    steps = [step / 10.0 for step in range(round(end_s * 10) + 1)]
    record.said = [Said(at_s, state(at_s), 'because') for at_s in steps]
    altitude_m = 40.0
    for at_s in steps:
        moving = state(at_s) == 'LANDING'
        record.truths.append(TruthSample(at_s, 0.0, 0.0, altitude_m))
        record.sent.append(Sent(at_s + 0.01, 0.0, 0.0, 2.0 if moving else 0.0))
        altitude_m -= 0.2 if moving else 0.0
    return record


@pytest.fixture
def record() -> Record:
    """What such a landing leaves."""
    return landing()

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What landing/status tells of the line to the vehicle."""

from peace_ros.core.domain import Setpoint, Telemetry
from peace_ros.core.landing import Decision, State, Verdict
from peace_ros.core.vehicle import LineCounts
from peace_ros.nodes.status import VehicleSituation, status_message


class Line:
    """As much of a VehicleLink as the status reads."""

    warning = 'system 1, component 1 speaks from two addresses'
    counts = LineCounts(ignored=3, unsigned=4, forged=5, rejected=6, late=7)


def test_messages_that_were_not_used_are_counted_and_two_addresses_said(values_of):
    decision = Decision(
        State.IDLE, 'not engaged', Setpoint(0), Verdict.no_zone('no map'), 0.8, 1.0, None
    )
    told = Telemetry(1, mode='GUIDED')
    values = values_of(status_message(decision, VehicleSituation(told, 0.1, line=Line()), 5))
    assert values['line_warning'] == Line.warning
    names = ('ignored', 'unsigned', 'forged', 'rejected', 'late')
    assert [values[f'messages_{name}'] for name in names] == ['3', '4', '5', '6', '7']
    assert values['explanation'] == ''
    alone = values_of(status_message(decision, VehicleSituation(told, 0.1), 5))
    assert not any(key.startswith(('line', 'messages')) for key in alone)


def test_the_stage_since_the_hand_over_is_the_reason(values_of):
    decision = Decision(
        State.HANDOVER, 'handed over', Setpoint(0), Verdict.no_zone('no map'), 0.8, 1.0, None
    )
    told = Telemetry(1, mode='LAND', explanation='the battery is low')

    def values(**given):
        return values_of(status_message(decision, VehicleSituation(told, 0.1, **given), 5))

    assert values(stage='on the ground')['reason'] == 'handed over: on the ground'
    assert values()['reason'] == 'handed over'
    assert values(stage='on the ground', problem='no line')['reason'] == 'no line'
    assert values()['explanation'] == 'the battery is low'

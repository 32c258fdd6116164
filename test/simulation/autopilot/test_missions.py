# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mission protocol, message by message."""

from math import nan

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.datum import Datum
from peace_ros.simulation.autopilot.missions import GIVE_UP_S, MAX_ITEMS, Missions
from peace_ros.simulation.autopilot.personality import Kind, Personality

WHERE = ('127.0.0.1', 5)
ACCEPTED, NO_SPACE, INVALID, OUT_OF_ORDER, CANCELLED = 0, 4, 5, 13, 15
PLAN, FENCE, RALLY, ALL = 0, 1, 2, 255


class Client:
    """Sends to a store and keeps its clock."""

    def __init__(self, kind=Kind.ARDUPILOT):
        self.missions = Missions(Personality(kind), Datum(48.858, 2.342, 35.0))
        self.codec = mavlink.MAVLink(None, 255, 190)
        self.time_s = 0.0

    def send(self, message):
        message = self.codec.parse_buffer(bytearray(message.pack(self.codec)))[0]
        return self.missions.take(WHERE, message, self.time_s)

    def item(self, number, kind=PLAN, z=10.0):
        values = (1, 1, number, 6, 16, 0, 1, 0.0, 0.0, 0.0, nan, 488_580_000 + number, 23_420_000)
        return self.send(mavlink.MAVLink_mission_item_int_message(*values, z, kind))

    def count(self, number, kind=PLAN):
        return self.send(mavlink.MAVLink_mission_count_message(1, 1, number, kind))

    def upload(self, number, kind=PLAN):
        self.count(number, kind)
        return [self.item(n, kind) for n in range(number)][-1]

    def ask(self, number, kind=PLAN):
        (answer,) = self.send(mavlink.MAVLink_mission_request_int_message(1, 1, number, kind))
        return answer


@pytest.mark.parametrize('kind', [PLAN, FENCE, RALLY])
def test_what_was_uploaded_is_given_back(kind):
    client = Client()
    (ack,) = client.upload(3, kind)
    assert (ack.get_type(), ack.type, ack.mission_type) == ('MISSION_ACK', ACCEPTED, kind)
    (told,) = client.send(mavlink.MAVLink_mission_request_list_message(1, 1, kind))
    assert told.count == 3
    item = client.ask(2, kind)
    assert (item.x, item.y, item.z, item.command, item.frame) == (
        488_580_002,
        23_420_000,
        10,
        16,
        6,
    )


def test_the_first_item_of_a_plan_is_home_of_an_ardupilot_only():
    for kind, altitude_m in ((Kind.ARDUPILOT, 35.0), (Kind.PX4, 10.0)):
        client = Client(kind)
        client.upload(2)
        assert client.ask(0).z == altitude_m


@pytest.mark.parametrize(
    ('kind', 'asks'), [(Kind.ARDUPILOT, 'MISSION_REQUEST'), (Kind.PX4, 'MISSION_REQUEST_INT')]
)
def test_items_are_asked_for_one_after_the_other(kind, asks):
    client = Client(kind)
    assert [(m.get_type(), m.seq) for m in client.count(2)] == [(asks, 0)]
    assert [(m.get_type(), m.seq) for m in client.item(0)] == [(asks, 1)]
    assert client.item(0) == [], 'a repetition changes nothing'
    (refused,) = client.item(5)
    assert refused.type == OUT_OF_ORDER
    assert client.item(1)[0].type == ACCEPTED


def test_floating_places_are_taken_and_given():
    client = Client()
    client.count(2)
    client.item(0)
    values = (1, 1, 1, 3, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, 48.5, 2.25, 12.0, PLAN)
    client.send(mavlink.MAVLink_mission_item_message(*values))
    assert (client.ask(1).x, client.ask(1).y) == (485_000_000, 22_500_000)
    (item,) = client.send(mavlink.MAVLink_mission_request_message(1, 1, 1, PLAN))
    assert (item.get_type(), item.x, item.y, item.z) == ('MISSION_ITEM', 48.5, 2.25, 12.0)


def test_a_plan_that_cannot_be_is_refused_and_the_old_one_stays():
    client = Client()
    client.upload(2)
    assert client.count(MAX_ITEMS + 1)[0].type == NO_SPACE
    client.count(3)
    client.item(0)
    assert client.item(1, z=nan)[0].type == INVALID
    assert client.missions.count() == 2
    assert client.ask(7).type == OUT_OF_ORDER


def test_a_silent_sender_is_asked_again_and_given_up():
    client = Client()
    client.count(2)
    assert client.missions.due(0.5) == []
    ((address, again),) = client.missions.due(1.1)
    assert (address, again.seq) == (WHERE, 0)
    ((_, told),) = client.missions.due(GIVE_UP_S + 0.1)
    assert told.type == CANCELLED
    assert client.missions.due(60.0) == []
    assert client.item(0) == [], 'nothing is under way any more'


def test_clearing_takes_one_plan_or_all():
    client = Client()
    for kind in (PLAN, FENCE):
        client.upload(2, kind)
    client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
    assert (client.missions.count(PLAN), client.missions.count(FENCE)) == (2, 0)
    (ack,) = client.send(mavlink.MAVLink_mission_clear_all_message(1, 1, ALL))
    assert ack.type == ACCEPTED
    assert client.missions.count(PLAN) == 0


def test_the_current_item_is_chosen_within_the_plan():
    client = Client()
    client.upload(3)
    (told,) = client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert told.seq == 2
    (told,) = client.send(mavlink.MAVLink_mission_set_current_message(1, 1, 9))
    assert told.seq == 2

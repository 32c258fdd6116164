# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET."""

from math import inf, nan
from struct import pack, unpack

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.simulation.autopilot.parameter_store import (
    CRUISE_SPEED,
    RTL_ALTITUDE,
    ParameterStore,
)
from peace_ros.simulation.autopilot.personality import Kind, Personality

PX4 = Personality(Kind.PX4)


def over_the_line(message):
    """Return the message as the other side decodes it."""
    codec = mavlink.MAVLink(None, 255, 190)
    return codec.parse_buffer(bytearray(message.pack(codec)))[0]


def put(store, name, value, kind=9):
    message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind)
    return store.take(over_the_line(message))


def read(store, name, index=-1):
    message = mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), index)
    return [over_the_line(each) for each in store.take(over_the_line(message))[0]]


def test_the_list_numbers_every_parameter_once():
    store = ParameterStore()
    request = over_the_line(mavlink.MAVLink_param_request_list_message(1, 1))
    told = [over_the_line(each) for each in store.take(request)[0]]
    assert [m.param_index for m in told] == list(range(len(told)))
    assert {m.param_count for m in told} == {len(told)}
    names = {m.param_id for m in told}
    assert 'MAV_SYSID' in names
    assert 'SYSID_THISMAV' not in names, 'it has another name in 4.7 (measured)'
    assert read(store, '', index=3)[0].param_id == told[3].param_id


def test_a_set_value_is_news_for_everybody_and_changes_the_flight():
    store = ParameterStore()
    values, is_news = put(store, 'WP_SPD', 4.0)
    assert is_news
    assert values[0].param_value == 4.0
    assert store.flown(CRUISE_SPEED) == 4.0


@pytest.mark.parametrize('name', ['NOT_A_NAME', 'SYSID_THISMAV'])
def test_an_unknown_name_is_not_answered(name):
    store = ParameterStore()
    assert read(store, name) == []
    assert put(store, name, 1.0) == ([], False)
    assert read(store, '', index=5000) == []


@pytest.mark.parametrize('value', [nan, inf])
def test_what_is_not_finite_is_answered_with_the_old_value(value):
    assert put(ParameterStore(), 'RTL_ALT_M', value)[0][0].param_value == 15.0


@pytest.mark.parametrize(('given', 'kept'), [(3.0, 3.0), (2.6, 3.0), (1e9, 127.0), (-1e9, -128.0)])
def test_a_whole_number_stays_one_and_within_its_bits(given, kept):
    store = ParameterStore()
    put(store, 'FRAME_CLASS', given)
    assert read(store, 'FRAME_CLASS')[0].param_value == kept


def test_px4_puts_the_bytes_of_whole_numbers_into_the_float():
    store = ParameterStore(PX4)
    told = read(store, 'COM_RCL_EXCEPT')[0]
    assert told.param_type == mavlink.MAV_PARAM_TYPE_INT32
    assert unpack('<i', pack('<f', told.param_value))[0] == 4
    put(store, 'COM_RCL_EXCEPT', unpack('<f', pack('<i', -7))[0], told.param_type)
    assert unpack('<i', pack('<f', read(store, 'COM_RCL_EXCEPT')[0].param_value))[0] == -7
    assert store.flown(RTL_ALTITUDE) == 15.0

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The autopilot is listened to, asked for streams, and never told what to do."""

from __future__ import annotations

import threading
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle import VehicleParameters
from peace_ros.lab.doctor import autopilot
from peace_ros.lab.doctor.autopilot import check_autopilot

PARAMETERS = VehicleParameters()


@pytest.fixture
def in_background(mock_autopilot, free_port):
    """Let an autopilot speak on a port while it is checked; return findings and what it heard."""

    def check(speak, **ids):
        speaker, heard, stop = mock_autopilot(free_port, **ids), [], threading.Event()

        def run():
            while not stop.wait(0.05):
                speak(speaker)
                heard.extend(speaker.hear())

        thread = threading.Thread(target=run)
        thread.start()
        try:
            found = list(check_autopilot(f'udpin:127.0.0.1:{free_port}', PARAMETERS))
        finally:
            stop.set()
            thread.join()
        return found, heard

    return check


@pytest.mark.parametrize('name', ['ardupilot', 'px4'])
def test_a_flying_autopilot_has_all_that_is_needed(name, hovering, to_mend) -> None:
    with hovering(20.0, 1.0, autopilot=name) as sim:
        found = list(check_autopilot(sim.url, PARAMETERS))
    assert not to_mend(found)
    figures = {key: value for each in found for key, value in each.figures.items()}
    assert figures['autopilot'] == name
    assert figures['armed'] is True
    assert figures['rates_hz']['ATTITUDE'] == pytest.approx(30.0, rel=0.3)
    assert abs(figures['round_trip_ms']) < 100.0
    assert 'firmware' in figures


def test_only_questions_are_sent(in_background) -> None:
    _, heard = in_background(lambda speaker: speaker.heartbeat())
    kinds = {each.get_type() for each in heard}
    assert kinds == {'HEARTBEAT', 'TIMESYNC', 'COMMAND_LONG'}
    commands = {each.command for each in heard if each.get_type() == 'COMMAND_LONG'}
    assert commands == {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}


def test_streams_and_answers_that_are_missing_are_named(in_background, to_mend) -> None:
    found, _ = in_background(lambda speaker: speaker.heartbeat())
    told = '\n'.join(f'{what}: {remedy}' for what, remedy in to_mend(found))
    assert 'ATTITUDE 0.0 of 12 Hz' in told
    assert 'AUTOPILOT_VERSION' in told
    assert 'TIMESYNC is not answered' in told
    assert 'engaging would be refused: the autopilot reports no position' in told
    assert 'LOCAL_POSITION_NED' not in told
    assert 'another companion' not in told


@pytest.mark.parametrize(
    ('speak', 'words'),
    [
        (lambda _speaker: None, 'nothing came'),
        (lambda speaker: speaker.socket.sendto(b'noise', speaker.to), 'bytes came, but no HEART'),
        (lambda speaker: speaker.heartbeat(kind=1), 'fixed-wing'),
        (lambda speaker: speaker.heartbeat(autopilot=4), 'MAV_AUTOPILOT'),
    ],
)
def test_who_cannot_be_flown_is_said(speak, words, in_background, to_mend, monkeypatch) -> None:
    monkeypatch.setattr(autopilot, 'SILENCE_S', 1.0)
    found, _ = in_background(speak)
    ((what, _),) = to_mend(found)
    assert words in what


def test_another_system_is_named(in_background, to_mend, monkeypatch) -> None:
    monkeypatch.setattr(autopilot, 'SILENCE_S', 1.0)
    found, _ = in_background(lambda speaker: speaker.heartbeat(), system=7)
    ((what, _),) = to_mend(found)
    assert '7/1' in what
    assert 'vehicle_id' in what


def test_another_companion_with_our_ids_is_found(in_background, mock_autopilot, to_mend) -> None:
    twin = mock_autopilot(0, system=1, component=autopilot.COMPANION)

    def speak(speaker):
        speaker.heartbeat()
        twin.to = speaker.to
        twin.heartbeat(autopilot=8, kind=18)

    found, _ = in_background(speak)
    assert any('another companion speaks as system 1' in what for what, _ in to_mend(found))


def test_a_port_that_is_taken_is_said_at_once(free_port, mock_autopilot, to_mend) -> None:
    taken = mock_autopilot(free_port).socket.getsockname()[1]
    began_s = time.monotonic()
    ((what, _),) = to_mend(check_autopilot(f'udpin:127.0.0.1:{taken}', PARAMETERS))
    assert str(taken) in what
    assert 'end the process that holds the port' in what
    assert time.monotonic() - began_s < 1.0


def test_a_slow_connection_is_to_be_mended(hovering, to_mend, monkeypatch) -> None:
    monkeypatch.setattr(autopilot, 'SLOW_TRIP_MS', 0.0)
    with hovering(20.0, 1.0) as sim:
        ((what, remedy),) = to_mend(check_autopilot(sim.url, PARAMETERS))
    assert 'round trip' in what
    assert 'faster port' in remedy

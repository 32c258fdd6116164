# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""URLs, and lines that break."""

import os
import pty
import socket
import threading

import pytest

from peace_ros.core.domain import VehicleError
from peace_ros.core.vehicle import open_vehicle
from peace_ros.core.vehicle.transport import open_transport


@pytest.mark.parametrize(
    'url',
    ['', 'udp', 'udpin:', 'udpin:14550', 'udpin:host:x', 'udpout:h:70000', 'http://x:1',
     'serial:tty:9600', '/dev/ttyX:fast', 'tcp:1.2.3.4:-1'],
)  # fmt: skip
def test_a_wrong_url_is_answered_with_the_right_ones(url):
    with pytest.raises(VehicleError, match='udpin:HOST:PORT'):
        open_transport(url)


def test_a_port_in_use_is_named(free_port):
    first = open_transport(f'udpin:127.0.0.1:{free_port}')
    with pytest.raises(VehicleError, match=f'{free_port}.*another'):
        open_vehicle(f'udpin:127.0.0.1:{free_port}')
    first.close()


def test_nothing_heard_is_an_error_with_the_limit(free_port):
    with pytest.raises(VehicleError, match=r'no HEARTBEAT.*0\.3 s.*0 bytes'):
        open_vehicle(f'udpin:127.0.0.1:{free_port}', timeout_s=0.3)
    with pytest.raises(VehicleError, match=r'no HEARTBEAT'):
        open_vehicle(f'udpout:127.0.0.1:{free_port}', timeout_s=0.3)


def test_tcp_carries_bytes_and_tells_of_the_end():
    with socket.create_server(('127.0.0.1', 0)) as server:
        line = open_transport(f'tcp:127.0.0.1:{server.getsockname()[1]}')
        other, _ = server.accept()
        line.write(b'abc', None)
        assert other.recv(9) == b'abc'
        other.sendall(b'xyz')
        assert line.read(1.0) == [(b'xyz', None)]
        other.close()
        with pytest.raises(VehicleError, match='closed'):
            line.read(1.0)
        line.close()


def test_tcp_without_a_server_is_an_error():
    with pytest.raises(VehicleError, match='start the autopilot'):
        open_transport('tcp:127.0.0.1:1')


def test_a_missing_serial_device_or_library_is_an_error():
    with pytest.raises(VehicleError, match=r'pyserial|check the name'):
        open_transport('/dev/no-such-line:57600')


def test_a_serial_line_carries_bytes():
    pytest.importorskip('serial')
    master, slave = pty.openpty()
    line = open_transport(f'serial:{os.ttyname(slave)}:57600')
    threading.Timer(0.05, os.write, (master, b'xyz')).start()
    assert line.read(2.0) == [(b'xyz', None)]
    line.write(b'abc', None)
    assert os.read(master, 9) == b'abc'
    line.close()
    os.close(master)

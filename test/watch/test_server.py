# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page goes to its own viewers only, and a command needs token, ticket and origin."""

from __future__ import annotations

import http.client
import json
import socket
import time
from contextlib import ExitStack

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from peace_ros.core.domain import ConfigurationError
from peace_ros.watch.ledger import Ledger
from peace_ros.watch.server import PageServer
from peace_ros.watch.tickets import TICKET_S, Tickets


def post(served, path, body, **headers):
    given = {
        'Origin': served.base,
        'Authorization': f'Bearer {served.server.tickets.token}',
        'Content-Type': 'application/json',
        **{name.title(): value for name, value in headers.items()},
    }
    connection = http.client.HTTPConnection('127.0.0.1', served.server.port, timeout=10)
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    kept = {name: value for name, value in given.items() if value is not None}
    connection.request('POST', path, data, kept)
    answer = connection.getresponse()
    text = answer.read()
    connection.close()
    try:
        return answer.status, json.loads(text)
    except ValueError:
        return answer.status, {}


def get(served, path, host=None):
    connection = http.client.HTTPConnection('127.0.0.1', served.server.port, timeout=10)
    connection.request('GET', path, headers={} if host is None else {'Host': host})
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def live(served, origin=None, **options):
    return connect(
        f'ws://127.0.0.1:{served.server.port}/live', origin=origin or served.base, **options
    )


def test_serves_the_page_and_lets_no_other_site_into_it(served):
    for path in ('/', '/page.js', '/drawings.js', '/page.css', '/icon.svg'):
        status, headers, body = get(served, path)
        assert (status, len(body) > 100) == (200, True)
        assert "default-src 'none'" in headers['content-security-policy']
        assert headers['x-content-type-options'] == 'nosniff'
    assert served.server.tickets.token not in get(served, '/')[2].decode()


def test_a_command_takes_two_steps(served):
    status, prepared = post(served, '/command/prepare', {'action': 'engage'})
    assert (status, served.commands) == (200, [])
    status, answer = post(served, '/command/confirm', {'ticket': prepared['ticket']})
    assert (status, answer) == (200, {'done': True, 'sentence': 'engaged'})
    assert served.commands == ['engage']
    events = served.ledger.history(time.monotonic())['events']
    assert events[-1]['sentence'] == 'engage, asked on the page: engaged'


def test_a_refusal_of_the_landing_node_reaches_the_person(served):
    served.answer = (False, 'no heatmap has arrived')
    _, prepared = post(served, '/command/prepare', {'action': 'engage'})
    _, answer = post(served, '/command/confirm', {'ticket': prepared['ticket']})
    assert answer == {'done': False, 'sentence': 'no heatmap has arrived'}


ATTACKS = {
    'another origin': (403, {'origin': 'http://evil.example'}),
    'another port': (403, {'origin': 'http://127.0.0.1:1'}),
    'a prefix of the origin': (403, {'origin': 'http://127.0.0.1'}),
    'an opaque origin': (403, {'origin': 'null'}),
    'no origin': (403, {'origin': None}),
    'no token': (401, {'authorization': None}),
    'an empty token': (401, {'authorization': 'Bearer '}),
    'a wrong token': (401, {'authorization': 'Bearer AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA'}),
    'a token of another scheme': (401, {'authorization': 'Basic AAAA'}),
    'a token that is no ASCII': (401, {'authorization': 'Bearer \xe4\xf6\xfc'}),
    'another host': (400, {'host': 'evil.example', 'origin': 'http://evil.example'}),
    'a rebound host': (400, {'host': 'evil.example:8765', 'origin': 'http://evil.example:8765'}),
    'no host': (400, {'host': ''}),
}
BODIES = {
    'no JSON': (400, b'engage'),
    'no bytes': (400, b''),
    'a list': (400, b'["engage"]'),
    'an unknown action': (400, b'{"action": "land"}'),
    'an action that is no text': (400, b'{"action": {"a": 1}}'),
    'not UTF-8': (400, b'\xff\xfe{}'),
    'a large body': (413, b'{"action": "engage", "x": "' + b'x' * 100_000 + b'"}'),
    'deep nesting': (400, b'[' * 400),
}


@pytest.mark.parametrize('attack', ATTACKS)
@pytest.mark.parametrize('step', ['prepare', 'confirm'])
def test_refuses_who_is_not_the_page(served, attack, step):
    expected, headers = ATTACKS[attack]
    body = {'action': 'engage'}
    if step == 'confirm':
        body = {'ticket': served.server.tickets.issue('engage', time.monotonic())}
    status, _ = post(served, f'/command/{step}', body, **headers)
    assert (status, served.commands) == (expected, [])


@pytest.mark.parametrize('attack', BODIES)
def test_refuses_what_is_no_command(served, attack):
    expected, body = BODIES[attack]
    status, _ = post(served, '/command/prepare', body)
    assert (status, served.commands) == (expected, [])


@pytest.mark.parametrize('ticket', ['', 'None', 'A' * 22, None])
def test_refuses_a_ticket_that_was_not_issued(served, ticket):
    status, answer = post(served, '/command/confirm', {'ticket': ticket})
    assert (status, served.commands) == (409, [])
    assert 'begin again' in answer['sentence']


def test_a_request_that_is_replayed_does_nothing(served):
    _, prepared = post(served, '/command/prepare', {'action': 'disengage'})
    confirm = {'ticket': prepared['ticket']}
    assert post(served, '/command/confirm', confirm)[0] == 200
    assert post(served, '/command/confirm', confirm)[0] == 409
    assert served.commands == ['disengage']


def test_a_ticket_ends_after_its_time_and_with_the_next_one():
    tickets = Tickets()
    late = tickets.issue('engage', 100.0)
    assert tickets.take(late, 100.1 + TICKET_S) is None
    first, second = tickets.issue('engage', 200.0), tickets.issue('engage', 201.0)
    assert tickets.take(first, 201.0) is None
    assert tickets.take(second, 201.0) == 'engage'


@pytest.mark.parametrize('method', ['GET', 'PUT', 'DELETE', 'OPTIONS'])
def test_a_command_is_a_post(served, method):
    connection = http.client.HTTPConnection('127.0.0.1', served.server.port, timeout=10)
    connection.request(method, '/command/prepare', headers={'Origin': served.base})
    assert connection.getresponse().status == 405
    connection.close()


@pytest.mark.parametrize(
    'path',
    ['/../setup.py', '/%2e%2e/%2e%2e/setup.py', '//etc/passwd', '/page.js/../../node.py', '/.git'],
)
def test_serves_nothing_but_the_page(served, path):
    assert get(served, path)[0] == 404


@pytest.mark.parametrize('origin', ['http://evil.example', 'null', 'http://127.0.0.1'])
def test_another_site_sees_nothing(served, origin):
    with pytest.raises(InvalidStatus):
        live(served, origin)


def test_a_viewer_gets_history_state_and_pictures(served, scenes):
    scenes.fill(served.ledger)
    served.show('aiming')
    with live(served) as viewer:
        history = json.loads(viewer.recv(timeout=5))['history']
        assert len(history['samples']) > 200
        told = json.loads(viewer.recv(timeout=5))
        assert told['state']['state'] == 'AIMING'
        packed = viewer.recv(timeout=5)
        length = int.from_bytes(packed[:4], 'big')
        assert json.loads(packed[4 : 4 + length])['kind'] == 'overlay'
        assert packed[4 + length :][:2] == b'\xff\xd8'
        served.show('hold')
        begin = time.monotonic()
        while json.loads(viewer.recv(timeout=5))['state']['state'] != 'HOLD':
            assert time.monotonic() - begin < 2.0


def test_ages_go_on_while_nothing_is_heard(served):
    served.show('idle')
    with live(served) as viewer:
        viewer.recv(timeout=5)
        ages = [json.loads(viewer.recv(timeout=5))['state']['age_s'] for _ in range(6)]
        assert ages[-1] - ages[0] > 1.5
        assert json.loads(viewer.recv(timeout=5))['state']['silent']


@pytest.mark.parametrize('said', ['hello', b'\x00' * 64, 'x' * 5000, b'x' * 100_000])
def test_a_viewer_that_says_something_is_sent_away(served, said):
    with live(served) as viewer:
        viewer.recv(timeout=5)
        viewer.send(said)
        with pytest.raises(ConnectionClosed):  # noqa: PT012 - until the close arrives
            for _ in range(50):
                viewer.recv(timeout=5)
    served.show('idle')
    assert get(served, '/')[0] == 200


def test_the_fourth_of_three_viewers_is_told_why_it_sees_nothing(served):
    with ExitStack() as viewers:
        for _ in range(3):
            viewers.enter_context(live(served)).recv(timeout=5)
        with live(served) as late, pytest.raises(ConnectionClosed, match='which is the limit'):
            late.recv(timeout=5)
    deadline = time.monotonic() + 5.0
    while served.server.viewers and time.monotonic() < deadline:
        time.sleep(0.05)
    assert served.server.viewers == 0


def test_a_thousand_connections_leave_a_server_that_answers(served):
    served.show('idle')
    with live(served) as viewer:
        viewer.recv(timeout=5)
        open_ones = []
        for _ in range(1000):
            try:
                one = socket.create_connection(('127.0.0.1', served.server.port), timeout=1.0)
            except OSError:
                break
            open_ones.append(one)
        assert json.loads(viewer.recv(timeout=5))['state']['state'] == 'IDLE'
        for one in open_ones:
            one.close()
    deadline = time.monotonic() + 10.0
    while get(served, '/')[0] != 200:
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_viewer_that_reads_nothing_costs_the_others_nothing(served, scenes):
    scenes.fill(served.ledger)
    with live(served, max_queue=1), live(served) as viewer:
        viewer.recv(timeout=5)
        begin, count = time.monotonic(), 0
        while time.monotonic() - begin < 2.0:
            served.show('landing')
            if isinstance(viewer.recv(timeout=5), str):
                count += 1
        assert count >= 20


def test_a_port_that_is_taken_is_refused_in_one_sentence(served):
    with pytest.raises(ConfigurationError, match=r'cannot be opened .*give another port'):
        PageServer(Ledger('/'), served._take, port=served.server.port, viewers=1, on_defect=print)


def test_only_this_machine_reaches_the_page(served):
    assert served.server._socket.getsockname()[0] == '127.0.0.1'

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live page of a demo is served while it flies, and never ends it."""

from __future__ import annotations

import http.client
import io
import re
import time

import pytest
from rich.console import Console

from peace_ros.simulation.demo import page
from peace_ros.simulation.demo.page import live_page


def wait_for(out: io.StringIO, pattern: str) -> re.Match[str]:
    deadline = time.monotonic() + 60.0
    while (found := re.search(pattern, out.getvalue())) is None:
        assert time.monotonic() < deadline, out.getvalue()
        time.sleep(0.1)
    return found


def test_the_address_is_printed_and_works_until_the_demo_ends(tmp_path):
    out = io.StringIO()
    with live_page(tmp_path, Console(file=out, force_terminal=False)):
        port = int(wait_for(out, r'live page: http://127\.0\.0\.1:(\d+)/#token=\S{32}')[1])
        connection = http.client.HTTPConnection('127.0.0.1', port, timeout=5)
        connection.request('GET', '/')
        assert connection.getresponse().status == 200
        connection.close()
    assert not (tmp_path / 'watch.url').exists()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection('127.0.0.1', port, timeout=5).connect()


def test_a_page_that_does_not_start_is_said_and_the_demo_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr(page, '_MODULE', 'no_such_module')
    out, flown = io.StringIO(), False
    with live_page(tmp_path, Console(file=out, force_terminal=False, width=300)):
        wait_for(out, r'the live page does not start: see .*watch\.log')
        flown = True
    assert flown

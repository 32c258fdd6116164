# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measurement of starts and ends, with real processes."""

from __future__ import annotations

import time

import pytest

from peace_ros.core.node_parameters import FLYING_NODES, RECORDER
from peace_ros.lab.benchmark import start_stop
from peace_ros.lab.benchmark.start_stop import Lifetime


def test_every_node_on_board_is_measured():
    assert set(start_stop.READY) == {*FLYING_NODES, 'perception', RECORDER}


@pytest.mark.parametrize('node', ['landing', RECORDER])
def test_a_node_that_works_is_measured_until_its_end(node):
    life = start_stop.measure(node)
    assert life.status == 0
    assert 0.1 < life.ready_s < 60.0
    assert 0.0 < life.exit_s < 60.0
    assert 0.1 < life.cpu_s < 2.0 * life.ready_s


def test_a_node_that_ends_by_itself_is_no_measurement(monkeypatch):
    monkeypatch.setitem(start_stop.READY, 'no_such_node', ('ready: ',))
    with pytest.raises(RuntimeError, match=r'No module named peace_ros\.nodes\.no_such_node'):
        start_stop.measure('no_such_node')


@pytest.mark.parametrize(
    ('life', 'status'),
    [
        (Lifetime(1.0, 0.8, 0.5, 0), 0),
        (Lifetime(3.5, 0.8, 0.5, 0), 1),
        (Lifetime(1.0, 0.8, 2.5, 0), 1),
        (Lifetime(1.0, 0.8, 0.5, 2), 1),
    ],
)
def test_the_exit_status_says_whether_the_limits_hold(life, status, monkeypatch, capsys):
    monkeypatch.setattr(start_stop, 'measure', lambda _node: life)
    assert start_stop.main(['--times', '2', '--nodes', 'landing']) == status
    printed = capsys.readouterr().out
    assert f'| `landing` | {life.ready_s:.2f} s, {life.ready_s:.2f} s | 0.80 s |' in printed
    assert printed.rstrip().endswith('no' if status else 'yes')


def test_no_start_at_all_is_refused(capsys):
    with pytest.raises(SystemExit) as refused:
        start_stop.main(['--times', '0'])
    assert refused.value.code == 2
    assert '--times is 0' in capsys.readouterr().err


def test_without_frames_there_is_no_measurement(monkeypatch):
    def no_image(*_given):
        raise ValueError('no image of this encoding')

    monkeypatch.setattr(start_stop, 'measure', lambda _node: time.sleep(1.0))
    monkeypatch.setattr(start_stop, 'image_message', no_image)
    with pytest.raises(ValueError, match='no image of this encoding'):
        start_stop.main(['--times', '1', '--nodes', 'landing'])

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever ends a guarded thread reaches its owner, once, with the traceback."""

from __future__ import annotations

import traceback

import pytest

from peace_ros.core.threads import GuardedThread


def raising(error: BaseException):
    def work():
        raise error

    return work


@pytest.mark.parametrize('error', [ZeroDivisionError('x'), SystemExit(0), KeyboardInterrupt()])
def test_the_owner_gets_what_ended_the_thread(error):
    got = []
    thread = GuardedThread(raising(error), 'under_test', got.append)
    thread.start()
    thread.join(10.0)
    assert got == [error]
    assert thread.defect is error
    assert 'in work' in ''.join(traceback.format_exception(error))


def test_without_an_owner_it_is_printed_with_the_name_of_the_thread(capsys):
    thread = GuardedThread(raising(ZeroDivisionError('by nothing')), 'under_test')
    thread.start()
    thread.join(10.0)
    said = capsys.readouterr().err
    assert 'under_test' in said
    assert 'ZeroDivisionError: by nothing' in said


def test_work_that_ends_by_itself_is_no_defect():
    got = []
    thread = GuardedThread(lambda: None, 'under_test', got.append)
    thread.start()
    thread.join(10.0)
    assert got == []
    assert thread.defect is None
    assert thread.daemon, 'a thread that hangs must not keep a process from ending'

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorder that is killed leaves files that can be replayed; what is not is found."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time

import pytest

from peace_ros.lab.recorder.cuts import Remains, read_remains
from peace_ros.recording import BagWriter
from peace_ros.recording.messages import diagnostic_array


@pytest.mark.integration
def test_three_of_three_cuts_leave_files_that_can_be_replayed(tmp_path) -> None:
    done = subprocess.run(
        [
            *(sys.executable, '-m', 'peace_ros.lab.recorder.cuts'),
            *('--times', '3', '--seed', str(random.randrange(1000))),
        ],
        env={**os.environ, 'TMPDIR': str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert '3 of 3 files can be replayed' in done.stdout


def test_what_cannot_be_replayed_is_found(tmp_path) -> None:
    (tmp_path / 'empty.mcap').write_bytes(b'')
    assert not read_remains(tmp_path / 'empty.mcap', time.time()).passed
    with BagWriter(tmp_path / 'poor.mcap') as bag:
        bag.write('/prompt', time.time_ns(), diagnostic_array(1, 'x', 0, '', []))
    assert not read_remains(tmp_path / 'poor.mcap', time.time()).passed
    assert Remains(0.9, 3, '').passed
    assert not Remains(1.1, 3, '').passed
    assert not Remains(0.1, 3, 'frame cut short').passed

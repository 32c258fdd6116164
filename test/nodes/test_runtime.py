# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: they end quietly on a signal and with one sentence on a bad value."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from peace_ros.simulation.demo.nodes import MODULES

ROOT = Path(__file__).resolve().parents[2]


def start(node: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-m', MODULES[node], '--ros-args', *arguments],
        cwd=ROOT,
        env={**os.environ, 'PYTHONUNBUFFERED': '1'},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


SLOW_NODE = """
import sys, time
from std_msgs.msg import String
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.runtime import run

class SlowNode(PeaceNode):
    def __init__(self):
        super().__init__('slow')
        self.out = self.create_publisher(String, 'said', 1)
        self.timer = self.create_timer(0.01, self.speak)

    def speak(self):
        print('begun', flush=True)
        time.sleep(0.5)
        self.out.publish(String(data='late'))
        print('published', flush=True)

    def close(self):
        print('closed', flush=True)

sys.exit(run(SlowNode))
"""


def test_nothing_is_destroyed_under_a_callback():
    with subprocess.Popen(
        [sys.executable, '-c', SLOW_NODE],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'begun\n'
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
        assert process.wait(20) == 0
    assert sorted(rest.splitlines()) == ['closed', 'published']


BUSY_NODE = """
import gc, sys
from rclpy.task import Future
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.runtime import run

class BusyNode(PeaceNode):
    turns = 0

    def __init__(self):
        super().__init__('busy')
        self.timer = self.create_timer(0.002, self.turn)

    def turn(self):
        self.turns += 1
        if self.turns == 300:
            waiting = [each for each in gc.get_objects() if isinstance(each, Future)]
            print('callbacks', max(len(each._callbacks) for each in waiting), flush=True)
            self.end()

sys.exit(run(BusyNode))
"""


def test_a_node_that_spins_for_long_gathers_nothing():
    done = subprocess.run(
        [sys.executable, '-c', BUSY_NODE],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    name, callbacks = done.stdout.split()
    assert name == 'callbacks'
    assert int(callbacks) <= 2


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ends_quietly_on_a_signal(number):
    with start('prompt_generator', '-p', 'template:=DD') as process:
        assert process.stdout is not None
        assert 'ready' in process.stdout.readline()
        process.send_signal(number)
        rest = process.stdout.read()
        assert process.wait(20) == 0
    assert 'Traceback' not in rest


def test_the_model_is_stated_with_its_provider_and_memory():
    with start('segmentation', '-p', 'template:=DD', '-p', 'threads:=1') as process:
        assert process.stdout is not None
        said = process.stdout.readline() + process.stdout.readline()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.wait(20) == 0
    stated = r'clipseg-small \w+ on CPUExecutionProvider, 1 thread, \d+ MB, warmed up in [\d.]+ s'
    assert re.search(stated, said), said


@pytest.mark.parametrize(
    ('node', 'arguments', 'words'),
    [
        ('segmentation', ('-p', 'threads:=0'), 'threads = 0: must lie between 1 and 64'),
        (
            'segmentation',
            ('-p', 'family:=fastsam', '-p', 'bundle:=fastsam-that-nobody-made'),
            'fastsam-that-nobody-made',
        ),
        ('prompt_generator', ('--params-file', '/no/such.yaml'), '/no/such.yaml'),
        ('landing', ('-p', 'mavlink:=nonsense'), "connection 'nonsense' is not understood"),
        ('landing', ('-p', 'mavlink:=udpin:0.0.0.0:70000'), 'udpin:HOST:PORT'),
        ('landing', ('-p', 'vehicle.signing_key_file:=/no/key'), '/no/key: No such file'),
        ('satellite_view', ('-p', 'pose_mavlink:=udp:1'), "connection 'udp:1' is not understood"),
        (
            'satellite_view',
            ('-p', 'pose_mavlink:=udpin:127.0.0.1:0', '-p', 'pose_signing_key_file:=/no/key'),
            '/no/key: No such file',
        ),
    ],
)
def test_a_bad_value_ends_in_one_sentence_and_status_2(node, arguments, words):
    with start(node, *arguments) as process:
        output, _ = process.communicate(timeout=30)
    assert process.returncode == 2
    assert words in output
    assert 'Traceback' not in output
    assert len(output.splitlines()) == 1 or 'rcl' in output, output


def test_the_shipped_defaults_are_taken_by_a_node():
    defaults = str(ROOT / 'config' / 'defaults.yaml')
    with start('autopilot_sim', '--params-file', defaults, '-p', 'port:=0') as process:
        assert process.stdout is not None
        assert 'ready' in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.wait(20) == 0

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No thread of core and nodes dies in silence: all are found by reading the source, and broken."""

from __future__ import annotations

import ast
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from peace_ros.core.domain import Prompt, Setpoint, Telemetry
from peace_ros.core.vehicle import SetpointSender, open_vehicle
from peace_ros.nodes import qos
from peace_ros.nodes.connection import Connection
from peace_ros.nodes.engagement import EngagementServices
from peace_ros.nodes.failure import Failure
from peace_ros.nodes.handover import AfterHandover
from peace_ros.nodes.messages import prompt_to_message
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.nodes.segmentation import SegmentationNode
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(
    path for room in ('core', 'nodes') for path in (ROOT / 'peace_ros' / room).rglob('*.py')
)
GUARD = ROOT / 'peace_ros' / 'core' / 'threads.py'
MAKERS = {'GuardedThread': 1, 'NewestWorker': 3}
"""What starts a thread, and which of its arguments is the name."""
BANNED_NAMES = {'Thread', 'Timer', 'start_new_thread', 'ThreadPoolExecutor', 'ThreadPool'}
BANNED_MODULES = {'_thread', 'concurrent', 'multiprocessing', 'asyncio'}
LIMIT_S = 10.0


class DefectError(RuntimeError):
    """What no author expected."""


def bypasses(source: str) -> list[str]:
    """Return what starts threads without the guard."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in BANNED_NAMES:
            found.append(ast.unparse(node))
        if isinstance(node, ast.Import):
            found += [n.name for n in node.names if n.name.split('.')[0] in BANNED_MODULES]
        if isinstance(node, ast.ImportFrom):
            module = (node.module or '').split('.')[0]
            names = {alias.name for alias in node.names}
            if module in BANNED_MODULES or (module == 'threading' and names & BANNED_NAMES):
                found.append(ast.unparse(node))
    return found


def thread_names() -> Iterator[str]:
    """Return the names of all threads that core and nodes can start."""
    for path in SOURCES:
        tree = ast.parse(path.read_text(encoding='utf-8'))
        constants = {
            target.id: node.value.value
            for node in tree.body
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            maker = call.func.id if isinstance(call.func, ast.Name) else ''
            if maker not in MAKERS:
                continue
            given = {word.arg: word.value for word in call.keywords}
            name = given.get('name') or call.args[MAKERS[maker]]
            if isinstance(name, ast.Constant):
                yield name.value
            elif isinstance(name, ast.Name) and name.id in constants:
                yield constants[name.id]
            elif path.name != 'worker.py':
                yield f'{path.name}: {ast.unparse(call)}'


class Link:
    """A vehicle whose requests and set-points meet a defect."""

    taken_over = False

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if not name.startswith(('request_', 'send_')):
            raise AttributeError(name)
        return raise_defect

    def telemetry(self) -> Telemetry:
        return Telemetry(received_ns=0, in_control=True)


def raise_defect(*_given: Any, **_more: Any) -> Any:
    raise DefectError


def break_sender(fail: Callable[[BaseException], None], _bench: Any) -> None:
    sender = SetpointSender(Link(), on_defect=fail)
    sender.start()
    sender.submit(Setpoint(0, 1.0))


def break_hand_over(fail: Callable[[BaseException], None], _bench: Any) -> None:
    now_ns = [10**12]
    link = Link()
    link.send_velocity = lambda _setpoint: None
    sender = SetpointSender(link, steady_ns=lambda: now_ns[0], on_defect=fail)
    sender.submit(Setpoint(0, 1.0))
    now_ns[0] += 3 * 10**9
    sender.tick()


def break_reader(fail: Callable[[BaseException], None], _bench: Any) -> None:
    clock: list[Callable[[], int]] = [time.monotonic_ns]
    with AutopilotSim(AutopilotParameters(port=0)) as sim:
        link = open_vehicle(sim.url, clock_ns=lambda: clock[0](), on_defect=fail)  # noqa: PLW0108
        assert link.problem == ''
        clock[0] = raise_defect
        deadline = time.monotonic() + LIMIT_S
        while not link.problem:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert 'the thread that reads the autopilot has ended: DefectError' in link.problem
        link.close()


def break_connection(fail: Callable[[BaseException], None], _bench: Any) -> None:
    Connection(raise_defect, lambda _sentence: None, fail)


def break_after_handover(fail: Callable[[BaseException], None], _bench: Any) -> None:
    after = AfterHandover('land', lambda _sentence: None, fail)
    after.follow(Link(), None, handed_over=True)


def break_engagement(fail: Callable[[BaseException], None], bench: Any) -> None:
    class Flown(type(bench.peer)):  # type: ignore[misc]
        check_engagement = staticmethod(raise_defect)

        def fail(self, error: BaseException) -> None:
            fail(error)

    node = Flown('flown')
    EngagementServices(node, None, auto=False)
    bench.spin(node)
    client = bench.peer.create_client(Trigger, '/flown/engage')
    bench.until(client.service_is_ready)
    client.call_async(Trigger.Request())


def break_last_step(fail: Callable[[BaseException], None], _bench: Any) -> None:
    """One of the last steps fails, and the others are done all the same."""
    failure = Failure()
    failure.begin(DefectError(), lambda _sentence: (raise_defect, lambda: fail(DefectError())))


def break_worker(create: Callable[[], Any], topic: str) -> Callable[..., None]:
    def start(fail: Callable[[BaseException], None], bench: Any) -> None:
        node = bench.run(*create())
        node.last_steps = lambda _sentence: (lambda: fail(node.failure),)
        bench.feed(topic)

    return start


class Model:
    """Stands for a generator and for a segmenter."""

    def __init__(self, broken: str) -> None:
        self.unknown_terms: dict[str, tuple[str, ...]] = {}
        self.prepare = self.segment = self.generate = lambda *_given: None
        setattr(self, broken, raise_defect)


CASES: dict[str, Callable[..., None]] = {
    'after_handover': break_after_handover,
    'connection': break_connection,
    'engage': break_engagement,
    'hand_over': break_hand_over,
    'last_step': break_last_step,
    'mavlink_link': break_reader,
    'prepare': break_worker(lambda: (SegmentationNode, Model('prepare')), 'prompt'),
    'prompt_generator': break_worker(lambda: (PromptGeneratorNode, Model('generate')), 'image'),
    'segmentation': break_worker(lambda: (SegmentationNode, Model('segment')), 'both'),
    'setpoint_sender': break_sender,
}
"""``spin`` needs a process: see below."""


def test_no_thread_is_started_without_the_guard():
    found = {
        str(path.relative_to(ROOT)): bypasses(path.read_text(encoding='utf-8'))
        for path in SOURCES
        if path != GUARD
    }
    assert {path: each for path, each in found.items() if each} == {}


@pytest.mark.parametrize(
    'source',
    [
        'import threading\nthreading.Thread(target=f).start()',
        'from threading import Timer',
        'import _thread',
        'from concurrent.futures import ThreadPoolExecutor',
        'import concurrent.futures as pools',
    ],
)
def test_the_reading_of_the_source_finds_what_bypasses_the_guard(source):
    assert bypasses(source)


def test_every_thread_has_a_name_of_its_own_and_a_test_that_breaks_it():
    assert set(thread_names()) == {*CASES, 'spin'}


@pytest.mark.parametrize('name', CASES)
def test_a_defect_in_a_thread_reaches_its_owner(name, bench, picture):
    got: list[BaseException] = []
    heard = threading.Event()

    def fail(error: BaseException) -> None:
        got.append(error)
        heard.set()

    feed(bench, picture)
    CASES[name](fail, bench)
    assert heard.wait(LIMIT_S)
    assert [type(each) for each in got] == [DefectError]


def feed(bench: Any, picture: Callable[[int], Any]) -> None:
    """Let the bench publish what workers work on."""

    def publish(topic: str) -> None:
        if topic in {'prompt', 'both'}:
            prompts = bench.offer(DiagnosticArray, 'prompt', qos.RESULT)
            prompts.publish(prompt_to_message(Prompt('A {term}.', 7)))
            time.sleep(0.3)
        if topic in {'image', 'both'}:
            bench.offer(Image, 'image', qos.IMAGE_OUT).publish(picture(7))

    bench.feed = publish


BROKEN_NODE = """
import sys, time
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.runtime import run

class BrokenNode(PeaceNode):
    def __init__(self):
        super().__init__('broken')
        way = sys.argv[1]
        if way == 'timer':
            self.create_timer(0.2, self.break_down)
        elif way == 'watch':
            self.watch = self.break_down
        elif way == 'service':
            self.create_service(Trigger, 'break', self.break_later)
            self.client = self.create_client(Trigger, 'break')
            self.once = self.create_timer(0.3, lambda: self.client.call_async(Trigger.Request()))
        else:
            self.create_subscription(Float64, 'break', self.break_down, 1)
            self.out = self.create_publisher(Float64, 'break', 1)
            self.create_timer(0.1, lambda: self.out.publish(Float64()))

    def break_down(self, *given):
        print('breaking', time.monotonic(), flush=True)
        raise ZeroDivisionError('by nothing')

    async def break_later(self, *given):
        self.break_down()

    def last_steps(self, sentence):
        print(sentence, flush=True)
        # One step hangs, as a middleware that is broken too may.
        return lambda: time.sleep(100), lambda: print('last step', flush=True)

    def close(self):
        time.sleep(100)

sys.exit(run(BrokenNode))
"""


@pytest.mark.parametrize('way', ['timer', 'subscription', 'service', 'watch'])
def test_a_defect_in_a_callback_ends_the_process_within_a_second(way):
    process = subprocess.Popen(
        [sys.executable, '-c', BROKEN_NODE, way],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        output, log = process.communicate(timeout=30)
        ended_s = time.monotonic()
    finally:
        process.kill()
    assert process.returncode == 1, log
    broke_s = float(output.split()[1])
    assert ended_s - broke_s < 1.0
    assert 'a defect ended thread' in output
    assert 'ZeroDivisionError: by nothing' in output
    assert 'last step' in output
    assert 'Traceback' in log


def test_a_landing_node_that_still_waits_for_its_vehicle_fails_as_well(bench, values_of):
    statuses = bench.heard(DiagnosticArray, 'broken/landing/status', qos.RESULT)
    node = subprocess.Popen(
        [
            *(sys.executable, '-m', 'peace_ros.lab.faults.landing', '--ros-args'),
            *('-p', 'mavlink:=udpin:127.0.0.1:0', '-r', '__ns:=/broken'),
        ],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        defects = bench.offer(String, 'broken/fault/defect', qos.RESULT)
        bench.until(lambda: bool(statuses))
        defects.publish(String(data='connection'))
        _, log = node.communicate(timeout=20)
    finally:
        node.kill()
    assert node.returncode == 1, log
    assert 'InjectedDefectError' in log
    bench.until(lambda: values_of(statuses[-1])['state'] == 'FAILED')
    assert 'thread connection' in values_of(statuses[-1])['reason']

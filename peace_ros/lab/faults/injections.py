# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ways in which something can go wrong on a bench.

Each is a generator: what stands before its ``yield`` begins the fault, what follows ends it.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import shutil
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Camera, ConfigurationError, VehicleError
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.resources import models_dir
from peace_ros.lab.faults import line, tamper
from peace_ros.lab.faults.fault import Injection
from peace_ros.lab.faults.line import Stranger
from peace_ros.lab.faults.node import HEATMAP, IMAGE, PROMPT
from peace_ros.lab.faults.tamper import Tamper
from peace_ros.lab.faults.walker import Walker

if TYPE_CHECKING:
    from peace_ros.lab.faults.bench import FlightBench

Course = Generator[Walker | None, None, None]
"""Yields once, while the fault lasts: a person who walks below, if there is one."""

_HEARD_S = 0.1
"""What is published must have been heard before the next message on another topic."""


def _topic(bench: FlightBench, name: str, make: Callable[[], Tamper]) -> Course:
    """Something happens to the messages of a topic; a tamper remembers, so each has its own."""
    bench.node.tamper(name, make())
    yield None
    bench.node.tamper(name, None)


def _line(bench: FlightBench, make: Callable[[], Tamper], *, up: bool, down: bool) -> Course:
    """Something happens to the datagrams from the companion (up) or from the autopilot (down)."""
    if up:
        bench.line.up = make()
    if down:
        bench.line.down = make()
    yield None
    bench.line.mend()


def _autopilot(
    bench: FlightBench,
    fault: str,
    arguments: dict[str, Any] | None = None,
    undo: str = 'clear',
    undo_arguments: dict[str, Any] | None = None,
) -> Course:
    """Something happens to the autopilot; an empty ``undo`` cannot be undone."""
    bench.ask_autopilot(fault, arguments or {})
    yield None
    if undo:
        bench.ask_autopilot(undo, undo_arguments or {})


def _kill(bench: FlightBench, process: str) -> Course:
    """A process ends with SIGKILL, and is started again."""
    bench.kill(process)
    yield None
    bench.restore(process)


def _suspend(bench: FlightBench, process: str) -> Course:
    """A process gets no processor time."""
    bench.suspend(process)
    yield None
    bench.resume(process)


def _stall(bench: FlightBench, seconds: float) -> Course:
    """The executor of the landing node is busy with something else; that ends by itself."""
    bench.silence_begins()
    bench.node.stall_landing(seconds)
    yield None
    bench.silence_ends()


def _defect(
    bench: FlightBench, thread: str, *, engages: bool = False, stalls_s: float = 0.0
) -> Course:
    """A thread of the landing node raises an exception; the node ends, and is started again.

    Args:
        bench: where.
        thread: see :mod:`peace_ros.lab.faults.landing`.
        engages: a person engages, by which the thread begins.
        stalls_s: the executor is busy for so long, by which the dead-man's thread begins.
    """
    bench.silence_begins()
    bench.node.break_landing(thread)
    if engages or stalls_s:
        time.sleep(_HEARD_S)
    if engages:
        bench.node.engage_without_waiting()
    if stalls_s:
        bench.node.stall_landing(stalls_s)
    yield None
    bench.restore('landing')


def _intruder(bench: FlightBench, topic: str) -> Course:
    """Somebody else publishes a topic, too; nothing comes from there."""
    publisher = bench.node.add_publisher(topic)
    yield None
    bench.node.remove_publisher(publisher)


def _model(bench: FlightBench, fault: str, revive: bool = False) -> Course:
    """The segmentation model fails; ``revive`` starts a node again that ended by it."""
    bench.node.fail_model(fault)
    yield None
    if revive:
        bench.restore('segmentation')
    else:
        bench.node.fail_model('')


def _bundle(bench: FlightBench, *, honest: bool) -> Course:
    """The segmentation node is started with a damaged bundle, see :func:`damaged_bundle`."""
    copy = damaged_bundle(bench.folder / f'bundle-{time.monotonic_ns()}', honest=honest)
    bench.start('segmentation', bundle=str(copy))
    yield None
    bench.restore('segmentation')


def damaged_bundle(folder: Path, *, honest: bool) -> Path:
    """Copy the shipped CLIPSeg bundle and overwrite weights with NaN.

    When ``honest``, the manifest has the checksum of the changed file: the damage shows only in
    numbers.
    """
    shutil.copytree(models_dir() / 'clipseg-small', folder)
    manifest_file = folder / 'manifest.json'
    manifest = json.loads(manifest_file.read_text(encoding='utf-8'))
    name = manifest['roles']['image_encoder']
    data = bytearray((folder / name).read_bytes())
    # 0xFF in every byte is NaN in fp16 and fp32; the middle of this file is weights, and a longer
    # stretch could reach what lies between them.
    middle = len(data) // 2
    data[middle : middle + 8] = b'\xff' * 8
    (folder / name).write_bytes(data)
    if honest:
        manifest['files'][name]['sha256'] = hashlib.sha256(data).hexdigest()
        manifest_file.write_text(json.dumps(manifest), encoding='utf-8')
    return folder


def _clock_step(bench: FlightBench, seconds: float) -> Course:
    """``/clock`` and with it the stamps of the camera step, and go on from there."""
    bench.node.clock_step_ns += round(seconds * 1e9)
    yield None


def _second_companion(bench: FlightBench, message: str, rate_hz: float) -> Course:
    """Somebody else commands the same autopilot: a key of ``_MESSAGES``, once at a rate of 0."""
    stranger, make = Stranger(bench.autopilot_port), _MESSAGES[message]
    if rate_hz > 0.0:
        stranger.stream(make, rate_hz)
    else:
        stranger.send(make())
    yield None
    stranger.close()


def _forged_telemetry(
    bench: FlightBench, *, from_elsewhere: bool = True, rate_hz: float = 30.0
) -> Course:
    """Somebody sends the companion a position in the name of the autopilot.

    ``from_elsewhere``: from another address than the autopilot's.
    """
    stop, data = threading.Event(), _forged_position()

    def run() -> None:
        while not stop.wait(1.0 / rate_hz):
            bench.line.tell_companion(data, from_elsewhere=from_elsewhere)

    threading.Thread(target=run, name='forger', daemon=True).start()
    yield None
    stop.set()


def _person(
    bench: FlightBench,
    *,
    seen: bool,
    from_m: tuple[float, float] = (4.0, 3.0),
    speed_m_s: float = 1.4,
) -> Course:
    """A person walks to the place that the landing has chosen and stays there.

    Args:
        bench: where.
        seen: the heatmap shows the person whatever the model makes of the picture.
        from_m: north and east of that place.
        speed_m_s: of the person.
    """
    pose = bench.node.newest_pose()
    if pose is None:
        raise VehicleError('the ground truth has not been heard: nobody can walk under it')
    here = bench.node.site() or (pose.north_m, pose.east_m)
    start = (here[0] + from_m[0], here[1] + from_m[1])
    walker = Walker(pose.stamp_ns, start, here, speed_m_s)
    view: Camera = CameraOptions().camera
    painted = tamper.with_walker_seen if seen else tamper.with_walker
    bench.node.tamper(HEATMAP if seen else IMAGE, painted(walker, view, bench.node.pose_at))
    yield walker


def _full_disk(bench: FlightBench, limit_bytes: int = 200_000) -> Course:
    """A recorder's disk is full after some bytes, by which the recorder ends."""
    bench.start_recorder(limit_bytes)
    yield None
    bench.stop('recorder')


def _together(bench: FlightBench, *parts: Injection) -> Course:
    """Several things at once; they end in reverse order."""
    for each in parts:
        each.begin(bench)
    yield None
    for each in reversed(parts):
        each.end()


def _loiter() -> Any:
    return mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def _velocity(north_m_s: float, east_m_s: float, down_m_s: float) -> Any:
    velocity_only = 0x5C7
    return mavlink.MAVLink_set_position_target_local_ned_message(
        *(0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, velocity_only),
        *(0.0, 0.0, 0.0),
        *(north_m_s, east_m_s, down_m_s),
        *(0.0, 0.0, 0.0, 0.0, 0.0),
    )


def _forged_position() -> bytes:
    codec = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
    message = mavlink.MAVLink_local_position_ned_message(1_000_000, 0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
    return bytes(message.pack(codec))


_MESSAGES: dict[str, Callable[[], Any]] = {
    'loiter': _loiter,
    'descend': lambda: _velocity(0.0, 0.0, 2.0),
    'north': lambda: _velocity(2.0, 0.0, 0.0),
}


def injection(given: dict[str, Any]) -> Injection:
    """Return the injection that ``config/faults.yaml`` names as ``{kind: arguments}``.

    Raises:
        ConfigurationError: the kind or its tamper is unknown.
        TypeError: the kind takes other arguments.
    """
    ((kind, given_arguments),) = given.items()
    arguments, named = _arguments(given_arguments)
    if kind in _TAMPERED:
        course = partial(_TAMPERED[kind], make=_tamper(*arguments, **named))
        arguments, named = [], {}
    elif kind in _KINDS:
        course = partial(_KINDS[kind])
    else:
        known = ', '.join((*_TAMPERED, *_KINDS))
        raise ConfigurationError(f'injection {kind!r}: choose one of {known}')
    if kind == 'together':
        arguments = [injection(each) for each in arguments]
    inspect.signature(course).bind(None, *arguments, **named)
    return Injection(lambda bench: contextmanager(course)(bench, *arguments, **named))


def _arguments(given: Any) -> tuple[list[Any], dict[str, Any]]:
    """Return positional and named arguments: of a list, of a mapping, or a single one."""
    if isinstance(given, dict):
        return [], given
    return (given if isinstance(given, list) else [given]), {}


def _tamper(name: str = '', **given: Any) -> Callable[[], Tamper]:
    """Return the factory of a tamper: ``name``, or ``{name: arguments}``."""
    ((name, values),) = given.items() if given else ((name, []),)
    if name not in TAMPERS:
        raise ConfigurationError(f'tamper {name!r}: choose one of {", ".join(TAMPERS)}')
    arguments, named = _arguments(values)
    return lambda: TAMPERS[name](*arguments, **named)


_TAMPERED: dict[str, Callable[..., Course]] = {
    **{
        kind: partial(_topic, name=name)
        for kind, name in (('camera', IMAGE), ('heatmap', HEATMAP), ('prompt', PROMPT))
    },
    'line': partial(_line, up=True, down=True),
    'line_up': partial(_line, up=True, down=False),
    'line_down': partial(_line, up=False, down=True),
}
"""Kind -> what a tamper is put on."""
_KINDS: dict[str, Callable[..., Course]] = {
    each.__name__.removeprefix('_'): each
    for each in (
        *(_autopilot, _second_companion, _forged_telemetry, _kill, _suspend, _stall, _defect),
        *(_intruder, _model, _bundle, _clock_step, _person, _full_disk, _together),
    )
}
TAMPERS: dict[str, Callable[..., Tamper]] = {**tamper.TAMPERS, **line.TAMPERS}

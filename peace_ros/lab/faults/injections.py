# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ways in which something can go wrong; each is begun and ended on a bench."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import Camera, ConfigurationError, VehicleError
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.resources import models_dir
from peace_ros.lab.faults import line, tamper
from peace_ros.lab.faults.line import Stranger
from peace_ros.lab.faults.node import HEATMAP, IMAGE, PROMPT
from peace_ros.lab.faults.tamper import Tamper
from peace_ros.lab.faults.walker import Walker

if TYPE_CHECKING:
    from peace_ros.lab.faults.bench import FlightBench
    from peace_ros.lab.faults.fault import Injection

_HEARD_S = 0.1
"""What is published must have been heard before the next message on another topic."""


@dataclass(frozen=True)
class Topic:
    """Something happens to the messages of a topic."""

    name: str
    make: Callable[[], Tamper]
    """Called at the injection, because tampers remember."""

    def begin(self, bench: FlightBench) -> None:
        """Put the tamper in."""
        bench.node.tamper(self.name, self.make())

    def end(self, bench: FlightBench) -> None:
        """Hand on what comes."""
        bench.node.tamper(self.name, None)


@dataclass(frozen=True)
class Autopilot:
    """Something happens to the autopilot; what undoes it is part of the injection."""

    fault: str
    arguments: dict[str, Any] = field(default_factory=dict)
    undo: str = 'clear'
    undo_arguments: dict[str, Any] = field(default_factory=dict)

    def begin(self, bench: FlightBench) -> None:
        """Put the fault in."""
        bench.ask_autopilot(self.fault, self.arguments)

    def end(self, bench: FlightBench) -> None:
        """Undo it, where it can be undone."""
        if self.undo:
            bench.ask_autopilot(self.undo, self.undo_arguments)


@dataclass(frozen=True)
class DisturbedLine:
    """Something happens to the datagrams between companion and autopilot."""

    up: Callable[[], Tamper] | None = None
    """Companion to autopilot."""
    down: Callable[[], Tamper] | None = None

    def begin(self, bench: FlightBench) -> None:
        """Put the tampers in."""
        if self.up is not None:
            bench.line.up = self.up()
        if self.down is not None:
            bench.line.down = self.down()

    def end(self, bench: FlightBench) -> None:
        """Restore the line."""
        bench.line.mend()


@dataclass(frozen=True)
class Killed:
    """A process ends with SIGKILL, and is started again."""

    process: str

    def begin(self, bench: FlightBench) -> None:
        """Kill it."""
        bench.kill(self.process)

    def end(self, bench: FlightBench) -> None:
        """Start it again."""
        bench.restore(self.process)


@dataclass(frozen=True)
class Suspended:
    """A process gets no processor time."""

    process: str

    def begin(self, bench: FlightBench) -> None:
        """Stop it."""
        bench.suspend(self.process)

    def end(self, bench: FlightBench) -> None:
        """Let it run again."""
        bench.resume(self.process)


@dataclass(frozen=True)
class Stalled:
    """The executor of the landing node is busy with something else."""

    seconds: float

    def begin(self, bench: FlightBench) -> None:
        """Keep it busy."""
        bench.silence_begins()
        bench.node.stall_landing(self.seconds)

    def end(self, bench: FlightBench) -> None:
        """It ends by itself."""
        bench.silence_ends()


@dataclass(frozen=True)
class Defect:
    """A thread of the landing node raises an exception; the node ends, and is started again."""

    thread: str
    """See :mod:`peace_ros.lab.faults.landing`."""
    engages: bool = False
    """A person engages, by which the thread begins."""
    stalls_s: float = 0.0
    """The executor is busy for so long, by which the dead-man's thread begins."""

    def begin(self, bench: FlightBench) -> None:
        """Break the thread."""
        bench.silence_begins()
        bench.node.break_landing(self.thread)
        if self.engages or self.stalls_s:
            time.sleep(_HEARD_S)
        if self.engages:
            bench.node.engage_without_waiting()
        if self.stalls_s:
            bench.node.stall_landing(self.stalls_s)

    def end(self, bench: FlightBench) -> None:
        """Start the node again."""
        bench.restore('landing')


@dataclass(frozen=True)
class BadModel:
    """The segmentation model fails; ``revive`` starts a node again that ended by it."""

    fault: str
    revive: bool = False

    def begin(self, bench: FlightBench) -> None:
        """Tell the model to fail."""
        bench.node.fail_model(self.fault)

    def end(self, bench: FlightBench) -> None:
        """Tell it to work."""
        if self.revive:
            bench.restore('segmentation')
        else:
            bench.node.fail_model('')


@dataclass(frozen=True)
class BadBundle:
    """The segmentation node is started with a damaged bundle."""

    honest: bool
    """The manifest has the checksum of the changed file: the damage shows only in numbers."""

    def begin(self, bench: FlightBench) -> None:
        """Start the node with the damaged copy."""
        copy = damaged_bundle(bench.folder / f'bundle-{time.monotonic_ns()}', honest=self.honest)
        bench.start('segmentation', bundle=str(copy))

    def end(self, bench: FlightBench) -> None:
        """Start it with its own."""
        bench.restore('segmentation')


def damaged_bundle(folder: Path, *, honest: bool) -> Path:
    """Copy the shipped CLIPSeg bundle and overwrite weights with NaN."""
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


@dataclass(frozen=True)
class ClockStep:
    """``/clock`` and with it the stamps of the camera step, and stay so."""

    seconds: float

    def begin(self, bench: FlightBench) -> None:
        """Step."""
        bench.node.clock_step_ns += round(self.seconds * 1e9)

    def end(self, bench: FlightBench) -> None:
        """The clock continues from where it is."""


@dataclass
class SecondCompanion:
    """Somebody else commands the same autopilot."""

    message: str
    """A key of ``_MESSAGES``."""
    rate_hz: float
    """0: sends one message."""
    _stranger: Stranger | None = None

    def begin(self, bench: FlightBench) -> None:
        """Begin to send."""
        self._stranger = Stranger(bench.autopilot_port)
        make = _MESSAGES[self.message]
        if self.rate_hz > 0.0:
            self._stranger.stream(make, self.rate_hz)
        else:
            self._stranger.send(make())

    def end(self, _bench: FlightBench) -> None:
        """Stop sending."""
        if self._stranger is not None:
            self._stranger.close()
        self._stranger = None


@dataclass
class ForgedTelemetry:
    """Somebody sends the companion a position in the name of the autopilot."""

    from_elsewhere: bool = True
    """From another address than the autopilot's."""
    rate_hz: float = 30.0
    _stop: list[Callable[[], None]] = field(default_factory=list)

    def begin(self, bench: FlightBench) -> None:
        """Begin to send."""
        stop = threading.Event()
        data = _forged_position()

        def run() -> None:
            while not stop.wait(1.0 / self.rate_hz):
                bench.line.tell_companion(data, from_elsewhere=self.from_elsewhere)

        thread = threading.Thread(target=run, name='forger', daemon=True)
        thread.start()
        self._stop.append(stop.set)

    def end(self, _bench: FlightBench) -> None:
        """Fall silent."""
        while self._stop:
            self._stop.pop()()


@dataclass
class Person:
    """A person walks to the place that the landing has chosen and stays there."""

    seen: bool
    """The heatmap shows the person whatever the model makes of the picture."""
    from_m: tuple[float, float] = (4.0, 3.0)
    """North and east of that place."""
    speed_m_s: float = 1.4
    walker: Walker | None = None

    def begin(self, bench: FlightBench) -> None:
        """Let the person come."""
        pose = bench.node.newest_pose()
        if pose is None:
            raise VehicleError('the ground truth has not been heard: nobody can walk under it')
        here = bench.node.site() or (pose.north_m, pose.east_m)
        start = (here[0] + self.from_m[0], here[1] + self.from_m[1])
        self.walker = Walker(pose.stamp_ns, start, here, self.speed_m_s)
        view: Camera = CameraOptions().camera
        if self.seen:
            bench.node.tamper(
                HEATMAP, tamper.with_walker_seen(self.walker, view, bench.node.pose_at)
            )
        else:
            bench.node.tamper(IMAGE, tamper.with_walker(self.walker, view, bench.node.pose_at))

    def end(self, bench: FlightBench) -> None:
        """The person stays until the flight is over."""


@dataclass(frozen=True)
class FullDisk:
    """A recorder's disk is full after some bytes."""

    limit_bytes: int = 200_000

    def begin(self, bench: FlightBench) -> None:
        """Start recording."""
        bench.start_recorder(self.limit_bytes)

    def end(self, bench: FlightBench) -> None:
        """The recorder has ended."""
        bench.stop('recorder')


@dataclass(frozen=True)
class Together:
    """Several things at once."""

    parts: tuple[Any, ...]

    def begin(self, bench: FlightBench) -> None:
        """Begin all."""
        for each in self.parts:
            each.begin(bench)

    def end(self, bench: FlightBench) -> None:
        """End all, the last first."""
        for each in reversed(self.parts):
            each.end(bench)


def _loiter() -> Any:
    return mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def _descend() -> Any:
    velocity_only = 0x5C7
    return mavlink.MAVLink_set_position_target_local_ned_message(
        *(0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, velocity_only),
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, 2.0),
        *(0.0, 0.0, 0.0, 0.0, 0.0),
    )


def _forged_position() -> bytes:
    codec = mavlink.MAVLink(None, 1, mavlink.MAV_COMP_ID_AUTOPILOT1)
    message = mavlink.MAVLink_local_position_ned_message(1_000_000, 0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
    return bytes(message.pack(codec))


_MESSAGES: dict[str, Callable[[], Any]] = {'loiter': _loiter, 'descend': _descend}


def injection(given: dict[str, Any]) -> Injection:
    """Return the injection that ``config/faults.yaml`` names as ``{kind: arguments}``.

    Raises:
        ConfigurationError: the kind or its tamper is unknown.
    """
    ((kind, arguments),) = given.items()
    if kind not in _KINDS:
        raise ConfigurationError(f'injection {kind!r}: choose one of {", ".join(_KINDS)}')
    made: Injection = _call(_KINDS[kind], arguments)
    return made


def _call(make: Callable[..., Any], arguments: Any) -> Any:
    """Call with the arguments of a mapping, of a list, or with one."""
    if isinstance(arguments, dict):
        return make(**arguments)
    return make(*arguments) if isinstance(arguments, list) else make(arguments)


def _tamper(name: str = '', **given: Any) -> Callable[[], Tamper]:
    """Return the factory of a tamper: ``name``, or ``{name: arguments}``."""
    ((name, arguments),) = given.items() if given else ((name, []),)
    if name not in TAMPERS:
        raise ConfigurationError(f'tamper {name!r}: choose one of {", ".join(TAMPERS)}')
    return lambda: cast('Tamper', _call(TAMPERS[name], arguments))


def _topic(name: str) -> Callable[..., Topic]:
    return lambda *given, **named: Topic(name, _tamper(*given, **named))


def _line(*, up: bool, down: bool) -> Callable[..., DisturbedLine]:
    def make(*given: str, **named: Any) -> DisturbedLine:
        tamper = _tamper(*given, **named)
        return DisturbedLine(tamper if up else None, tamper if down else None)

    return make


_KINDS: dict[str, Callable[..., Injection]] = {
    'camera': _topic(IMAGE),
    'heatmap': _topic(HEATMAP),
    'prompt': _topic(PROMPT),
    'autopilot': Autopilot,
    'line': _line(up=True, down=True),
    'line_up': _line(up=True, down=False),
    'line_down': _line(up=False, down=True),
    'second_companion': SecondCompanion,
    'forged_telemetry': ForgedTelemetry,
    'kill': Killed,
    'suspend': Suspended,
    'stall': Stalled,
    'defect': Defect,
    'model': BadModel,
    'bundle': BadBundle,
    'clock_step': ClockStep,
    'person': Person,
    'full_disk': FullDisk,
    'together': lambda *parts: Together(tuple(injection(each) for each in parts)),
}
TAMPERS: dict[str, Callable[..., Tamper]] = {**tamper.TAMPERS, **line.TAMPERS}

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One flight of the real processes that faults can be put into, one after the other."""

from __future__ import annotations

import secrets
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from peace_ros.core.domain import VehicleError
from peace_ros.core.presets import load_preset
from peace_ros.lab.faults.fault import FlightSetting
from peace_ros.lab.faults.line import RelayedLine
from peace_ros.lab.faults.node import HEATMAP, IMAGE, PROMPT, RAW, BenchNode
from peace_ros.lab.faults.record import Ended
from peace_ros.lab.faults.worlds import FaultWorld
from peace_ros.simulation.autopilot.faults import Answer, FaultClient
from peace_ros.simulation.demo.isolation import free_udp_port
from peace_ros.simulation.demo.nodes import ros_arguments
from peace_ros.simulation.demo.processes import ProcessGroup, log_tail

CAMERA_HZ = 6.0
START_M = 50.0
"""Altitude at which every flight begins: the safe altitude of the defaults."""
_READY_S = 60.0
ENGAGE_S = 20.0
_LOOK_S = 0.02
_READY_HEATMAPS = 2
_GRACE_S = 6.0
"""A restarted node may be silent for this long."""
MODULES = {
    'autopilot_sim': 'peace_ros.lab.faults.autopilot',
    'satellite_view': 'peace_ros.simulation.nodes.satellite_view',
    'prompt_generator': 'peace_ros.nodes.prompt_generator',
    'segmentation': 'peace_ros.lab.faults.segmentation',
    'landing': 'peace_ros.lab.faults.landing',
    'recorder': 'peace_ros.lab.faults.recorder',
}


@dataclass
class _Silence:
    begin_s: float
    resumed_s: float | None = None


@dataclass
class Losses:
    """What ended, and when the landing node was meant to be silent; steady clock."""

    ended: list[Ended] = field(default_factory=list)
    silences: list[_Silence] = field(default_factory=list)

    def spans(self, said_s: list[float], now_s: float) -> list[tuple[float, float]]:
        """Return the silences; one lasts until the first word after it, with a limit."""
        found = []
        for each in self.silences:
            end_s = now_s
            if each.resumed_s is not None:
                words = [at_s for at_s in said_s if at_s >= each.resumed_s]
                end_s = min(words[0] if words else now_s, each.resumed_s + _GRACE_S)
            found.append((each.begin_s, end_s))
        return found


class FlightBench:
    """Processes, relays and ground truth of one setting.

    Args:
        setting: What the faults of this bench have in common.
        ground: Its world.
        folder: Where logs go.
        node: The relay; it outlives the bench.
    """

    def __init__(
        self, setting: FlightSetting, ground: FaultWorld, folder: Path, node: BenchNode
    ) -> None:
        self.setting = setting
        self.ground = ground
        self.folder = folder
        self.node = node
        self.losses = Losses()
        self.autopilot_port = free_udp_port()
        self._fault_port = free_udp_port()
        self.autopilot = FaultClient(self._fault_port)
        self.line = RelayedLine(self.autopilot_port)
        self.processes = ProcessGroup(folder)
        self._wanted: set[str] = set()
        self._reported: set[str] = set()

    def close(self) -> None:
        """Stop everything."""
        self.processes.stop_all()
        self.line.close()
        self.autopilot.close()

    # --- processes

    def open(self) -> None:
        """Start everything but the landing node, and wait until heatmaps flow.

        Raises:
            PeaceError: a process ends, or nothing comes.
        """
        self.node.forget()
        for name in ('autopilot_sim', 'satellite_view', 'segmentation'):
            self.start(name)
        if self.setting.prompts:
            self.start('prompt_generator')
        self.put_vehicle()
        self.wait(lambda: self.node.heatmaps >= _READY_HEATMAPS, 'heatmaps', _READY_S)

    def start(self, name: str, **given: object) -> None:
        """Start a process, in place of one of that name."""
        self.processes.stop(name)
        self._wanted.add(name)
        self._reported.discard(name)
        self.processes.start(name, MODULES[name], self._arguments(name, given))

    def start_recorder(self, limit_bytes: int) -> None:
        """Record all topics until the disk is full after so many bytes."""
        self.processes.stop('recorder')
        self._wanted.add('recorder')
        self._reported.discard('recorder')
        path = self.folder / f'recorded-{time.monotonic_ns()}.mcap'
        self.processes.start('recorder', MODULES['recorder'], [str(path), str(limit_bytes)])

    def kill(self, name: str) -> None:
        """End a process with SIGKILL, as the kernel does when memory runs out."""
        self._wanted.discard(name)
        if name == 'landing':
            self.silence_begins()
        self.processes.send(name, signal.SIGKILL)
        self.losses.ended.append(Ended(time.monotonic(), name, -int(signal.SIGKILL), meant=True))

    def suspend(self, name: str) -> None:
        """Let a process stand still, as a debugger or a swap storm does."""
        if name == 'landing':
            self.silence_begins()
        self.processes.send(name, signal.SIGSTOP)

    def resume(self, name: str) -> None:
        """Let it run again."""
        self.processes.send(name, signal.SIGCONT)
        if name == 'landing':
            self.silence_ends()

    def stop(self, name: str) -> None:
        """End a process in the orderly way."""
        self._wanted.discard(name)
        self.processes.stop(name)

    def silence_begins(self) -> None:
        """From now on the landing node is expected to be silent."""
        self.losses.silences.append(_Silence(time.monotonic()))

    def silence_ends(self) -> None:
        """From now on it publishes its status again, after a moment."""
        for each in self.losses.silences:
            each.resumed_s = each.resumed_s or time.monotonic()

    def look(self) -> None:
        """Note the processes that have ended by themselves; raise a defect of the matrix."""
        self.node.check()
        for name in sorted(self._wanted - self._reported):
            status = self.processes.status(name)
            if status is not None:
                self._reported.add(name)
                words = log_tail(self.folder / f'{name}.log', 2)
                self.losses.ended.append(
                    Ended(time.monotonic(), name, status, meant=False, last_words=words.strip())
                )

    def is_whole(self) -> bool:
        """Whether everything that belongs to the bench lives."""
        names = {'autopilot_sim', 'satellite_view', 'segmentation'}
        names |= {'prompt_generator'} if self.setting.prompts else set()
        pids = self.processes.pids
        return all(name in pids and self.processes.status(name) is None for name in names)

    # --- a flight

    def reset(self) -> None:
        """Make everything good again: a fresh landing node, the vehicle at the start.

        Raises:
            PeaceError: it does not become good.
        """
        self.stop('landing')
        self.stop('recorder')
        self.line.mend()
        self.line.forget()
        self.node.forget()
        self.node.fail_model('')
        self.losses = Losses()
        self.put_vehicle()
        self.start('landing')
        self.wait(lambda: bool(self.node.said), 'landing/status', _READY_S)
        self.wait(lambda: self.node.heatmaps >= _READY_HEATMAPS, 'heatmaps', _READY_S)

    def put_vehicle(self, north_m: float = 0.0, east_m: float = 0.0) -> None:
        """Let the vehicle stand in the air, where flights begin or so far beside it."""
        north_m, east_m = self.ground.begin_m[0] + north_m, self.ground.begin_m[1] + east_m
        deadline = time.monotonic() + _READY_S
        while True:
            try:
                self.autopilot.inject('place', north_m=north_m, east_m=east_m, altitude_m=START_M)
            except VehicleError:
                if time.monotonic() > deadline or self.processes.status('autopilot_sim'):
                    raise
                continue
            return

    def watch(self, limit_s: float, holds: Callable[[], bool] = lambda: False) -> bool:
        """Note what ends until something holds, but for so long at most; tell whether it holds."""
        deadline = time.monotonic() + limit_s
        while not (there := holds()) and time.monotonic() < deadline:
            self.look()
            with self.node.lock:
                self.node.lock.wait(_LOOK_S)
        return there

    def wait(self, holds: Callable[[], bool], what: str, limit_s: float) -> None:
        """Wait for something that an undisturbed flight needs.

        Raises:
            VehicleError: it does not come in time, or a process ends.
        """
        ended = self.losses.ended
        if not self.watch(limit_s, lambda: holds() or bool(ended)):
            raise VehicleError(f'{what} did not come within {limit_s:g} s: see {self.folder}')
        if ended:
            last = ended[-1]
            raise VehicleError(
                f'{last.name} ended by itself with status {last.status}: {last.last_words}'
            )

    def ask_autopilot(self, fault: str, arguments: Mapping[str, object]) -> Answer:
        """Put a fault into the autopilot."""
        return self.autopilot.inject(fault, **arguments)

    def state(self) -> str:
        """Return the newest state of the landing, empty before the first."""
        with self.node.lock:
            return self.node.said[-1].state if self.node.said else ''

    def restore(self, name: str) -> None:
        """Start a process again that was killed."""
        self.start(name)
        if name == 'landing':
            self.silence_ends()
        if name == 'autopilot_sim':
            self.put_vehicle()

    # --- command lines

    def _arguments(self, name: str, given: Mapping[str, object]) -> list[str]:
        clock: dict[str, object] = {'use_sim_time': self.setting.sim_time}
        preset = load_preset('peace_cs' if self.setting.prompts else 'dd_cs').path
        remaps: dict[str, str] = {}
        parameters: dict[str, object] = {}
        if name == 'autopilot_sim':
            parameters = {'port': self.autopilot_port, 'fault_port': self._fault_port}
            parameters.update(publish_clock=self.setting.sim_time, ground_station='')
            parameters['autopilot'] = self.setting.autopilot
            parameters.update(self._key(''))
            clock, remaps = {}, {'/clock': '/' + RAW + 'clock'}
        elif name == 'satellite_view':
            parameters, remaps = self._camera(), {IMAGE: RAW + IMAGE}
        elif name == 'segmentation':
            parameters, remaps = {'threads': 1}, {HEATMAP: RAW + HEATMAP}
        elif name == 'prompt_generator':
            parameters, remaps = {'threads': 1}, {PROMPT: RAW + PROMPT}
        elif name == 'landing':
            parameters = {'mavlink': f'udpout:127.0.0.1:{self.line.port}'}
            parameters['vehicle.after_handover'] = self.setting.after_handover
            parameters.update(self._key('vehicle.'))
        reads_preset = name in {'segmentation', 'prompt_generator', 'landing'}
        return ros_arguments(
            {**clock, **parameters, **given}, preset if reads_preset else None, remaps
        )

    def _key(self, group: str) -> dict[str, object]:
        """Return the parameter that names the key of the line, none where it is open."""
        if not self.setting.signed:
            return {}
        file = self.folder / 'signing.key'
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.is_file():
            file.write_bytes(secrets.token_bytes(32))
        return {f'{group}signing_key_file': str(file)}

    def _camera(self) -> dict[str, object]:
        ground = self.ground
        return {
            'world': str(ground.image_file),
            'gsd': float(ground.world.gsd_m),
            'labels': str(ground.label_file),
            'start_x': ground.origin_east_m,
            'start_y': ground.origin_north_m,
            'rate': CAMERA_HZ,
        }

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One demo from its options to its run folder."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from peace_ros.core.domain import PeaceError, VehicleError
from peace_ros.core.landing import LandingParameters
from peace_ros.core.presets import Preset, load_preset
from peace_ros.recording import BagWriter
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.history import Status
from peace_ros.simulation.demo.isolation import free_udp_port, isolate
from peace_ros.simulation.demo.monitor import HEATMAP, IMAGE, STATUS, Monitor
from peace_ros.simulation.demo.nodes import MODULES, Wiring, node_arguments
from peace_ros.simulation.demo.options import DemoOptions
from peace_ros.simulation.demo.page import live_page
from peace_ros.simulation.demo.piloting import VehicleLine
from peace_ros.simulation.demo.processes import ProcessGroup
from peace_ros.simulation.demo.progress import Progress, Snapshot
from peace_ros.simulation.demo.report import draw_pictures, headline, summary_table
from peace_ros.simulation.demo.signals import interruptible
from peace_ros.simulation.demo.summary import Ending, Setting, Summary, Truth, summarise
from peace_ros.simulation.demo.worlds import DemoWorld, prepare_world
from peace_ros.simulation.positions import SILENT_S

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130
START_ALTITUDE_M = 100.0
FAST, SLOW = 2.0, 1.0
LEAST_HEATMAP_HZ = 2.0
"""Heatmaps per simulated second with which the faster speed is kept."""
_READY_S = 90.0
_STRANGER_READY_S = 300.0
"""A given autopilot boots for 42 s of its own clock, which may run slower than ours."""
_MEASURE_S = 4.0
_READY_HEATMAPS = 3
_TAIL_S = 1.5
"""Recording goes on for this long after the outcome."""
_POLL_S = 0.05
_ENGAGE_S = 30.0


class _TooSlow(Exception):  # noqa: N818 - no error: the demo begins again, slower
    """The machine does not keep up with the chosen speed."""

    def __init__(self, heatmap_hz: float) -> None:
        super().__init__(f'{heatmap_hz:.1f} heatmaps per simulated second')


@dataclass
class _Run:
    """What belongs to one attempt."""

    options: DemoOptions
    run_dir: Path
    preset: Preset
    world: DemoWorld
    speed: float
    console: Console
    phase: str = 'starting'
    ending: Ending | None = None
    interrupted: bool = False
    measures_speed: bool = False
    wiring: Wiring = field(init=False)

    def __post_init__(self) -> None:
        port = free_udp_port() if self.options.own_autopilot else None
        self.wiring = Wiring(
            world=self.world,
            camera=self.options.camera_options,
            lens=self.options.lens,
            preset=self.preset.path,
            recordings=self.run_dir / 'recordings',
            speed=self.speed,
            mavlink=self.options.mavlink or f'udpout:127.0.0.1:{port}',
            pose_mavlink=self.options.pose_mavlink,
            autopilot_port=port,
            autopilot=self.options.autopilot or 'ardupilot',
        )

    @property
    def ready_s(self) -> float:
        """How long the vehicle and its camera may take to be there."""
        return _READY_S if self.options.own_autopilot else _STRANGER_READY_S


def run_demo(options: DemoOptions, console: Console) -> int:
    """Run a demo; return the exit status: 0 only for a hand-over that the ground truth allows.

    Raises:
        PeaceError: what was asked for cannot be started at all.
    """
    preset = load_preset(options.config)
    landing = preset.fill('landing', LandingParameters)
    run_dir = options.new_run_dir()
    with interruptible():
        domain = isolate(run_dir / 'logs' / 'ros')
        with console.status('preparing the world'):
            world = prepare_world(options, run_dir)
        eye = NadirCamera(world.world, options.camera, options.camera_options.mount)
        truth = Truth(eye, landing.safety_radius_m)
        console.print(f'world: {world.note}', highlight=False)
        console.print(
            f'start {world.start_east_m:g},{world.start_north_m:g} m east, north of its centre; '
            f'ROS domain {domain}',
            highlight=False,
        )
        with live_page(run_dir, console) if options.watch else nullcontext():
            run, monitor = _attempts(options, run_dir, preset, world, console)
        ending = run.ending or Ending('error', 'nothing happened', None)
        setting = Setting(
            seed=options.seed,
            config=preset.name,
            speed=run.speed,
            world=str(options.world) if options.world else world.world.name,
            handover_altitude_m=landing.handover_altitude_m,
        )
        summary = summarise(monitor.history, ending, setting, truth)
        _finish(monitor, summary, truth, run_dir, console)
    if run.interrupted:
        return EXIT_INTERRUPTED
    return EXIT_OK if summary.succeeded else EXIT_FAILED


def _attempts(
    options: DemoOptions, run_dir: Path, preset: Preset, world: DemoWorld, console: Console
) -> tuple[_Run, Monitor]:
    """Run at the given speed, or at the fastest one that the machine keeps up with."""
    if options.speed is not None or not options.own_autopilot:
        run = _Run(options, run_dir, preset, world, options.speed or SLOW, console)
        return run, _attempt(run)
    try:
        run = _Run(options, run_dir, preset, world, FAST, console, measures_speed=True)
        return run, _attempt(run)
    except _TooSlow as slow:
        console.print(f'{slow} at speed {FAST:g}: beginning again at speed {SLOW:g}')
        run = _Run(options, run_dir, preset, world, SLOW, console)
        return run, _attempt(run)


def _attempt(run: _Run) -> Monitor:
    """Start everything, fly, stop everything; the outcome is in ``run.ending``."""
    with BagWriter(run.run_dir / 'topics.mcap') as writer:
        monitor = Monitor(writer, use_sim_time=run.wiring.use_sim_time)
        try:
            with (
                ProcessGroup(run.run_dir / 'logs') as group,
                Progress(run.console, lambda: _snapshot(run, monitor), 'peace demo'),
            ):
                try:
                    run.ending = _fly(run, monitor, group)
                except PeaceError as error:
                    run.ending = Ending('error', str(error), _newest_ns(monitor))
                except KeyboardInterrupt:
                    run.interrupted = True
                    run.ending = Ending('aborted', 'interrupted by the user', _newest_ns(monitor))
                run.phase = 'stopping'
        finally:
            monitor.close()
    return monitor


def _fly(run: _Run, monitor: Monitor, group: ProcessGroup) -> Ending:
    def say(text: str) -> None:
        run.phase = f'pilot: {text}'

    arguments = node_arguments(run.wiring)
    landing = arguments.pop('landing')
    for name, given in arguments.items():
        group.start(name, MODULES[name], given, may_end=name == 'recorder')
    if run.options.own_autopilot:
        # Our own autopilot talks to any number of peers; a given one may know only one URL,
        # which the pilot must have left before the landing node can use it.
        group.start('landing', MODULES['landing'], landing)
    with VehicleLine(run.wiring.mavlink) as line:
        # Before the camera: ArduPilot's own simulation boots when its first port has a client,
        # and opens the others only then.
        run.phase = f'waiting for the autopilot at {run.wiring.mavlink}'
        _beside(monitor, group, line.open)
        run.phase = 'waiting for the camera and the networks'
        begin_s = time.monotonic()

        def sees() -> bool:
            images, heatmaps = monitor.heard(IMAGE), monitor.heard(HEATMAP)
            run.phase = awaited(images, time.monotonic() - begin_s, line.problem)
            return heatmaps >= _READY_HEATMAPS and images > 0

        _wait(run, monitor, group, sees, 'image and heatmap')
        if run.measures_speed:
            _measure_speed(run, monitor, group)
        _beside(monitor, group, lambda: line.bring_up(START_ALTITUDE_M, run.ready_s, say))
    if not run.options.own_autopilot:
        group.start('landing', MODULES['landing'], landing)
    run.phase = 'engaging the landing node'
    status = monitor.heard(STATUS)
    _wait(run, monitor, group, lambda: monitor.heard(STATUS) > status, 'landing/status')
    _beside(monitor, group, lambda: monitor.engage(_ENGAGE_S))
    run.phase = 'flown by the landing node'
    return _follow(run, monitor, group)


def awaited(images: int, waited_s: float, problem: str) -> str:
    """Return what a demo waits for before the vehicle is brought up.

    Args:
        images: Pictures of the camera so far.
        waited_s: Since the autopilot was reached.
        problem: Why the autopilot reports no position, empty when it does.
    """
    if images > 0:
        return 'waiting for the networks'
    if waited_s < SILENT_S:
        return 'waiting for the camera and the networks'
    return f'waiting for the camera: {problem or "its first picture has not come"}'


def _measure_speed(run: _Run, monitor: Monitor, group: ProcessGroup) -> None:
    """Raise _TooSlow when heatmaps come too rarely for the simulated clock."""
    run.phase = 'measuring what this machine can do'
    begin = monitor.heard(HEATMAP)
    deadline = time.monotonic() + _MEASURE_S
    while time.monotonic() < deadline:
        group.check()
        monitor.check()
        time.sleep(_POLL_S)
    heatmap_hz = (monitor.heard(HEATMAP) - begin) / _MEASURE_S / run.speed
    if heatmap_hz < LEAST_HEATMAP_HZ:
        raise _TooSlow(heatmap_hz)


def _follow(run: _Run, monitor: Monitor, group: ProcessGroup) -> Ending:
    """Wait for the outcome of the landing node, but not longer than the limit."""
    deadline = time.monotonic() + run.options.timeout_s
    while time.monotonic() < deadline:
        group.check()
        monitor.check()
        with monitor.lock:
            status = monitor.history.status
        outcome = status.values.get('outcome', '') if status is not None else ''
        if status is not None and outcome:
            run.phase = f'{outcome}: recording a moment longer'
            time.sleep(_TAIL_S)
            return Ending(outcome, status.values.get('reason', status.sentence), status.stamp_ns)
        time.sleep(_POLL_S)
    reason = f'no outcome within {run.options.timeout_s:g} s'
    return Ending('timeout', reason, _newest_ns(monitor))


def _wait(
    run: _Run,
    monitor: Monitor,
    group: ProcessGroup,
    holds: Callable[[], bool],
    what: str,
) -> None:
    deadline = time.monotonic() + run.ready_s
    while not holds():
        group.check()
        monitor.check()
        if time.monotonic() > deadline:
            raise VehicleError(
                f'{what} did not come within {run.ready_s:g} s ({run.phase}): see '
                f'{run.run_dir / "logs"}'
            )
        time.sleep(_POLL_S)


def _beside(monitor: Monitor, group: ProcessGroup, work: Callable[[], None]) -> None:
    """Do work that blocks while watching the processes; raise what either raises."""
    failure: list[Exception] = []

    def run() -> None:
        try:
            work()
        except Exception as error:
            failure.append(error)

    thread = threading.Thread(target=run, name='pilot', daemon=True)
    thread.start()
    while thread.is_alive():
        group.check()
        monitor.check()
        thread.join(_POLL_S)
    if failure:
        raise failure[0]


def _newest_ns(monitor: Monitor) -> int | None:
    with monitor.lock:
        poses = monitor.history.poses
        return poses[-1].stamp_ns if poses else None


def _snapshot(run: _Run, monitor: Monitor) -> Snapshot:
    with monitor.lock:
        history = monitor.history
        status = history.status
        altitude_m = history.poses[-1].altitude_agl_m if history.poses else None
        heatmap_hz = history.heatmap_hz()
        count = len(history.heatmap_stamps_ns)
        prompt = history.prompt
    site = ''
    if status is not None:
        clearance_m = status.number('site_clearance_m')
        north_m, east_m = status.number('site_north_m'), status.number('site_east_m')
        if clearance_m is not None and north_m is not None and east_m is not None:
            site = f'{north_m:+.0f} m north, {east_m:+.0f} m east, {clearance_m:.1f} m clear'
    return Snapshot(
        phase=run.phase,
        state=status.state if status is not None else '',
        reason=status.values.get('reason', '') if status is not None else '',
        altitude_agl_m=altitude_m,
        prompt=prompt,
        site=site,
        link='' if status is None else _link(status),
        rates=f'{count} heatmaps, {heatmap_hz:.1f}/s, speed {run.speed:g}' if count else '',
    )


def _link(status: Status) -> str:
    """Return what is known of the autopilot: mode, who is in control, and the age of its data."""
    obeys = {'true': 'follows us', 'false': 'does not follow us'}.get(
        status.values.get('in_control', ''), 'control not known'
    )
    age_s = status.number('telemetry_age_s')
    age = 'nothing heard yet' if age_s is None else f'{age_s:.1f} s old'
    return ', '.join(filter(None, (status.values.get('mode', ''), obeys, age)))


def _finish(
    monitor: Monitor, summary: Summary, truth: Truth, run_dir: Path, console: Console
) -> None:
    summary.write(run_dir / 'summary.json')
    with console.status('drawing the pictures'):
        draw_pictures(monitor.history, summary, truth, run_dir)
    console.print(headline(summary))
    console.print(summary_table(summary, run_dir))

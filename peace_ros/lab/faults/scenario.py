# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One fault from the engagement to the record that the judge gets."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

from peace_ros.core.domain import PeaceError
from peace_ros.core.landing import LandingParameters, State
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.lab.faults.bench import ENGAGE_S, FlightBench
from peace_ros.lab.faults.fault import ABSENT, LEAD_BELOW_M, Fault, Moment
from peace_ros.lab.faults.record import (
    STANDING_M_S,
    Ended,
    Record,
    Said,
    Sent,
    TruthSample,
    longest_gap_s,
)
from peace_ros.lab.faults.walker import Walker
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.truth import judge as judge_ground

_MOMENT_S = 90.0
"""How long the landing may take to come to the moment of the injection."""
_MOVING_M_S = 0.7
_AFTER_S = 1.0
"""The observation goes on for this long after the recovery."""
_STAY_S = 3.0
_PAUSE_S = 0.3
"""The relay runs every 10 ms and the vehicle publishes every 20 ms: a machine that lets one of
them wait for so long is too slow for limits of some tenths of a second."""
_WAITING = 4.0
"""Processes that want to run per core, over the last minute; two flights at a time make two to
three. With more, a process that starts again takes seconds longer."""
_HEATMAP_S = 1.0
"""The networks give six heatmaps per second: the limits need one in this time at least."""

_Event = TypeVar('_Event', Said, TruthSample, Sent, Ended)


@dataclass
class Scenario:
    """Runs one fault on a bench."""

    bench: FlightBench
    fault: Fault
    engaged_s: float = 0.0
    """All in seconds of the steady clock."""
    injected_s: float = 0.0
    record: Record = field(default_factory=Record)
    gaps_s: list[float] = field(default_factory=list)
    """Between set-points on the wire, from the engagement to the injection."""

    def run(self) -> Record:
        """Fly, inject, watch; what goes wrong with the flight itself is in ``record.trouble``."""
        try:
            self.bench.reset()
            self._fly()
        except PeaceError as error:
            self.record.trouble = f'{type(error).__name__}: {error}'
            if not self.injected_s:
                self.injected_s = time.monotonic()
        self._close()
        return self.record

    def _fly(self) -> None:
        if self.fault.at.state == State.IDLE.value:
            self._inject()
            self._watch_refusal()
        else:
            self.bench.node.engage(ENGAGE_S)
            self.engaged_s = time.monotonic()
            if self.fault.lead is not None:
                self._await_moment(Moment(below_m=LEAD_BELOW_M))
                self.fault.lead.begin(self.bench)
            self._await_moment(self.fault.at)
            self.bench.watch(self.fault.at.after_s)
            self._inject()
            self._watch_fault()
        if self.fault.lead is not None:
            self.fault.lead.end()
        self.fault.injection.end()
        self.record.ended_s = time.monotonic() - self.injected_s
        self._watch_recovery()

    def _await_moment(self, at: Moment) -> None:
        self.bench.wait(lambda: self._is_moment(at.state, at.below_m), f'a landing {at}', _MOMENT_S)

    def _is_moment(self, state: str, below_m: float) -> bool:
        if self.bench.state() != state:
            return False
        with self.bench.node.lock:
            truths = self.bench.node.truths[-30:]
        if len(truths) < 2 or truths[-1].altitude_agl_m > below_m:
            return False
        span_s = truths[-1].at_s - truths[0].at_s
        sunk_m = truths[0].altitude_agl_m - truths[-1].altitude_agl_m
        # A descent that has not begun yet could not be stopped by anything.
        return state != State.LANDING.value or sunk_m > _MOVING_M_S * span_s

    def _inject(self) -> None:
        bench, record = self.bench, self.record
        record.state_before = bench.state()
        pose = bench.node.newest_pose()
        if pose is not None:
            record.altitude_before_m = pose.altitude_agl_m
        self.injected_s = time.monotonic()
        record.injected_s = self.injected_s - (self.engaged_s or self.injected_s)
        sent = bench.line.sent_since(self.engaged_s)
        self.gaps_s = [b.at_s - a.at_s for a, b in pairwise(sent)]
        self.fault.injection.begin(bench)

    def _watch_refusal(self) -> None:
        """The fault is there before the engagement: ask once, and take the answer."""
        self.bench.watch(self.fault.lasts_s)
        answer = self.bench.node.ask_to_engage()
        self.record.refusal = answer or None

    def _watch_fault(self) -> None:
        fault = self.fault
        limit_s = self.injected_s + fault.lasts_s - time.monotonic()
        states = fault.expected.reaches if fault.until_reached else ()
        if self.bench.watch(limit_s, lambda: self._has_reached(states, self.injected_s)):
            self.bench.watch(_AFTER_S)

    def _watch_recovery(self) -> None:
        expected = self.fault.expected
        begin_s = time.monotonic()
        wait_s = expected.recovers_within_s if expected.recovers else 0.0
        self.bench.watch(wait_s + _AFTER_S, lambda: self._has_reached(expected.recovers, begin_s))
        self.bench.watch(_STAY_S if expected.stays else _AFTER_S)

    def _has_reached(self, states: tuple[str, ...], since_s: float) -> bool:
        wanted = [state for state in states if state != ABSENT]
        with self.bench.node.lock:
            return any(s.state in wanted for s in self.bench.node.said if s.at_s >= since_s)

    def _close(self) -> None:
        """Bring everything that was seen onto the clock of the record."""
        bench, record, zero_s = self.bench, self.record, self.injected_s

        def shifted(events: list[_Event], begin_s: float) -> list[_Event]:
            return [replace(e, at_s=e.at_s - zero_s) for e in events if e.at_s >= begin_s]

        now_s = time.monotonic()
        record.closed_s = now_s - zero_s
        with bench.node.lock:
            said = list(bench.node.said)
            record.truths = shifted(bench.node.truths, zero_s)
        record.said = shifted(said, self.engaged_s)
        record.sent = shifted(bench.line.sent_since(zero_s), zero_s)
        record.ended = shifted(bench.losses.ended, 0.0)
        record.slow = self._slowness()
        record.stopped_s = [
            (a - zero_s, b - zero_s) for a, b in bench.losses.spans([s.at_s for s in said], now_s)
        ]
        aborted = record.first((State.ABORTED.value,))
        if aborted is not None:
            record.lost_control_s = aborted.at_s
        walker = self.fault.injection.walker
        self._judge_handovers(walker)
        if walker is not None:
            self._watch_person(walker)

    def _slowness(self) -> str:
        """Return what shows that the machine was too slow for the limits, empty when nothing."""
        node, zero_s, end_s = self.bench.node, self.injected_s, time.monotonic()
        with node.lock:
            turns_s, heatmaps_s = list(node.turns_s), list(node.heatmaps_s)
        told = []
        for what, gap_s, limit_s in (
            ('the relay stood still', longest_gap_s(turns_s, zero_s, end_s), _PAUSE_S),
            (
                'the simulated vehicle stood still',
                self.record.truth_gap_s(0.0, self.record.closed_s - _PAUSE_S),
                _PAUSE_S,
            ),
            (
                'before the fault no heatmap came',
                longest_gap_s(heatmaps_s, self.engaged_s or zero_s, zero_s),
                _HEATMAP_S,
            ),
        ):
            if gap_s > limit_s:
                told.append(f'{what} for {gap_s:.1f} s, {limit_s:g} s allowed')
        told.append(overload(os.getloadavg()[0], os.cpu_count() or 1))
        return '; '.join(filter(None, told))

    def _watch_person(self, walker: Walker) -> None:
        """Note for how long the vehicle descended with the person below."""
        radius_m = LandingParameters().safety_radius_m
        record, before_s, over_s = self.record, 0.0, 0.0
        for at_s, speed in record.descents(0.0, record.closed_s):
            pose = self.bench.node.pose_near(at_s + self.injected_s)
            beside = pose is None or walker.distance_m(pose, pose.stamp_ns) > radius_m
            if speed > STANDING_M_S and not beside:
                over_s += at_s - before_s
            before_s = at_s
        record.over_person_s = over_s

    def _judge_handovers(self, walker: Walker | None) -> None:
        record = self.record
        camera = NadirCamera(self.bench.ground.world, CameraOptions().camera)
        last = ''
        for said in record.said:
            if said.state == State.HANDOVER.value and last != said.state:
                record.handovers += 1
                why = self._unsafe(camera, walker, said.at_s)
                if why:
                    record.unsafe.append((said.at_s, why))
            last = said.state

    def _unsafe(self, camera: NadirCamera, walker: Walker | None, at_s: float) -> str:
        """Return what the truth has against a hand-over at a moment, empty when nothing."""
        return unsafe_ground(self.bench, camera, walker, at_s + self.injected_s)


def unsafe_ground(
    bench: FlightBench, camera: NadirCamera, walker: Walker | None, at_s: float
) -> str:
    """Return why the ground below the vehicle is unsafe at a moment of the steady clock."""
    pose = bench.node.pose_near(at_s)
    if pose is None:
        return 'the position of the vehicle is not known'
    radius_m = LandingParameters().safety_radius_m
    verdict = judge_ground(camera, pose, radius_m)
    if verdict.safe is False:
        return f'the ground within {radius_m:g} m is unsafe by the labels of the world'
    if walker is not None and walker.distance_m(pose, pose.stamp_ns) <= radius_m:
        return f'a person is {walker.distance_m(pose, pose.stamp_ns):.1f} m beside the point'
    return ''


def overload(load: float, cores: int) -> str:
    """Return in words that too many processes share the cores, empty when they do not.

    Args:
        load: processes that want to run, over the last minute.
        cores: of the machine.
    """
    waiting = load / cores
    if waiting <= _WAITING:
        return ''
    return f'{waiting:.1f} processes for each core, {_WAITING:g} allowed'

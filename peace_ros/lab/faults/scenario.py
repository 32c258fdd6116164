# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One fault from the engagement to the record that the judge gets."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from itertools import pairwise

from peace_ros.core.domain import PeaceError
from peace_ros.core.landing import LandingParameters, State
from peace_ros.lab.faults.bench import FlightBench
from peace_ros.lab.faults.fault import ABSENT, LEAD_BELOW_M, Fault, Moment
from peace_ros.lab.faults.record import STANDING_M_S, Record, Said, Sent
from peace_ros.lab.faults.walker import Walker
from peace_ros.nodes.options import CameraOptions
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.truth import judge as judge_ground

_LOOK_S = 0.02
_MOMENT_S = 45.0
"""How long the landing may take to come to the moment of the injection."""
_MOVING_M_S = 0.7
_AFTER_S = 1.0
"""The observation goes on for this long after the recovery, and after what stays for good."""
_STAY_S = 3.0


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
            self.bench.engage()
            self.engaged_s = time.monotonic()
            if self.fault.lead is not None:
                self._await_moment(Moment(below_m=LEAD_BELOW_M))
                self.fault.lead.begin(self.bench)
            self._await_moment(self.fault.at)
            self._inject()
            self._watch_fault()
        if self.fault.lead is not None:
            self.fault.lead.end(self.bench)
        self.fault.injection.end(self.bench)
        self.record.ended_s = time.monotonic() - self.injected_s
        self._watch_recovery()

    def _await_moment(self, at: Moment) -> None:
        deadline = time.monotonic() + _MOMENT_S
        while not self._is_moment(at.state, at.below_m):
            self.bench.look()
            if time.monotonic() > deadline or self.bench.losses.ended:
                state = self.bench.state()
                raise _NoMomentError(f'the landing never was {at}: it is in {state or "silence"}')
            time.sleep(_LOOK_S)

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
        time.sleep(self.fault.lasts_s)
        answer = self.bench.node.engage(10.0)
        self.record.refusal = answer or None

    def _watch_fault(self) -> None:
        deadline = self.injected_s + self.fault.lasts_s
        while time.monotonic() < deadline:
            self.bench.look()
            if self.fault.until_reached and self._has_reached(self.fault.expected.reaches, 0.0):
                time.sleep(_AFTER_S)
                self.bench.look()
                return
            time.sleep(_LOOK_S)

    def _watch_recovery(self) -> None:
        expected = self.fault.expected
        begin_s = time.monotonic()
        wait_s = expected.recovers_within_s if expected.recovers else 0.0
        while time.monotonic() < begin_s + wait_s + _AFTER_S:
            self.bench.look()
            if self._has_reached(expected.recovers, begin_s):
                break
            time.sleep(_LOOK_S)
        time.sleep(_STAY_S if expected.stays else _AFTER_S)
        self.bench.look()

    def _has_reached(self, states: tuple[str, ...], since_s: float) -> bool:
        wanted = [state for state in states if state != ABSENT]
        since_s = max(since_s, self.injected_s)
        with self.bench.node.lock:
            return any(s.state in wanted for s in self.bench.node.said if s.at_s >= since_s)

    def _close(self) -> None:
        """Bring everything that was seen onto the clock of the record."""
        bench, record, zero_s = self.bench, self.record, self.injected_s
        now_s = time.monotonic()
        record.closed_s = now_s - zero_s
        with bench.node.lock:
            said, truths = list(bench.node.said), list(bench.node.truths)
        record.said = [
            Said(s.at_s - zero_s, s.state, s.reason) for s in said if s.at_s >= self.engaged_s
        ]
        record.truths = [replace(t, at_s=t.at_s - zero_s) for t in truths if t.at_s >= zero_s]
        record.sent = [
            Sent(s.at_s - zero_s, s.v_north_m_s, s.v_east_m_s, s.v_down_m_s)
            for s in bench.line.sent_since(zero_s)
        ]
        record.ended = [replace(e, at_s=e.at_s - zero_s) for e in bench.losses.ended]
        record.stopped_s = [
            (a - zero_s, b - zero_s) for a, b in bench.losses.spans([s.at_s for s in said], now_s)
        ]
        aborted = record.first((State.ABORTED.value,))
        if aborted is not None:
            record.lost_control_s = aborted.at_s
        walker = getattr(self.fault.injection, 'walker', None)
        self._judge_handovers(walker)
        if walker is not None:
            self._watch_person(walker)

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


class _NoMomentError(PeaceError):
    """The landing did not come to the moment of the injection."""


def unsafe_ground(
    bench: FlightBench, camera: NadirCamera, walker: Walker | None, at_s: float
) -> str:
    """Return why the ground below the vehicle is unsafe at a moment of the steady clock."""
    pose = bench.node.pose_near(at_s)
    if pose is None:
        return 'nobody knows where the vehicle was'
    radius_m = LandingParameters().safety_radius_m
    verdict = judge_ground(camera, pose, radius_m)
    if verdict.safe is False:
        return f'the ground within {radius_m:g} m is unsafe by the labels of the world'
    if walker is not None and walker.distance_m(pose, pose.stamp_ns) <= radius_m:
        return f'a person is {walker.distance_m(pose, pose.stamp_ns):.1f} m beside the point'
    return ''

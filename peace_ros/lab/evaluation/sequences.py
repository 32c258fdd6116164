# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random sequences of steps for the helm; every decision is checked against promises.

``python -m peace_ros.lab.evaluation.sequences --sequences 100000`` runs the full number. A sequence
begins in any state with any policy; each step draws good or bad data independently of the others,
so that a sequence need not be physical: altitude jumps, the map lies, a pilot comes and goes.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, nan
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from peace_ros.core.domain import Pose, Site, Telemetry
from peace_ros.core.landing.decision import Decision, Verdict
from peace_ros.core.landing.guidance import over_site
from peace_ros.core.landing.heights import NO_OTHER_HEIGHT, HeightSight
from peace_ros.core.landing.helm import Helm
from peace_ros.core.landing.parameters import CELL_SCORE_FLOOR, LandingParameters
from peace_ros.core.landing.situation import Sighting
from peace_ros.core.landing.states import LOOKING, STILL_STATES, TRANSITIONS, State
from peace_ros.core.landing.watch import at_safe_altitude, valid_pose
from peace_ros.recording.run_folder import write_whole

LENGTH = 12
"""Moments of a sequence."""
_BLOCK = 500
_SHOWN_FAILURES = 20
_LEVEL = (1.0, 0.0, 0.0, 0.0)


class SequenceStep(NamedTuple):
    """What one step is told; each field is drawn from :data:`CHOICES`."""

    elapsed_s: float
    act: str
    """`engage`, `disengage`, or empty."""
    altitude_m: float
    north_m: float
    telemetry_age_s: float
    has_pose: bool
    in_control: bool
    armed: bool
    landed: bool
    battery: float | None
    has_site: bool
    offset_m: float
    """From the vehicle to the site, to the north."""
    clearance_m: float
    way_is_free: bool
    """What the lookout says of the way to the site, be it right or wrong."""
    ground_is_fresh: bool
    ground_score: float
    ground_age_s: float
    map_age_s: float
    heights: HeightSight
    """What other heights say of the altitude."""
    new_heatmaps: int
    site_fails: bool
    """A change of state counts as the failure of a descent."""
    fence: str
    """What a fence of the autopilot does; the vehicle then reports that it stands."""
    other_commander: str
    mode_known: bool


CHOICES: dict[str, tuple[tuple[Any, float], ...]] = {
    'elapsed_s': ((0.1, 6), (0.04, 4), (1.0, 3), (5.1, 3), (61.0, 1), (310.0, 0.3), (-2.0, 0.1)),
    'act': (('', 50), ('engage', 1), ('disengage', 0.7)),
    'altitude_m': (
        *((each, 4) for each in (20.1, 20.25, 21.0, 24.0, 35.0, 48.0, 55.0, 57.0, 80.0)),
        *((each, 1) for each in (20.0, 19.9, 15.0, 0.5, 0.0, -30.0, nan, inf, 120.0, 9000.0)),
    ),
    'north_m': ((0.0, 20), (2.0, 10), (49.0, 5), (60.0, 3), (-55.0, 2), (nan, 1)),
    'telemetry_age_s': ((0.05, 40), (0.69, 3), (0.71, 1), (5.0, 1), (inf, 0.5), (nan, 0.5)),
    'has_pose': ((True, 40), (False, 1)),
    'in_control': ((True, 40), (False, 1)),
    'armed': ((True, 60), (False, 1)),
    'landed': ((False, 60), (True, 1)),
    'battery': ((None, 10), (0.8, 10), (0.1, 0.3), (nan, 0.3)),
    'has_site': ((True, 8), (False, 1)),
    'offset_m': ((0.0, 10), (0.9, 10), (1.1, 5), (2.4, 5), (-4.0, 3), (7.0, 1), (60.0, 1)),
    'clearance_m': ((4.0, 5), (6.0, 10), (12.0, 5), (1.0, 2), (0.0, 1)),
    'way_is_free': ((True, 10), (False, 1)),
    'ground_is_fresh': ((True, 10), (False, 1)),
    'ground_score': ((0.9, 20), (0.51, 5), (0.49, 1), (0.0, 1), (nan, 0.5)),
    'ground_age_s': ((0.2, 20), (1.49, 5), (1.51, 1), (30.0, 1), (inf, 1), (nan, 0.5)),
    'map_age_s': ((0.2, 30), (1.4, 5), (1.6, 1), (2.1, 1), (60.0, 1), (inf, 1), (nan, 0.5)),
    'heights': (
        (NO_OTHER_HEIGHT, 30),
        (HeightSight(above_lowest_m=2.0), 5),
        (HeightSight(above_lowest_m=9.0, may_hand_over=False), 3),
        (HeightSight(problem='the heights disagree', may_hand_over=False), 1),
    ),
    'new_heatmaps': ((1, 5), (6, 5), (0, 3)),
    'site_fails': ((True, 1), (False, 3)),
    'fence': (('', 10), ('a fence limits the speed', 3)),
    'other_commander': (('', 60), ('a second commander', 1)),
    'mode_known': ((True, 60), (False, 1)),
}
"""Values of each field with their weights; what is good is frequent, so that sequences go deep."""

PARAMETERS = tuple(
    LandingParameters(budget_policy=policy, geofence_radius_m=fence, battery_reserve=reserve)
    for policy in ('hold', 'return', 'best_site')
    for fence, reserve in ((0.0, 0.0), (50.0, 0.2))
)


@dataclass
class SequenceReport:
    """Result of many sequences."""

    sequences: int = 0
    moments: int = 0
    descents: int = 0
    """Decisions to go down: without any, nothing was tested."""
    handovers: int = 0
    visits: Counter[str] = field(default_factory=Counter)
    """State -> moments in it."""
    transitions: Counter[str] = field(default_factory=Counter)
    """`FROM > TO` -> how often."""
    failures: list[str] = field(default_factory=list)
    """Promises that were broken, with where."""


class Trial:
    """One helm, and what it was told so far."""

    def __init__(self, parameters: LandingParameters, state: State, number: int = 0) -> None:
        self._p = parameters
        self._helm = Helm.engaged_in(parameters, state)
        self._number = number
        self._now_ns = 1_000_000_000_000
        self._revision = 0
        self._engaged_now = self._disengaged = False
        self._had_control = self._home_set = False
        self._home_north_m = 0.0

    def step(self, moment: SequenceStep, report: SequenceReport) -> Decision:
        """Give one step to the helm, and add its decision to the report."""
        self._act(moment)
        self._now_ns += round(moment.elapsed_s * 1e9)
        self._revision += moment.new_heatmaps
        told, before = self._told(moment), self._helm.state
        seen = self._seen(moment, told)
        decision = self._helm.decide(
            self._now_ns, told, moment.telemetry_age_s, seen, '', moment.heights
        )
        report.moments += 1
        report.visits[decision.state.value] += 1
        report.descents += decision.setpoint.v_down_m_s > 0.0
        transition = f'{before.value} > {decision.state.value}'
        if decision.state is not before:
            report.transitions[transition] += 1
            report.handovers += decision.state is State.HANDOVER
            if moment.site_fails and decision.state in {State.CLIMBING, State.RESTARTING}:
                self._helm.fail_attempt()
        for promise in self._broken(moment, told, seen, before, decision):
            where = f'sequence {self._number}: {transition}'
            report.failures.append(f'{promise} ({where}, {moment}, {decision.setpoint})')
        return decision

    def _act(self, moment: SequenceStep) -> None:
        self._engaged_now = moment.act == 'engage'
        if self._engaged_now:
            self._helm.engage()
            self._had_control = self._disengaged = self._home_set = False
        elif moment.act == 'disengage':
            self._helm.disengage()
            self._disengaged = True

    def _told(self, moment: SequenceStep) -> Telemetry:
        m = moment
        pose = Pose(self._now_ns, m.north_m, 0.0, -m.altitude_m, _LEVEL, m.altitude_m)
        return Telemetry(
            received_ns=1,
            pose=pose if m.has_pose else None,
            armed=m.armed,
            in_control=m.in_control,
            mode='GUIDED' if m.in_control else 'LOITER',
            landed=m.landed,
            battery_remaining=m.battery,
            fence=m.fence,
            other_commander=m.other_commander,
            mode_known=m.mode_known,
        )

    def _seen(self, moment: SequenceStep, told: Telemetry) -> Sighting:
        m, site = moment, None
        if m.has_site:
            site = Site(m.north_m + m.offset_m, 0.0, m.clearance_m, 100.0, 0.9, 0.2)
        return Sighting(
            verdict=Verdict.no_zone('none') if site is None else Verdict.found(site),
            reachable=site if m.way_is_free else None,
            ground_is_fresh=m.ground_is_fresh and told.pose is not None,
            ground_score=m.ground_score,
            ground_age_s=m.ground_age_s,
            stamp_ns=self._now_ns,
            map_age_s=m.map_age_s,
            revision=self._revision,
            threshold=self._p.safety_threshold,
            best=site,
        )

    def _broken(
        self,
        moment: SequenceStep,
        told: Telemetry,
        seen: Sighting,
        before: State,
        decision: Decision,
    ) -> Iterator[str]:
        """Yield every promise that a decision breaks."""
        setpoint, state = decision.setpoint, decision.state
        pose = valid_pose(told, self._p)
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(map(isfinite, v)):
            yield 'a set-point is finite'
        if state in STILL_STATES and not setpoint.is_zero:
            yield 'zero is zero in a state that stands still'
        blind = pose is None or not moment.telemetry_age_s <= self._p.telemetry_age_limit_s
        if blind and not setpoint.is_zero:
            yield 'nothing moves without telemetry that is fresh and valid'
        doubtful = told.other_commander or not told.mode_known
        if doubtful and not self._engaged_now and not setpoint.is_zero:
            yield 'nothing moves while it is not certain that only we command'
        if setpoint.v_down_m_s > 0.0:
            yield from self._broken_by_descent(moment, pose, seen, state)
        lateral = hypot(v[0], v[1])
        if lateral > self._p.lateral_speed_limit + 1e-9 or not (
            -self._p.z_speed_climbing <= v[2] <= self._p.z_speed_landing
        ):
            yield 'speed is limited'
        above_m = moment.heights.above_lowest_m
        if lateral > 0.0 and pose is not None and not at_safe_altitude(pose, self._p, above_m):
            site = seen.reachable
            if site is None or site.distance_m(pose) > site.clearance_m:
                yield 'no lateral motion below the safe altitude but within the clearance'
        if state is not before and state not in TRANSITIONS[before]:
            yield 'only transitions of the table happen'
        if not decision.reason:
            yield 'every decision has a reason'
        if state is State.HANDOVER and before is not State.HANDOVER:
            yield from self._broken_by_handover(moment, pose, seen)
        yield from self._broken_by_takeover(told, before, state)
        yield from self._broken_by_fence(pose, setpoint.v_north_m_s)

    def _broken_by_descent(
        self, moment: SequenceStep, pose: Pose | None, seen: Sighting, state: State
    ) -> Iterator[str]:
        p, site = self._p, seen.verdict.site
        above_m = moment.heights.above_lowest_m
        if pose is None or not pose.altitude_agl_m - above_m > p.handover_altitude_m:
            yield 'never down without a valid altitude above the floor, by the lowest height'
        if moment.heights.problem:
            yield 'never down while heights disagree'
        if not moment.map_age_s <= p.descent_heatmap_age_limit_s:
            yield 'never down without a fresh map'
        if pose is not None and state in LOOKING:
            if not pose.altitude_agl_m - above_m > p.search_floor * p.safe_altitude_m:
                yield 'a search never goes down to the safe altitude'
            return
        if not moment.ground_age_s <= p.descent_heatmap_age_limit_s:
            yield 'never down without a fresh look at the ground below'
        if not moment.ground_score >= CELL_SCORE_FLOOR or not moment.ground_is_fresh:
            yield 'never down over ground that is not safe'
        if site is None or pose is None or not over_site(pose, site, p.safety_radius_m):
            yield 'never down without a SITE under the vehicle'

    def _broken_by_handover(
        self, moment: SequenceStep, pose: Pose | None, seen: Sighting
    ) -> Iterator[str]:
        p, site = self._p, seen.verdict.site
        if moment.heights.problem or not moment.heights.may_hand_over:
            yield 'never handed over while heights disagree'
        if pose is None or site is None or not over_site(pose, site, p.safety_radius_m):
            yield 'never handed over without a SITE below'
        elif site.distance_m(pose) > p.handover_error_m or not seen.ground_is_fresh:
            yield 'never handed over beside the site or over ground not seen'

    def _broken_by_takeover(self, told: Telemetry, before: State, state: State) -> Iterator[str]:
        if before is State.ABORTED and not self._engaged_now and state is not before:
            yield 'ABORTED is final until engaged again'
        ended = before in {State.HANDOVER, State.ABORTED} or self._disengaged or self._engaged_now
        taken = self._had_control and not told.in_control and not ended
        if taken and state is not State.ABORTED:
            yield 'a take-over is ABORTED at once'
        self._had_control |= told.in_control and told.armed and not self._disengaged

    def _broken_by_fence(self, pose: Pose | None, v_north_m_s: float) -> Iterator[str]:
        if pose is not None and not self._home_set and not self._disengaged:
            self._home_set, self._home_north_m = True, pose.north_m
        radius_m = self._p.geofence_radius_m
        if pose is None or not self._home_set or radius_m == 0.0:
            return
        out_m = pose.north_m - self._home_north_m
        if abs(out_m) >= radius_m and out_m * v_north_m_s > 0.0:
            yield 'no motion outwards beyond the fence'


def draw(random: np.random.Generator, sequences: int, length: int) -> Iterator[list[SequenceStep]]:
    """Yield sequences of moments; reproducible from the generator."""
    fields = list(get_type_hints(SequenceStep))
    columns = []
    for name in fields:
        weights = np.array([weight for _, weight in CHOICES[name]], dtype=float)
        index = random.choice(len(weights), size=(sequences, length), p=weights / weights.sum())
        values = [value for value, _ in CHOICES[name]]
        columns.append([[values[each] for each in row] for row in index.tolist()])
    for row in zip(*columns, strict=True):
        yield [SequenceStep(*each) for each in zip(*row, strict=True)]


def run(
    sequences: int, seed: int = 1, length: int = LENGTH, *, tell: bool = False
) -> SequenceReport:
    """Run sequences from every state in turn and return the report."""
    random, report, states = np.random.default_rng(seed), SequenceReport(), list(State)
    begun_s = monotonic()
    while report.sequences < sequences:
        block = min(_BLOCK, sequences - report.sequences)
        for moments in draw(random, block, length):
            number = report.sequences
            state = states[number % len(states)]
            parameters = PARAMETERS[number // len(states) % len(PARAMETERS)]
            trial = Trial(parameters, state, number)
            for moment in moments:
                trial.step(moment, report)
            report.sequences += 1
        if tell:
            elapsed_s = monotonic() - begun_s
            sys.stderr.write(f'\r{report.sequences} of {sequences} sequences, {elapsed_s:.0f} s')
            sys.stderr.flush()
        if len(report.failures) >= _SHOWN_FAILURES:
            break
    return report


def main(args: Sequence[str] | None = None) -> int:
    """Run sequences from the command line; 1 when a promise was broken."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').splitlines()[0])
    parser.add_argument('--sequences', type=int, default=100_000)
    parser.add_argument('--length', type=int, default=LENGTH, help='moments of each')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--json', type=Path, help='write the report to this file')
    given = parser.parse_args(args)
    report = run(given.sequences, given.seed, given.length, tell=True)
    sys.stderr.write('\n')
    if given.json is not None:
        write_whole(given.json, json.dumps(vars(report), indent=2) + '\n', 'flights')
    lines = [
        f'{report.sequences} sequences, {report.moments} moments, seed {given.seed}',
        f'{report.descents} commands to descend, {report.handovers} hand-overs',
        f'{len(report.visits)} states, {len(report.transitions)} transitions',
        f'{len(report.failures)} promises broken',
        *report.failures[:_SHOWN_FAILURES],
    ]
    sys.stdout.write('\n'.join(lines) + '\n')
    return 1 if report.failures else 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that the page shows, as it was heard last; no ROS and no web in here.

Ages are by receipt and the steady clock, so that no clock of a camera, a vehicle or a browser can
make old data look new.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import hypot, isfinite
from typing import Any

from peace_ros.core.domain import Pose
from peace_ros.core.prompting.pairs import prompt_from_pairs
from peace_ros.watch.timeline import KEPT_S, PastMoment, Timeline
from peace_ros.watch.words import STOPS, UNKNOWN, in_words

SILENT_S = 1.5
"""``landing/status`` comes ten times per second; after this silence the page must say so."""
_FINDING_SILENT_S = 3.5
_POSES = 100
_MOST_REFUSED = 5
_STILL = frozenset({'', 'IDLE', 'ABORTED', 'HANDOVER', 'FAILED'})
_SITE = ('north_m', 'east_m', 'clearance_m', 'area_m2', 'confidence', 'age_s')
_FOCUS = ('north_m', 'east_m', 'radius_m')
_REFUSED = ('north_m', 'east_m', 'clearance_m', 'distance_m')
_NUMBERS = (
    *('north_m', 'east_m', 'altitude_agl_m', 'v_north_m_s', 'v_east_m_s', 'v_down_m_s'),
    *('time_in_state_s', 'map_age_s', 'telemetry_age_s', 'effective_threshold'),
)
_TEXTS = (
    *('outcome', 'verdict', 'verdict_reason', 'mode', 'armed', 'in_control', 'landed', 'sender'),
    *('status_text', 'explanation', 'line_warning', 'attempts', 'failed_sites'),
)


@dataclass(frozen=True)
class TaskReport:
    """What a node reports of one of its tasks on ``/diagnostics``."""

    name: str
    """``namespace/node: task``."""
    level: int
    """0 good, 1 warning, 2 error, 3 stale."""
    sentence: str
    values: Mapping[str, str]
    heard_s: float


@dataclass(frozen=True)
class Picture:
    """A picture for the page and where it lies."""

    number: int
    """Grows with every picture."""
    data: bytes
    """JPEG or PNG."""
    heard_s: float
    meta: Mapping[str, Any] = field(default_factory=dict)


class Ledger:
    """Filled by the subscriptions, read by the server; may be used from several threads."""

    def __init__(self, vehicle: str) -> None:
        self.lock = threading.RLock()
        self.vehicle = vehicle
        """Namespace, ``/`` without one."""
        self.timeline = Timeline()
        self.parameters: dict[str, Any] = {}
        """Of the landing node, by name; empty until it has answered."""
        self.problem = ''
        """What the graph says against what is shown, such as a second landing node."""
        self.others: list[str] = []
        """Namespaces of other vehicles on this ROS domain."""
        self.poses: list[Pose] = []
        self.overlay: Picture | None = None
        self.ground: Picture | None = None
        self._values: Mapping[str, str] = {}
        self._status_s: float | None = None
        self._level = 0
        self._prompt: dict[str, Any] | None = None
        self._prompt_s = 0.0
        self._findings: dict[str, TaskReport] = {}
        self._home: tuple[float, float] | None = None
        self._state = ''

    def hear_status(self, values: Mapping[str, str], level: int, now_s: float) -> None:
        """Take the pairs of ``landing/status``, its level, and the steady clock."""
        with self.lock:
            before, self._state = self._state, values.get('state', '')
            self._values, self._level, self._status_s = values, level, now_s
            north_m, east_m = _number(values, 'north_m'), _number(values, 'east_m')
            if before in _STILL and self._state not in _STILL:
                # Began while the page watched; a landing that was under way has no known home.
                self._home = None
                if before and north_m is not None and east_m is not None:
                    self._home = north_m, east_m
            reason = values.get('reason', '')
            altitude_m = _number(values, 'altitude_agl_m')
            self.timeline.add(PastMoment(now_s, self._state, reason, altitude_m, north_m, east_m))
            note = self.timeline.note
            note(now_s, 'state', f'{self._state}: {in_words(self._state)}')
            note(now_s, 'reason', reason)
            note(now_s, 'guard', values.get('guard', ''))
            note(now_s, 'site', values.get('verdict_reason', ''))

    def hear_prompt(self, pairs: Mapping[str, str], stamp_ns: int, now_s: float) -> None:
        """Take the pairs of ``prompt``.

        Raises:
            ConfigurationError: they are no prompt.
        """
        prompt = prompt_from_pairs(pairs, stamp_ns)
        words = {
            category: [{'word': each.word, 'score': each.score} for each in ranking[:5]]
            for category, ranking in prompt.ranking.items()
        }
        with self.lock:
            self._prompt = {'template': prompt.template, 'words': words}
            self._prompt_s = now_s

    def hear_findings(self, findings: Sequence[TaskReport]) -> None:
        """Take what nodes report of their tasks."""
        with self.lock:
            self._findings.update({each.name: each for each in findings})
            newest_s = max((each.heard_s for each in findings), default=0.0)
            self._findings = {
                name: each
                for name, each in self._findings.items()
                if newest_s - each.heard_s <= KEPT_S
            }

    def hear_pose(self, pose: Pose) -> None:
        """Keep a pose for the pictures around its stamp."""
        with self.lock:
            if self.poses and pose.stamp_ns <= self.poses[-1].stamp_ns:
                self.poses.clear()
            self.poses.append(pose)
            del self.poses[:-_POSES]

    def circles(self) -> list[dict[str, Any]]:
        """Return what is known of places: kind, north, east and radius in metres."""
        with self.lock:
            values = self._values
        found = []
        site, focus = _place(values, 'site_', _SITE), _place(values, 'focus_', _FOCUS)
        if focus is not None:
            found.append({'kind': 'focus', **focus})
        for number, each in enumerate(_refused(values), start=1):
            found.append({'kind': f'refused {number}', **each, 'radius_m': each['clearance_m']})
        if site is not None:
            found.append({'kind': 'site', **site, 'radius_m': site['clearance_m']})
        return found

    def snapshot(self, now_s: float) -> dict[str, Any]:
        """Return everything but pictures and history; numbers that are not known are None."""
        with self.lock:
            values = self._values
            age_s = None if self._status_s is None else now_s - self._status_s
            silent = age_s is None or age_s > SILENT_S
            numbers = {name: _number(values, name) for name in _NUMBERS}
            return {
                'vehicle': self.vehicle,
                'others': self.others,
                'problem': self.problem or (_silence(age_s) if silent else ''),
                'state': self._state,
                'words': UNKNOWN if age_s is None else in_words(self._state),
                'stops': STOPS.get(self._state, ''),
                'reason': values.get('reason', ''),
                'level': self._level,
                'age_s': age_s,
                'silent': silent,
                'site': _site(values),
                'focus': _place(values, 'focus_', _FOCUS),
                'refused': _refused(values),
                'guard': [each for each in values.get('guard', '').split('; ') if each],
                'home': self._home,
                'limits': self.parameters,
                'prompt': self._prompt,
                'prompt_age_s': now_s - self._prompt_s if self._prompt else None,
                'findings': [_finding(each, now_s) for each in self._sorted_findings()],
                **numbers,
                **{name: values.get(name, '') for name in _TEXTS},
            }

    def history(self, now_s: float) -> dict[str, Any]:
        """Return the timeline, with times as seconds before now."""
        with self.lock:
            return {
                'samples': _thinned(self.timeline.samples, now_s),
                'events': [
                    {**asdict(each), 'time_s': each.time_s - now_s} for each in self.timeline.events
                ],
            }

    def note_command(self, now_s: float, sentence: str) -> None:
        """Record what a person asked for on the page, and the answer."""
        with self.lock:
            self.timeline.tell(now_s, 'command', sentence)

    def _sorted_findings(self) -> list[TaskReport]:
        return sorted(self._findings.values(), key=lambda each: (-each.level, each.name))


def _thinned(samples: Iterable[PastMoment], now_s: float) -> list[dict[str, Any]]:
    """Return samples with the reason only where it changed."""
    told, before = [], ''
    for each in samples:
        reason = each.reason if each.reason != before else None
        told.append({**asdict(each), 'time_s': round(each.time_s - now_s, 2), 'reason': reason})
        before = each.reason
    return told


def _silence(age_s: float | None) -> str:
    if age_s is None:
        return (
            'nothing is heard on landing/status: start the landing node, and give this page its '
            'ROS_DOMAIN_ID and namespace'
        )
    return f'landing/status is silent for {age_s:.0f} s: what is shown is old; take over by radio'


def _number(values: Mapping[str, str], key: str) -> float | None:
    try:
        number = float(values[key])
    except (KeyError, ValueError):
        return None
    return number if isfinite(number) else None


def _place(values: Mapping[str, str], prefix: str, names: Sequence[str]) -> dict[str, float] | None:
    """Return the numbers of a place, None unless all of them are there."""
    numbers = {name: _number(values, f'{prefix}{name}') for name in names}
    known = {name: number for name, number in numbers.items() if number is not None}
    return known if len(known) == len(names) else None


def _site(values: Mapping[str, str]) -> dict[str, float] | None:
    site = _place(values, 'site_', _SITE)
    north_m, east_m = _number(values, 'north_m'), _number(values, 'east_m')
    if site is None or north_m is None or east_m is None:
        return site
    return {**site, 'distance_m': hypot(site['north_m'] - north_m, site['east_m'] - east_m)}


def _refused(values: Mapping[str, str]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    for number in range(1, _MOST_REFUSED + 1):
        place = _place(values, f'refused/{number}/', _REFUSED)
        if place is None:
            break
        found.append({**place, 'reason': values.get(f'refused/{number}/reason', '')})
    return found


def _finding(finding: TaskReport, now_s: float) -> dict[str, Any]:
    age_s = now_s - finding.heard_s
    silent = age_s > _FINDING_SILENT_S
    return {
        'name': finding.name,
        'level': 3 if silent else finding.level,
        'sentence': f'silent for {age_s:.0f} s: does the node run?' if silent else finding.sentence,
        'rate_hz': finding.values.get('rate_hz', ''),
        'latency_s': finding.values.get('latency_s', ''),
        'silent_s': finding.values.get('silent_s', ''),
    }

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What follows HANDOVER, each policy once, and never against a pilot."""

from __future__ import annotations

import time

import pytest

from peace_ros.core.domain import Pose, Site, Telemetry
from peace_ros.core.vehicle import Answer, RequestResult
from peace_ros.nodes.handover import AfterHandover

SITE = Site(4.0, -3.0, 6.0, 200.0, 0.9, 0.1)
POSE = Pose(0, 0.0, 0.0, -20.0, (1.0, 0.0, 0.0, 0.0), 20.0)


class Link:
    def __init__(self) -> None:
        self.targets: list[tuple[float, float, float]] = []
        self.asked = 0
        self.answers = [Answer.ACCEPTED]

    def telemetry(self) -> Telemetry:
        return Telemetry(0, POSE)

    def send_landing_target(self, site: tuple[float, float, float], _pose: Pose) -> None:
        self.targets.append(site)

    def request_land(self) -> RequestResult:
        self.asked += 1
        return RequestResult(self.answers.pop(0) if self.answers else Answer.REFUSED, 'no')


def follow(policy: str, link: Link, seconds: float = 0.35) -> list[str]:
    said: list[str] = []
    after = AfterHandover(policy, said.append)
    after.follow(link, SITE, handed_over=False)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        after.follow(link, SITE, handed_over=True)
        time.sleep(0.02)
    after.end()
    return said


def test_hold_does_nothing() -> None:
    link = Link()
    follow('hold', link)
    assert (link.targets, link.asked) == ([], 0)


def test_land_is_asked_for_once() -> None:
    link = Link()
    assert 'lands by itself' in follow('land', link)[0]
    assert (link.targets, link.asked) == ([], 1)


def test_a_refusal_is_told_and_ends_after_three(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('peace_ros.nodes.handover._PAUSE_S', 0.01)
    link = Link()
    link.answers = []
    said = follow('land', link)
    assert link.asked == 3
    assert 'refused: no' in said[-1]


def test_landing_targets_flow_at_ten_hertz_and_lie_on_the_ground() -> None:
    link = Link()
    follow('landing_target', link, 0.55)
    assert 3 <= len(link.targets) <= 7
    assert set(link.targets) == {(4.0, -3.0, 0.0)}
    assert link.asked == 0

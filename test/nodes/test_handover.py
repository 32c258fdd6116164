# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What follows HANDOVER, each policy once, and never against a pilot."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

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

        self.told = Telemetry(0, POSE, armed=True, in_control=True, mode='GUIDED')
        self.taken_over = False
        self.lands_in = ''

    def telemetry(self) -> Telemetry:
        return self.told

    def send_landing_target(self, site: tuple[float, float, float], _pose: Pose) -> None:
        self.targets.append(site)

    def request_land(self, wanted: Callable[[], bool] = lambda: True) -> RequestResult:
        self.asked += 1
        self.wanted = wanted
        if self.lands_in:
            self.told = replace(self.told, mode=self.lands_in, in_control=False)
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


def test_a_disengagement_withdraws_the_request_to_land() -> None:
    link = Link()
    after = AfterHandover('land', lambda _sentence: None)
    after.follow(link, SITE, handed_over=True)
    until = time.monotonic() + 2.0
    while not link.asked and time.monotonic() < until:
        time.sleep(0.01)
    assert link.wanted()
    after.follow(link, SITE, handed_over=False)
    assert not link.wanted()


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


LANDED = 'on the ground'
CONTROLLED = 'a pilot or a failsafe is in control'


@pytest.mark.parametrize('policy', ['hold', 'landing_target'])
@pytest.mark.parametrize(
    ('changes', 'stage'),
    [
        ({}, 'hovering over a safe site'),
        ({'in_control': False, 'mode': 'LOITER'}, f'mode LOITER: {CONTROLLED}'),
        ({'landed': True}, LANDED),
        ({'landed': True, 'armed': False}, f'{LANDED}, disarmed'),
        ({'armed': False}, 'disarmed'),
    ],
)
def test_the_stage_of_a_vehicle_that_holds(policy, changes, stage) -> None:
    link, after = Link(), AfterHandover(policy, lambda _: None)
    assert after.stage == ''
    link.told = replace(link.told, **changes)
    after.follow(link, SITE, handed_over=True)
    assert after.stage == stage


def landing(link: Link, *tellings: dict[str, object]) -> list[str]:
    """The stages while the vehicle lands and reports one after the other."""
    after, stages = AfterHandover('land', lambda _: None), []
    until = time.monotonic() + 2.0
    while not after.stage.startswith('LANDING') and time.monotonic() < until:
        after.follow(link, SITE, handed_over=True)
        time.sleep(0.01)
    for changes in tellings:
        link.told = replace(link.told, **changes)
        after.follow(link, SITE, handed_over=True)
        stages.append(after.stage)
    after.end()
    return stages


def test_the_stages_of_a_landing_to_the_ground() -> None:
    link = Link()
    link.lands_in = 'LAND'
    assert landing(link, {}, {'landed': True}, {'armed': False}) == [
        'LANDING by the autopilot in mode LAND',
        LANDED,
        f'{LANDED}, disarmed',
    ]


def test_a_pilot_who_takes_over_the_landing_is_seen() -> None:
    link = Link()
    link.lands_in = 'LAND'
    stages = landing(link, {}, {'mode': 'LOITER'})
    assert stages[-1] == f'mode LOITER: {CONTROLLED}'


def test_a_pilot_who_takes_over_before_the_landing_is_seen() -> None:
    link = Link()
    link.answers = []
    link.taken_over = True
    after = AfterHandover('land', lambda _: None)
    link.told = replace(link.told, mode='LOITER', in_control=False)
    after.follow(link, SITE, handed_over=True)
    assert after.stage == f'mode LOITER: {CONTROLLED}'
    after.end()


def test_a_landing_that_is_refused_for_good_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('peace_ros.nodes.handover._PAUSE_S', 0.01)
    link, after = Link(), AfterHandover('land', lambda _: None)
    link.answers = []
    until = time.monotonic() + 2.0
    while 'refused' not in after.stage and time.monotonic() < until:
        after.follow(link, SITE, handed_over=True)
        time.sleep(0.01)
    assert after.stage == 'hovering over a safe site; landing refused: no'


def test_a_landing_that_is_asked_for_is_not_a_pilot() -> None:
    link, said = Link(), []
    link.answers = []
    after = AfterHandover('land', said.append)
    after.follow(link, SITE, handed_over=True)
    link.told = replace(link.told, in_control=False, mode='LAND')
    after.follow(link, SITE, handed_over=True)
    assert after.stage == 'the autopilot is asked to land'
    after.follow(link, SITE, handed_over=False)
    assert after.stage == ''

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Engaging takes seconds; who disengages or deactivates meanwhile is obeyed."""

from __future__ import annotations

import logging
import threading
import time
from contextlib import suppress

import pytest
from std_srvs.srv import Trigger

from peace_ros.core.vehicle import Answer, RequestResult
from peace_ros.nodes.engagement import EngagementServices

LIMIT_S = 5.0


class Link:
    """Grants control when it is let."""

    def __init__(self) -> None:
        self.asked, self.granted = threading.Event(), threading.Event()
        self.holds = 0

    def request_control(self, *, by_person: bool) -> RequestResult:
        self.asked.set()
        assert self.granted.wait(LIMIT_S)
        return RequestResult(Answer.ACCEPTED)

    def request_hold(self) -> RequestResult:
        self.holds += 1
        return RequestResult(Answer.ACCEPTED)


class Access:
    def __init__(self, link: Link) -> None:
        self.link = link
        self.levelled = 0

    def hold_level(self) -> str:
        self.levelled += 1
        return 'instead it holds level'


class Flown:
    """What the services ask of the landing node."""

    def __init__(self) -> None:
        self.is_active, self.begun, self.problem = True, 0, ''
        self.services = {}
        self.defects = []

    def create_service(self, _kind, name, callback, **_more):
        self.services[name.removeprefix('~/')] = callback

    def get_logger(self):
        return logging.getLogger('landing')

    def check_engagement(self) -> str:
        return self.problem

    def begin(self) -> str:
        if not self.is_active:
            return 'the landing node is not active'
        self.begun += 1
        return ''

    def end_landing(self) -> bool:
        return False

    def fail(self, error: BaseException) -> None:
        self.defects.append(error)


@pytest.fixture
def node():
    return Flown()


@pytest.fixture
def link():
    return Link()


@pytest.fixture
def access(link):
    return Access(link)


def engage_while(services: EngagementServices, link: Link, meanwhile) -> None:
    services.engage_when_ready()
    assert link.asked.wait(LIMIT_S)
    meanwhile()
    link.granted.set()
    services.close()


def disengage(node: Flown) -> None:
    assert node.services['disengage'](Trigger.Request(), Trigger.Response()).success


def test_control_that_is_granted_begins_the_landing(node, link, access):
    engage_while(EngagementServices(node, access, auto=True), link, lambda: None)
    assert (node.begun, link.holds) == (1, 0)


def test_nothing_begins_after_a_disengagement_while_control_was_asked_for(node, link, access):
    engage_while(EngagementServices(node, access, auto=True), link, lambda: disengage(node))
    assert (node.begun, link.holds) == (0, 1)


def test_a_vehicle_that_obeys_a_node_that_went_inactive_is_let_hold(node, link, access):
    services = EngagementServices(node, access, auto=True)
    engage_while(services, link, lambda: setattr(node, 'is_active', False))
    assert (node.begun, link.holds) == (0, 1)


def test_a_later_engagement_begins_all_the_same(node, link, access):
    services = EngagementServices(node, access, auto=True)
    disengage(node)
    services.engage_when_ready()
    assert not link.asked.is_set(), 'a disengagement ends engaging automatically'
    link.granted.set()
    engage_as_a_person(node)
    deadline = time.monotonic() + LIMIT_S
    while not node.begun and time.monotonic() < deadline:
        time.sleep(0.01)
    assert node.begun == 1


def engage_as_a_person(node: Flown) -> None:
    """Begin to engage; the answer is not waited for."""
    with suppress(StopIteration):
        node.services['engage'](Trigger.Request(), Trigger.Response()).send(None)


@pytest.mark.parametrize('active', [True, False])
def test_only_an_active_node_holds_the_vehicle_level(node, link, access, active):
    node.is_active, node.problem = active, 'no position'
    services = EngagementServices(node, access, auto=False)
    engage_as_a_person(node)
    services.close()
    assert access.levelled == int(active)
    assert not link.asked.is_set()

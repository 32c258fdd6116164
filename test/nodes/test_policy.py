# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The shipped SROS 2 policy lets each node do what it does, and nobody else command a landing."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from uuid import uuid4

import pytest

from peace_ros.core.domain import Prompt
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.nodes.segmentation import SegmentationNode

POLICY = ET.parse(Path(__file__).resolve().parents[2] / 'config' / 'sros2' / 'policy.xml')  # noqa: S314 (our own file)
NODES = {
    'prompt_generator': PromptGeneratorNode,
    'segmentation': SegmentationNode,
    'landing': LandingNode,
}


def allowed(enclave: str, node: str, kind: str, verb: str) -> set[str]:
    path = f'.//enclave[@path="/peace_ros/{enclave}"]//profile[@node="{node}"]/{kind}[@{verb}]/*'
    return {'/' + each.text.removeprefix('/') for each in POLICY.iterfind(path)}


class Model:
    def generate(self, frame):
        return Prompt('A {term}.', frame.stamp_ns)


@pytest.fixture(params=[{}, {'interface': 'twist'}], ids=['mavlink', 'twist'])
def landing_options(request) -> dict[str, str]:
    return {'mavlink': 'udpin:127.0.0.1:0', **request.param}


def names(pairs: list[tuple[str, list[str]]], space: str) -> set[str]:
    """Return the names as they are without the namespace."""
    return {name.removeprefix(space) for name, _ in pairs}


@pytest.mark.parametrize('name', NODES)
def test_a_node_may_do_all_that_it_does(bench, name, landing_options):
    options = landing_options if name == 'landing' else {}
    # The graph knows nodes by name only: another test may have had one of this name a moment ago.
    space = f'/policy_{uuid4().hex}'
    make = partial(NODES[name], namespace=space)
    node = bench.run(make, *([] if name == 'landing' else [Model()]), **options)

    def now() -> tuple[set[str], set[str], set[str]]:
        return (
            names(node.get_publisher_names_and_types_by_node(name, space), space),
            names(node.get_subscriber_names_and_types_by_node(name, space), space),
            names(node.get_service_names_and_types_by_node(name, space), space),
        )

    made = (
        {each.topic_name.removeprefix(space) for each in node.publishers},
        {each.topic_name.removeprefix(space) for each in node.subscriptions},
        {each.service_name.removeprefix(space) for each in node.services},
    )
    bench.until(lambda: all(own <= told for own, told in zip(made, now(), strict=True)))
    published, subscribed, served = now()
    # rcl makes this one, and shares it among nodes of one name in a process, as these tests have
    published |= {'/rosout'}
    assert published <= allowed(name, name, 'topics', 'publish')
    assert subscribed <= allowed(name, name, 'topics', 'subscribe')
    assert served <= allowed(name, name, 'services', 'reply')
    if name != 'landing':
        for kind, verb in (('topics', 'publish'), ('topics', 'subscribe'), ('services', 'reply')):
            assert allowed('perception', name, kind, verb) == allowed(name, name, kind, verb)


def enclaves_that_may(kind: str, verb: str, name: str) -> Iterator[str]:
    for enclave in POLICY.iterfind('.//enclave'):
        path = enclave.get('path').removeprefix('/peace_ros/')
        for profile in enclave.iterfind('.//profile'):
            if name in allowed(path, profile.get('node'), kind, verb):
                yield path


def test_only_the_operator_engages_and_each_input_has_its_source():
    assert list(enclaves_that_may('services', 'request', '/landing/engage')) == ['operator']
    assert list(enclaves_that_may('topics', 'publish', '/image')) == ['camera']
    assert list(enclaves_that_may('topics', 'publish', '/prompt')) == [
        'prompt_generator',
        'perception',
    ]
    assert list(enclaves_that_may('topics', 'publish', '/heatmap')) == [
        'segmentation',
        'perception',
    ]
    assert list(enclaves_that_may('topics', 'publish', '/cmd_vel')) == ['landing']
    assert not list(enclaves_that_may('services', 'request', '/landing/set_parameters'))

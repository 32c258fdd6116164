# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Managed nodes: what each state does, by the services that lifecycle managers use."""

from __future__ import annotations

import gc
import weakref
from contextlib import suppress

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, Twist
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import Image

from peace_ros.core.domain import Heatmap, Pose, Prompt
from peace_ros.core.node_parameters import groups_of
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.managed import ManagedNode
from peace_ros.nodes.messages import pose_to_message
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.nodes.segmentation import SegmentationNode


class Model:
    encoder = None

    def generate(self, frame):
        return Prompt('A {term} in winter.', frame.stamp_ns)

    def prepare(self, prompt):
        pass

    def segment(self, frame, prompt):
        return Heatmap(np.full((6, 8), 0.8, np.float32), frame.stamp_ns)


@pytest.fixture
def manager(bench):
    """Return what a lifecycle manager does: request a transition, ask for the state."""

    class Manager:
        def __init__(self, name: str) -> None:
            self._change = bench.peer.create_client(ChangeState, f'/{name}/change_state')
            self._get = bench.peer.create_client(GetState, f'/{name}/get_state')
            bench.until(self._change.service_is_ready)
            bench.until(self._get.service_is_ready)

        def change(self, transition: str, doing=None) -> bool:
            future = self._change.call_async(
                ChangeState.Request(transition=Transition(label=transition))
            )
            bench.until(future.done, doing)
            return future.result().success

        @property
        def state(self) -> str:
            future = self._get.call_async(GetState.Request())
            bench.until(future.done)
            return future.result().current_state.label

    return Manager


def test_a_node_is_active_after_its_start(bench, manager):
    bench.run(PromptGeneratorNode, Model())
    assert manager('prompt_generator').state == 'active'


@pytest.mark.parametrize(
    ('create', 'kind', 'topic'),
    [(PromptGeneratorNode, DiagnosticArray, 'prompt'), (SegmentationNode, Image, 'heatmap')],
)
def test_perception_works_only_while_active_and_again_after_a_cleanup(
    bench, manager, picture, create, kind, topic
):
    results = bench.heard(kind, topic, qos.RESULT)
    found = bench.findings('lifecycle')
    node = bench.run(create, Model(), autostart=False, template='DD')
    manager = manager(node.get_name())
    assert manager.state == 'unconfigured'
    bench.until(lambda: bool(found))
    assert found[-1].level == DiagnosticStatus.WARN
    assert 'unconfigured' in found[-1].message
    for _ in range(2):
        assert manager.change('configure')
        assert manager.state == 'inactive'
        images = bench.offer(Image, 'image', qos.IMAGE_OUT)
        results.clear()
        for _ in range(5):
            images.publish(picture(node.clock_ns()))
        assert manager.change('activate')
        assert not results
        bench.until(lambda: bool(results), lambda i=images: i.publish(picture(node.clock_ns())))
        assert manager.change('deactivate')
        assert manager.change('cleanup')
        assert manager.state == 'unconfigured'
        assert node.count_publishers(topic) == 0
        bench.peer.destroy_publisher(images)


def test_cleanup_frees_the_model(bench, manager, clipseg_folder):
    node = bench.run(SegmentationNode, bundle=str(clipseg_folder), template='DD')
    segmenter = weakref.ref(node._pipeline.segmenter)
    manager = manager('segmentation')
    assert manager.change('deactivate')
    assert segmenter() is not None
    assert manager.change('cleanup')
    gc.collect()
    assert segmenter() is None


def test_what_cannot_be_configured_stays_unconfigured_and_can_be_mended(bench, manager, capfd):
    node = bench.run(SegmentationNode, bundle='/nowhere', template='DD', autostart=False)
    manager = manager('segmentation')
    assert not manager.change('configure')
    assert manager.state == 'unconfigured'
    assert node.count_publishers('heatmap') == 0
    assert '/nowhere' in capfd.readouterr().err


def test_a_transition_that_the_state_does_not_have_is_refused_and_ends_nothing(bench, manager):
    node = bench.run(PromptGeneratorNode, Model())
    manager = manager('prompt_generator')
    assert not manager.change('activate')
    assert not manager.change('cleanup')
    assert not manager.change('fly')
    assert manager.state == 'active'
    assert node.failure is None


def test_a_landing_node_that_is_deactivated_stops_the_vehicle_and_engages_no_more(
    bench, manager, values_of
):
    statuses = bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)
    commands = bench.heard(Twist, 'cmd_vel', qos.COMMAND)
    node = bench.run(LandingNode, interface='twist')
    heatmaps = bench.offer_heatmaps()
    poses = bench.offer(PoseStamped, 'pose', qos.POSE)
    manager = manager('landing')
    safety = np.full((32, 32), 0.97, np.float32)

    def see() -> None:
        at_ns = node.clock_ns()
        poses.publish(pose_to_message(Pose(at_ns, 0.0, 0.0, -60.0, (1.0, 0.0, 0.0, 0.0), 60.0)))
        heatmaps.publish(safety, at_ns)

    def moves() -> bool:
        v = commands[-1].linear if commands else Twist().linear
        return (v.x, v.y, v.z) != (0.0, 0.0, 0.0)

    bench.until(lambda: not node.check_engagement(), see)
    assert node.begin() == ''
    bench.until(moves, see)
    assert manager.change('deactivate', see)
    bench.until(lambda: not moves(), see)
    bench.until(lambda: values_of(statuses[-1])['state'] == 'IDLE', see)
    assert 'activate' in node.check_engagement()
    assert 'not active' in node.begin()
    assert manager.change('activate', see)
    bench.until(lambda: not node.check_engagement(), see)
    assert manager.change('deactivate', see)
    assert manager.change('cleanup', see)
    assert bench.peer.count_publishers('cmd_vel') == 0
    assert manager.change('configure')
    assert manager.change('activate')
    bench.until(lambda: not node.check_engagement(), see)


def test_a_shutdown_during_a_landing_leaves_zero(bench, manager):
    node = bench.run(LandingNode, interface='twist')
    assert manager('landing').change('shutdown')
    assert node.begin()
    assert 'finalized' in node.check_engagement()


@pytest.mark.parametrize('transition', ['cleanup', 'shutdown'])
def test_a_defect_while_things_are_freed_is_not_swallowed(bench, manager, transition):
    configured = []

    class Broken(ManagedNode):
        def __init__(self, **options):
            super().__init__('broken', *groups_of('prompt_generator'), **options)
            self.start()

        def cleanup(self):
            raise RuntimeError('defect')

        def last_steps(self, _sentence):
            configured.append(self.is_configured)
            return ()

    node = bench.run(Broken)
    manager = manager('broken')
    assert manager.change('deactivate')
    with suppress(RuntimeError):  # the bench may meet the defect before the answer
        manager.change(transition)
    assert isinstance(node.failure, RuntimeError)
    assert configured == [True], 'a landing node can still stop its vehicle'

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompt_generator node: ``image`` -> ``prompt``, with the stamp of the frame."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from peace_ros.core.domain import Health, Level, PeaceError, Prompt
from peace_ros.core.health import WorkHealth
from peace_ros.core.messages import stamp_ns_of
from peace_ros.core.node_parameters import PromptGeneratorOptions, groups_of
from peace_ros.core.pipeline import create_generator
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, resolve_template
from peace_ros.nodes.images import ImageMessage, subscribe_images
from peace_ros.nodes.managed import ManagedNode
from peace_ros.nodes.messages import prompt_to_message
from peace_ros.nodes.qos import RESULT
from peace_ros.nodes.runtime import run
from peace_ros.nodes.sharing import SharedImages
from peace_ros.nodes.worker import NewestWorker


class PromptGeneratorNode(ManagedNode):
    """Describes the newest frame in words."""

    def __init__(
        self,
        generator: PromptGenerator | None = None,
        images: SharedImages | None = None,
        hand_over: Callable[[Prompt], None] = lambda _prompt: None,
        **options: Any,
    ) -> None:
        """Load the model and subscribe.

        Args:
            generator: in place of the one that the parameters describe.
            images: of another node of this process: only what it works on is described. None: this
                node subscribes.
            hand_over: takes each prompt besides, before it is published.
            options: of rclpy's Node.

        Raises:
            PeaceError: parameters, vocabularies or bundle cannot be used.

        """
        super().__init__('prompt_generator', *groups_of('prompt_generator'), **options)
        self._given, self._shared, self._hand_over = generator, images, hand_over
        self._images = images or SharedImages()
        self.start()

    def configure(self) -> None:
        """Load the model and subscribe."""
        parameters = self.filled(PromptingParameters)
        self._generator = self._given or create_generator(parameters, self.get_logger())
        self._last_template = ''
        self._prompt_out = self.create_publisher(DiagnosticArray, 'prompt', RESULT)
        self._image_arrived = self.diagnostics.watch('image', periodic=self._shared is None)
        self._work = WorkHealth()
        self.diagnostics.add('prompts', self._work.take)
        if self._shared is None:
            transport = self.filled(PromptGeneratorOptions).image_transport
            subscribe_images(self, transport, self._images.offer)
        self.get_logger().info(f'ready: template {resolve_template(parameters.template)!r}')

    def activate(self) -> None:
        """Begin to describe frames."""
        self._worker = NewestWorker(self._generate, self._complain, self.fail, 'prompt_generator')
        self._images.add(self._on_image, when_begun=self._shared is not None)

    def deactivate(self) -> None:
        """Describe no further frame."""
        self._images.remove(self._on_image)
        self._worker.close()

    def cleanup(self) -> None:
        """Free the model."""
        self._generator = PromptGenerator(None, None, PromptingParameters(template='DD'))

    def change(self, filled: Mapping[type[Any], Any]) -> None:
        """Use another template, vocabularies or way of ranking from the next frame on."""
        parameters: PromptingParameters = filled[PromptingParameters]
        if parameters != self.filled(PromptingParameters):
            self._generator = create_generator(
                parameters, self.get_logger(), self._generator.encoder
            )

    def _on_image(self, message: ImageMessage) -> None:
        self._image_arrived(stamp_ns_of(message))
        self._worker.offer(message)

    def _generate(self, message: ImageMessage) -> None:
        began = time.monotonic()
        prompt = self._generator.generate(self._images.frame(message))
        self._hand_over(prompt)
        self._prompt_out.publish(prompt_to_message(prompt))
        if prompt.template != self._last_template:
            self._last_template = prompt.template
            self.get_logger().info(f'prompt: {prompt.template}')
        latency_s = (self.clock_ns() - prompt.stamp_ns) / 1e9
        values = (
            ('latency_s', f'{latency_s:.3f}'),
            ('work_s', f'{time.monotonic() - began:.3f}'),
            ('dropped_frames', str(self._worker.dropped)),
        )
        self._work.put(Health(Level.OK, 'running', values))

    def _complain(self, error: PeaceError) -> None:
        self.say(type(error).__name__, f'no prompt for this frame: {error}')
        self._work.put(Health(Level.ERROR, str(error)))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(PromptGeneratorNode, args)


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The segmentation node: ``image`` and ``prompt`` -> ``heatmap``, with the stamp of the frame."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import Frame, Health, Heatmap, Level, PeaceError, Prompt
from peace_ros.core.health import WorkHealth
from peace_ros.core.messages import stamp_ns_of
from peace_ros.core.node_parameters import SegmentationOptions, groups_of
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.segmentation import (
    SegmentationParameters,
    Segmenter,
    create_segmenter,
    draw_overlay,
    family_of,
    load_terms,
)
from peace_ros.nodes.images import FRAME_INFO, CalibratedImages, ImageMessage
from peace_ros.nodes.managed import ManagedNode
from peace_ros.nodes.messages import camera_info, heatmap_to_image, jpeg_message
from peace_ros.nodes.prompts import PromptInput, prompt_of_another_frame, static_prompt
from peace_ros.nodes.qos import IMAGE_OUT, RESULT
from peace_ros.nodes.runtime import run
from peace_ros.nodes.sharing import SharedImages
from peace_ros.nodes.worker import NewestWorker

_NAME = 'segmentation'
_SLOW_S = 1.0
"""Work for one frame that leaves little of the age that the landing allows a heatmap."""


class SegmentationNode(ManagedNode):
    """Scores the newest frame with the prompt that was made from it."""

    def __init__(
        self,
        segmenter: Segmenter | None = None,
        images: SharedImages | None = None,
        *,
        hears_prompts: bool = True,
        **options: Any,
    ) -> None:
        """Load the model and subscribe.

        Args:
            segmenter: in place of the one that the parameters describe.
            images: gets the images for the other nodes of this process, too.
            hears_prompts: they come over the topic; otherwise by :meth:`take_prompt`.
            options: of rclpy's Node.

        Raises:
            PeaceError: parameters, terms or bundle cannot be used.

        """
        super().__init__(_NAME, *groups_of(_NAME), **options)
        self._given, self._hears_prompts = segmenter, hears_prompts
        self._images = images or SharedImages()
        self.start()

    def configure(self) -> None:
        """Load the model and subscribe."""
        self._options = self.filled(SegmentationOptions)
        self._pipeline = Pipeline(self._given or self._create_segmenter())
        self._heatmap_out = self.create_publisher(Image, 'heatmap', IMAGE_OUT)
        self._frame_info_out = self.create_publisher(CameraInfo, FRAME_INFO, RESULT)
        self._overlay_out = self.create_publisher(CompressedImage, 'overlay/compressed', IMAGE_OUT)
        self._image_arrived = self.diagnostics.watch('image', periodic=True)
        self._work = WorkHealth()
        self.diagnostics.add('heatmaps', self._work.take)
        self._prompts = PromptInput(
            self, self._options, self._embed, self._complain, subscribe=self._hears_prompts
        )
        calibrated = CalibratedImages(self, self._options.image_transport, self._images.offer)
        self._images.decode = calibrated.frame
        waits = 'waits for prompts' if self._prompts.static is None else 'static'
        self.get_logger().info(f'ready: template {self._options.template!r} ({waits})')

    def activate(self) -> None:
        """Begin to score frames."""
        self._worker = NewestWorker(self._segment, self._complain, self.fail, _NAME)
        self._images.add(self._on_image)

    def deactivate(self) -> None:
        """Score no further frame."""
        self._images.remove(self._on_image)
        self._worker.close()

    def cleanup(self) -> None:
        """Free the model."""
        if '_prompts' in vars(self):
            self._prompts.close()
            del self._prompts
        if '_pipeline' in vars(self):
            del self._pipeline

    def _create_segmenter(self) -> Segmenter:
        parameters = self.filled(SegmentationParameters)
        own = self.filled(family_of(parameters).parameters)
        return create_segmenter(parameters, own, log=self.get_logger())

    def change(self, filled: Mapping[type[Any], Any]) -> None:
        """Use other terms, another template or overlay from the next frame on."""
        options: SegmentationOptions = filled[SegmentationOptions]
        terms = filled[SegmentationParameters].terms
        segmenter, static = self._pipeline.segmenter, static_prompt(options)
        if terms != self.filled(SegmentationParameters).terms:
            segmenter = segmenter.with_terms(load_terms(terms))
        if static is not None:
            segmenter.prepare(static)
        self._options, self._pipeline.segmenter = options, segmenter
        self._prompts.change(options)

    def take_prompt(self, prompt: Prompt) -> None:
        """Take a prompt of the generator in this process; from any thread."""
        prompts = vars(self).get('_prompts')  # none while the node is unconfigured
        if prompts is not None:
            prompts.take_own(prompt)

    def _embed(self, prompt: Prompt) -> None:
        self._pipeline.segmenter.prepare(prompt)

    def _on_image(self, message: ImageMessage) -> None:
        self._image_arrived(stamp_ns_of(message))
        if self._hears_prompts and self._prompts.is_empty:
            self.say(
                'waiting',
                'no prompt has arrived yet, but frames have: is prompt_generator running?',
            )
            return
        self._worker.offer(message)

    def _segment(self, message: ImageMessage) -> None:
        self._images.begin(message)
        chosen = self._prompts.take(stamp_ns_of(message))
        if chosen is None:
            return
        prompt, own = chosen
        began = time.monotonic()
        frame, frame_id = self._images.frame(message), message.header.frame_id
        heatmap = self._pipeline.heatmap(frame, prompt)
        self._frame_info_out.publish(
            camera_info(frame.size_px, frame.camera, frame.stamp_ns, frame_id)
        )
        self._heatmap_out.publish(heatmap_to_image(heatmap, frame_id))
        work_s = time.monotonic() - began
        if self._overlay_out.get_subscription_count() > 0:
            self._publish_overlay(frame, heatmap, frame_id)
        self._report(frame.stamp_ns, prompt, own=own, work_s=work_s)

    def _publish_overlay(self, frame: Frame, heatmap: Heatmap, frame_id: str) -> None:
        overlay = draw_overlay(frame, heatmap, self._options.overlay_threshold)
        self._overlay_out.publish(
            jpeg_message(overlay, frame.stamp_ns, self._options.overlay_quality, frame_id)
        )

    def _report(self, at_ns: int, prompt: Prompt, *, own: bool, work_s: float) -> None:
        level, sentence = Level.OK, 'running'
        if not own:
            level = Level.WARN
            sentence = prompt_of_another_frame(prompt, at_ns, self._options.prompt_timeout)
            self.say('prompt', sentence)
        if work_s > _SLOW_S:
            level = Level.WARN
            sentence = (
                f'a frame takes {work_s:.1f} s, at most {_SLOW_S} s are good: lower '
                'clipseg_max_looks or the resolution of the camera'
            )
            self.say('slow', sentence)
        values = (
            ('latency_s', f'{(self.clock_ns() - at_ns) / 1e9:.3f}'),
            ('work_s', f'{work_s:.3f}'),
            ('prompt', prompt.template),
            ('own_prompt', str(own).lower()),
            ('dropped_frames', str(self._worker.dropped)),
        )
        self._work.put(Health(level, sentence, values))

    def _complain(self, error: PeaceError) -> None:
        self.say(type(error).__name__, f'no heatmap: {error}')
        self._work.put(Health(Level.ERROR, str(error)))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(SegmentationNode, args)


if __name__ == '__main__':
    sys.exit(main())

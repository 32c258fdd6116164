# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The segmentation node: ``image`` and ``prompt`` -> ``heatmap``, with the stamp of the frame."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import Frame, Heatmap, PeaceError, Prompt
from peace_ros.core.messages import prompt_from_message, stamp_ns_of
from peace_ros.core.node_parameters import SegmentationOptions, groups_of
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.prompting import categories_of, resolve_template
from peace_ros.core.segmentation import (
    SegmentationParameters,
    Segmenter,
    create_segmenter,
    draw_overlay,
    family_of,
)
from peace_ros.nodes.inputs import FRAME_INFO, CalibratedImages, ImageMessage
from peace_ros.nodes.messages import (
    ERROR,
    OK,
    WARN,
    camera_info,
    diagnostic_array,
    heatmap_to_image,
    jpeg_message,
)
from peace_ros.nodes.prompts import PromptBoard
from peace_ros.nodes.qos import IMAGE_OUT, RESULT
from peace_ros.nodes.runtime import PeaceNode, run
from peace_ros.nodes.worker import NewestWorker

_NAME = 'segmentation'
_SLOW_S = 1.0
"""Work for one frame that leaves little of the age that the landing allows a heatmap."""


class SegmentationNode(PeaceNode):
    """Scores the newest frame with the prompt that was made from it."""

    def __init__(self, segmenter: Segmenter | None = None, **options: Any) -> None:
        """Load the model and subscribe.

        Args:
            segmenter: in place of the one that the parameters describe.
            options: of rclpy's Node.

        Raises:
            PeaceError: parameters, terms or bundle cannot be used.

        """
        super().__init__(_NAME, *groups_of(_NAME), **options)
        self._options = self.filled(SegmentationOptions)
        template = resolve_template(self._options.template)
        self._static = None if categories_of(template) else Prompt(template, 0)
        self._pipeline = Pipeline(segmenter or self._create_segmenter())
        self._board = PromptBoard()
        self._prepared: set[str] = set()
        self._heatmap_out = self.create_publisher(Image, 'heatmap', IMAGE_OUT)
        self._frame_info_out = self.create_publisher(CameraInfo, FRAME_INFO, RESULT)
        self._overlay_out = self.create_publisher(CompressedImage, 'overlay/compressed', IMAGE_OUT)
        self._diagnostics_out = self.create_publisher(DiagnosticArray, '/diagnostics', RESULT)
        self._preparer = NewestWorker(self._prepare, self._complain, self.fail, 'prepare')
        self._worker = NewestWorker(self._segment, self._complain, self.fail, _NAME)
        if self._static is None:
            self.create_subscription(DiagnosticArray, 'prompt', self._on_prompt, RESULT)
        self._images = CalibratedImages(self, self._options.image_transport, self._on_image)
        waits = 'waits for prompts' if self._static is None else 'static'
        self.get_logger().info(f'ready: template {template!r} ({waits})')

    def _create_segmenter(self) -> Segmenter:
        parameters = self.filled(SegmentationParameters)
        own = self.filled(family_of(parameters).parameters)
        return create_segmenter(parameters, own, log=self.get_logger())

    def _on_image(self, message: ImageMessage) -> None:
        if self._static is None and self._board.is_empty:
            self.say(
                'waiting',
                'no prompt has arrived yet, but frames have: is prompt_generator running?',
            )
            return
        self._worker.offer(message)

    def _on_prompt(self, message: DiagnosticArray) -> None:
        try:
            prompt = prompt_from_message(message)
        except PeaceError as error:
            self._complain(error)
            return
        # A new sentence is embedded in another thread; frames use the last one until then.
        if prompt.template in self._prepared:
            self._board.put(prompt)
        else:
            self._preparer.offer(prompt)

    def _prepare(self, prompt: Prompt) -> None:
        self._pipeline.segmenter.prepare(prompt)
        self._prepared.add(prompt.template)
        self._board.put(prompt)

    def _prompt_for(self, at_ns: int) -> tuple[Prompt, bool] | None:
        """Return the prompt for a frame and whether it was made from that frame."""
        if self._static is not None:
            return self._static, True
        prompt = self._board.take(at_ns, self._options.prompt_timeout)
        return None if prompt is None else (prompt, prompt.stamp_ns == at_ns)

    def _segment(self, message: ImageMessage) -> None:
        chosen = self._prompt_for(stamp_ns_of(message))
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
        level, sentence = OK, 'running'
        if not own:
            age_s = (at_ns - prompt.stamp_ns) / 1e9
            level = WARN
            sentence = (
                f'no prompt for this frame within {self._options.prompt_timeout} s: using the one '
                f'made {age_s:.2f} s before it'
                if age_s > 0.0
                else f'the prompt generator skipped this frame: using the prompt made '
                f'{-age_s:.2f} s after it'
            )
            self.say('prompt', sentence)
        if work_s > _SLOW_S:
            level = WARN
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
        self._diagnostics_out.publish(diagnostic_array(at_ns, _NAME, level, sentence, values))

    def _complain(self, error: PeaceError) -> None:
        self.say(type(error).__name__, f'no heatmap: {error}')
        self._diagnostics_out.publish(
            diagnostic_array(self.clock_ns(), _NAME, ERROR, str(error), ())
        )

    def close(self) -> None:
        """Stop the workers."""
        self._board.close()
        self._preparer.close()
        self._worker.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(SegmentationNode, args)


if __name__ == '__main__':
    sys.exit(main())

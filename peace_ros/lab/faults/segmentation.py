# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ``segmentation`` node with a model that can fail: topic ``fault/model`` (String).

``slow SECONDS``, ``throws`` (an error that a network may give), ``breaks`` (a defect of ours),
anything else is a model that works.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from std_msgs.msg import String

from peace_ros.core.domain import BundleError, Frame, Heatmap, Prompt
from peace_ros.core.segmentation import Segmenter
from peace_ros.nodes.qos import RESULT
from peace_ros.nodes.runtime import run
from peace_ros.nodes.segmentation import SegmentationNode


class FailingSegmenter(Segmenter):
    """A real segmenter behind a fault."""

    def __init__(self, real: Segmenter) -> None:
        self._real = real
        self.terms = real.terms
        self.fault = ''

    def prepare(self, prompt: Prompt) -> None:
        """Embed the texts."""
        self._real.prepare(prompt)

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the real heatmap, late or not at all."""
        kind, _, argument = self.fault.partition(' ')
        if kind == 'slow':
            time.sleep(float(argument))
        elif kind == 'throws':
            raise BundleError('the network gave up, as the fault matrix asked: end the fault')
        elif kind == 'breaks':
            raise RuntimeError('a defect, as the fault matrix asked')
        return self._real.segment(frame, prompt)


class FailingSegmentationNode(SegmentationNode):
    """Fails as the topic ``fault/model`` says."""

    def __init__(self, **options: Any) -> None:
        self._failing: FailingSegmenter | None = None
        super().__init__(**options)
        self.create_subscription(String, 'fault/model', self._on_fault, RESULT)

    def _create_segmenter(self) -> Segmenter:
        self._failing = FailingSegmenter(super()._create_segmenter())
        return self._failing

    def _on_fault(self, message: String) -> None:
        if self._failing is not None:
            self._failing.fault = message.data


def main() -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(FailingSegmentationNode)


if __name__ == '__main__':
    sys.exit(main())

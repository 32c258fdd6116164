# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prompt generator and segmentation in one process.

An image is received and decoded once, only the images that segmentation works on are described, and
a prompt is handed on without a message.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.nodes.runtime import run
from peace_ros.nodes.segmentation import SegmentationNode
from peace_ros.nodes.sharing import SharedImages


def create_nodes() -> tuple[PeaceNode, ...]:
    """Create the nodes; segmentation subscribes to the images for both, and to no prompts.

    Raises:
        PeaceError: as each of the nodes.
    """
    images = SharedImages()
    segmentation = SegmentationNode(images=images, hears_prompts=False)
    try:
        return segmentation, PromptGeneratorNode(images=images, hand_over=segmentation.take_prompt)
    except BaseException:
        segmentation.close()
        segmentation.destroy_node()
        raise


def main(args: Sequence[str] | None = None) -> int:
    """Run the nodes until SIGINT or SIGTERM."""
    return run(create_nodes, args)


if __name__ == '__main__':
    sys.exit(main())

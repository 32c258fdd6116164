# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a camera frame to the prompt that describes it."""

from peace_ros.core.prompting.generator import Encoder, PromptGenerator, PromptingParameters
from peace_ros.core.prompting.templates import categories_of, resolve_template
from peace_ros.core.prompting.vocabulary import Vocabularies, load_vocabularies

__all__ = [
    'Encoder',
    'PromptGenerator',
    'PromptingParameters',
    'Vocabularies',
    'categories_of',
    'load_vocabularies',
    'resolve_template',
]

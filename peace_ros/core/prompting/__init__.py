# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a camera frame to the prompt that describes it."""

from peace_ros.core.prompting.generator import Encoder, PromptGenerator, PromptingParameters
from peace_ros.core.prompting.templates import TEMPLATES, categories_of, resolve_template
from peace_ros.core.prompting.vocabulary import CATEGORIES, Vocabularies, load_vocabularies

__all__ = [
    'CATEGORIES',
    'TEMPLATES',
    'Encoder',
    'PromptGenerator',
    'PromptingParameters',
    'Vocabularies',
    'categories_of',
    'load_vocabularies',
    'resolve_template',
]

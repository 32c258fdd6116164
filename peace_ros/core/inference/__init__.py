# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model bundles and the networks in them, run by ONNX Runtime."""

from peace_ros.core.inference.bundle import Bundle, FileEntry, InputSpec, Manifest
from peace_ros.core.inference.clip import ClipEncoder
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.providers import available_providers, check_providers
from peace_ros.core.inference.session import DEFAULT_PROVIDERS, Session, open_sessions
from peace_ros.core.inference.text_cache import TextCache
from peace_ros.core.inference.text_encoder import TextEncoder
from peace_ros.core.inference.tokenizer import Tokenizer, Tokens

__all__ = [
    'DEFAULT_PROVIDERS',
    'Bundle',
    'ClipEncoder',
    'FileEntry',
    'InputSpec',
    'Manifest',
    'Preprocessor',
    'Session',
    'TextCache',
    'TextEncoder',
    'Tokenizer',
    'Tokens',
    'available_providers',
    'check_providers',
    'open_sessions',
]

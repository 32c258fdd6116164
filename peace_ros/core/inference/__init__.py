# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model bundles and the networks in them, run by ONNX Runtime."""

from peace_ros.core.inference.bundle import Bundle
from peace_ros.core.inference.clip import ClipEncoder
from peace_ros.core.inference.preprocess import Preprocessor
from peace_ros.core.inference.session import Session, open_sessions
from peace_ros.core.inference.text_encoder import TextEncoder

__all__ = ['Bundle', 'ClipEncoder', 'Preprocessor', 'Session', 'TextEncoder', 'open_sessions']

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Errors in labelled images."""

from peace_ros.core.domain import ConfigurationError, PeaceError


class DatasetError(ConfigurationError):
    """Labelled images that the user gave and that cannot be scored."""


class SampleError(PeaceError):
    """One labelled image that cannot be scored; the others still can."""

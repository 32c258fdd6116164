# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One tree of errors; every message holds the value, the limit and the remedy."""


class PeaceError(Exception):
    """Root of everything that this package raises on purpose."""


class ConfigurationError(PeaceError):
    """A parameter, vocabulary, term list or preset that cannot be used."""


class BundleError(PeaceError):
    """A model bundle that is missing, damaged or of another shape than its manifest says."""


class ImageError(PeaceError):
    """A camera image that cannot be used: encoding, size or content."""


class VehicleError(PeaceError):
    """The autopilot cannot be reached, refuses, or says something that cannot be believed."""


class WorldError(PeaceError):
    """A simulated world that cannot be loaded or drawn."""


class RecordingError(PeaceError):
    """A bag or video that cannot be read or written."""

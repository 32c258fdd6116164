# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters with which a recorded landing flew, as the flight recorder writes them."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.records import Header, Metadata
from mcap.stream_reader import StreamReader

from peace_ros.core.presets import Preset

RECORDED = 'recorded'
_LIBRARY = 'peace_ros recorder'
_PREFIX = 'parameters/'
_UNREADABLE = (OSError, McapError, yaml.YAMLError, struct.error, ValueError, EOFError)


def recorded_preset(path: Path) -> Preset | None:
    """Return the parameters of a recording, None where it has none or is of another recorder.

    Raises:
        ConfigurationError: a parameter cannot be used by this version.
    """
    sections: dict[str, dict[str, Any]] = {}
    if path.suffix != '.mcap' or not path.is_file():
        return None
    try:
        with path.open('rb') as stream:
            # Chunks are not opened: metadata stands between them.
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Header) and record.library != _LIBRARY:
                    return None
                if isinstance(record, Metadata) and record.name.startswith(_PREFIX):
                    for section, values in yaml.safe_load(record.metadata['yaml']).items():
                        sections[section] = values['ros__parameters']
    except _UNREADABLE:
        pass  # a file that was cut: what stands before counts
    if not sections:
        return None
    preset = Preset(RECORDED, path, sections)
    preset.check()
    return preset

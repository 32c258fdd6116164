# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink 2 signing on the side of the simulated autopilot, by pymavlink's own implementation.

The companion has another one, so that each checks the other.
"""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import ConfigurationError

EPOCH_S = 1_420_070_400
"""1 January 2015, where the time stamps of signatures begin."""
KEY_BYTES = 32
LINK_ID = 1


class Signing:
    """Makes codecs that sign and refuse, or plain ones when there is no key."""

    def __init__(self, key_file: str) -> None:
        self._state: Any = None
        self.refused = 0
        """Messages without a signature, or with a wrong one."""
        if key_file:
            self._state = mavlink.MAVLinkSigning()
            self._state.secret_key = _read_key(key_file)
            self._state.sign_outgoing = True
            # It counts the refused ones only when it may ask whether to make an exception.
            self._state.allow_unsigned_callback = lambda _codec, _message_id: False
            self._state.link_id = LINK_ID
            self.keep_time()

    def keep_time(self) -> None:
        """Bring the time of the signatures to now; they count by themselves in between."""
        if self._state is not None:
            now = int((time.time() - EPOCH_S) * 1e5)
            self._state.timestamp = max(self._state.timestamp, now)

    def codec(self, system_id: int = 0, component_id: int = 0) -> Any:
        """Return a codec that skips damaged bytes."""
        codec = mavlink.MAVLink(None, system_id, component_id)
        codec.robust_parsing = True
        if self._state is not None:
            codec.signing = self._state
        return codec

    def parse(self, codec: Any, data: bytes) -> list[Any]:
        """Return the messages in some bytes, unreadable ones included (negative id)."""
        if self._state is None:
            return list(codec.parse_buffer(bytearray(data)) or [])
        state = self._state
        heard, accepted = dict(state.stream_timestamps), state.goodsig_count
        refused_before = state.reject_count
        try:
            return list(codec.parse_buffer(bytearray(data)) or [])
        finally:
            refused = state.reject_count - refused_before
            self.refused += refused
            if refused and state.goodsig_count == accepted:
                # pymavlink takes over the time of a forged message before it looks at the rest.
                state.stream_timestamps = heard


def _read_key(key_file: str) -> bytes:
    try:
        content = Path(key_file).expanduser().read_bytes()
    except OSError as error:
        raise ConfigurationError(f'signing_key_file {key_file}: {error.strerror}') from error
    return content if len(content) == KEY_BYTES else hashlib.sha256(content.strip()).digest()

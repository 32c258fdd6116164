# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MAVLink 2 message signing: key, time stamps that never go back, and the check of what comes.

Specification: https://mavlink.io/en/guide/message_signing.html. Differences on purpose: a time
stamp is remembered only after the signature was found right, and a new stream is measured against
the newest stamp that was ever received, not against our own clock, which a vehicle without GNSS
may not have set.
"""

from __future__ import annotations

import hashlib
import hmac
import threading
import time
from collections.abc import Callable
from pathlib import Path

from peace_ros.core.domain.errors import ConfigurationError

EPOCH_S = 1_420_070_400
"""1 January 2015 UTC, where the time stamps begin; they count units of 10 microseconds."""
KEY_BYTES = 32
SIGNATURE_BYTES = 13
SIGNED = 0x01
"""Incompatibility flag of a signed message."""
MAVLINK_2 = 0xFD
BEHIND = 60 * 100_000
"""A new stream may be this far behind what was received: one minute."""
AHEAD = 60 * 100_000
"""Written to the file ahead of what was sent, so that a sudden end loses nothing."""
SAVE_EVERY_S = 20.0
LINK_ID = 191
"""Tells our signatures from those of a ground station with the same key."""


def read_key(key_file: str) -> bytes:
    """Return the 32 bytes of a key.

    Args:
        key_file: A file of exactly 32 bytes is the key; anything else is a passphrase, whose
            SHA-256 is the key, as MAVProxy, Mission Planner and QGroundControl make it.

    Raises:
        ConfigurationError: The file cannot be read or is empty.
    """
    try:
        path = Path(key_file).expanduser()
        content = path.read_bytes()
    except (OSError, RuntimeError, ValueError) as error:  # RuntimeError: unknown user after ~
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigurationError(
            f'signing_key_file {key_file}: {reason}; give 32 bytes or a passphrase'
        ) from error
    if len(content) == KEY_BYTES:
        return content
    if not content.strip():
        raise ConfigurationError(f'signing_key_file {path} is empty: give 32 bytes or a passphrase')
    return hashlib.sha256(content.strip()).digest()


class Signer:
    """Signs what leaves and checks what comes, with one key; thread-safe.

    Args:
        key: 32 bytes.
        memory: File that keeps the newest time stamps over a restart; None: none.
        wall_s: Clock of the time stamps, seconds since 1970.
    """

    def __init__(
        self,
        key: bytes,
        memory: Path | None = None,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self._key = key
        self._memory = memory
        self._wall_s = wall_s
        self._lock = threading.Lock()
        self._sent, self._received = _remembered(memory)
        self._streams: dict[tuple[int, int, int], int] = {}
        self._save_due_s = 0.0
        self.unsigned = 0
        self.forged = 0
        """Signed with another key, damaged, or with a time stamp that was used before."""

    @classmethod
    def from_file(cls, key_file: str, system_id: int) -> Signer:
        """Read the key; time stamps are kept beside it in ``<key_file>.<system_id>.time``.

        Camera and companion share a key and not their time stamps: each has a file of its own.
        """
        path = Path(key_file).expanduser()
        return cls(read_key(key_file), path.with_name(f'{path.name}.{system_id}.time'))

    def sign(self, unsigned: bytes) -> bytes:
        """Sign a message whose header and checksum already announce a signature."""
        with self._lock:
            now = int((self._wall_s() - EPOCH_S) * 1e5)
            self._sent = max(self._sent + 1, self._received, now)
            stamp = self._sent
        signed = unsigned + bytes([LINK_ID]) + stamp.to_bytes(6, 'little')
        return signed + hashlib.sha256(self._key + signed).digest()[:6]

    def accepts(self, message: bytes, system: int, component: int) -> bool:
        """Return whether a whole MAVLink message has a valid signature."""
        signed = message[0] == MAVLINK_2 and bool(message[2] & SIGNED)
        with self._lock:
            if not signed:
                self.unsigned += 1
                return False
            good = self._is_right(message, system, component)
            self.forged += not good
            return good

    def _is_right(self, message: bytes, system: int, component: int) -> bool:
        expected = hashlib.sha256(self._key + message[:-6]).digest()[:6]
        if not hmac.compare_digest(expected, message[-6:]):
            return False
        stamp = int.from_bytes(message[-12:-6], 'little')
        stream = (message[-13], system, component)
        last = self._streams.get(stream)
        if stamp <= (self._received - BEHIND if last is None else last):
            return False
        self._streams[stream] = stamp
        self._received = max(self._received, stamp)
        return True

    def save(self, now_s: float, *, at_once: bool = False) -> None:
        """Write the time stamps now and then; a disk that fails costs only the memory."""
        if self._memory is None or (now_s < self._save_due_s and not at_once):
            return
        self._save_due_s = now_s + SAVE_EVERY_S
        with self._lock:
            line = f'{self._sent + AHEAD} {self._received}\n'
        fresh = self._memory.with_name(f'{self._memory.name}.new')
        try:
            fresh.write_text(line, encoding='ascii')
            fresh.replace(self._memory)
        except OSError:
            self._memory = None


def _remembered(memory: Path | None) -> tuple[int, int]:
    """Return the stamps of the file: last sent (and a margin), last received; zeros without."""
    if memory is None:
        return 0, 0
    try:
        sent, received = (int(each) for each in memory.read_text(encoding='ascii').split())
    except (OSError, ValueError):
        return 0, 0
    return max(0, sent), max(0, received)

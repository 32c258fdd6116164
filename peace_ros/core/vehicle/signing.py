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
SAVE_EVERY_S = 1.0
AHEAD = 150_000
"""Written to the file ahead of what was sent and received, so that a sudden end loses nothing."""
NEWEST = 2**48 - 1
LINK_ID = 191
"""Tells our signatures from those of a ground station with the same key."""


def read_key(key_file: str) -> bytes:
    """Return the 32 bytes of a key.

    Args:
        key_file: A file of exactly 32 bytes that are not printable text is the key; anything else
            is a passphrase, whose SHA-256 is the key, as MAVProxy, Mission Planner and
            QGroundControl make it.

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
    passphrase = content.strip()
    if len(content) == KEY_BYTES and not passphrase.decode('utf-8', 'replace').isprintable():
        return content
    if not passphrase:
        raise ConfigurationError(f'signing_key_file {path} is empty: give 32 bytes or a passphrase')
    return hashlib.sha256(passphrase).digest()


class Signer:
    """Signs what leaves and checks what comes, with one key; thread-safe.

    Args:
        key: 32 bytes.
        memory: File that keeps the newest time stamps over a restart; None: none.
        wall_s: Clock of the time stamps, seconds since 1970.

    Raises:
        ConfigurationError: The file with the time stamps is damaged.
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
        self._sent, self._received, self._streams = _remembered(memory)
        self._save_due_s = 0.0
        self.warning = ''
        """What a person should change, empty when nothing."""
        self.unsigned = 0
        self.forged = 0
        """Signed with another key, damaged, or with a time stamp that was used before."""

    @classmethod
    def from_file(cls, key_file: str, system_id: int) -> Signer:
        """Read the key; time stamps are kept beside it in ``<key_file>.<system_id>.time``.

        Camera and companion share a key and not their time stamps: each has a file of its own.
        """
        path = Path(key_file).expanduser()
        signer = cls(read_key(key_file), path.with_name(f'{path.name}.{system_id}.time'))
        mode = path.stat().st_mode & 0o777
        if mode & 0o077:
            signer.warning = (
                f'others may read or write the signing key {path} (mode {mode:o}): chmod 600 it'
            )
        return signer

    def sign(self, unsigned: bytes) -> bytes:
        """Sign a message whose header and checksum already announce a signature."""
        with self._lock:
            now = int((self._wall_s() - EPOCH_S) * 1e5)
            self._sent = min(max(self._sent + 1, self._received, now), NEWEST)
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
        """Write the time stamps now and then; a disk that fails costs only the memory.

        Stamps of a sudden end may lie ahead, and cost the first 1.5 s of messages afterwards.
        """
        if self._memory is None or (now_s < self._save_due_s and not at_once):
            return
        self._save_due_s = now_s + SAVE_EVERY_S
        ahead = 0 if at_once else AHEAD
        with self._lock:
            stamps = {(*each, stamp + ahead) for each, stamp in self._streams.items()}
            numbers = [(self._sent + AHEAD, self._received), *sorted(stamps)]
        lines = (' '.join(str(min(each, NEWEST)) for each in line) for line in numbers)
        fresh = self._memory.with_name(f'{self._memory.name}.new')
        try:
            fresh.write_text('\n'.join((*lines, '')), encoding='ascii')
            fresh.replace(self._memory)
        except OSError as error:
            self.warning = (
                f'the time stamps of signatures cannot be written to {self._memory} '
                f'({error.strerror}): after a restart old messages would be accepted'
            )
            self._memory = None


Stamps = dict[tuple[int, int, int], int]


def _remembered(memory: Path | None) -> tuple[int, int, Stamps]:
    """Return the stamps of the file: last sent (and a margin), last received, last per stream.

    Raises:
        ConfigurationError: It cannot be understood, so that old messages could be replayed.
    """
    try:
        if memory is None:
            return 0, 0, {}
        content = memory.read_text(encoding='ascii')
        sent, received, *rest = numbers = [int(word) for word in content.split()]
        for each in numbers:
            each.to_bytes(6, 'little')  # OverflowError beyond 48 bits
        streams = zip(*(rest[i::4] for i in range(4)), strict=True)
        return sent, received, {(a, b, c): stamp for a, b, c, stamp in streams}
    except FileNotFoundError:
        return 0, 0, {}
    except (OSError, ValueError, OverflowError) as error:
        raise ConfigurationError(
            f'{memory} holds no time stamps of 48 bits ({error}), so messages of earlier flights '
            'could be replayed: restore it, or set a new key on both sides and delete it'
        ) from error

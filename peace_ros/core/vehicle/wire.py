# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between bytes and messages: parsing that survives invalid bytes, packing, signatures."""

from __future__ import annotations

import threading
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.vehicle.signing import SIGNED, Signer

RADIO_STATUS = 109
"""Sent by the radio in between, which has no key; it contains nothing about the vehicle."""
CHECKSUM_BYTES = 2
_STARTS = (0xFD, 0xFE)
"""First byte of a message of MAVLink 2 and 1."""
_LONGEST_BYTES = 280
_MOST_SEARCHES = 1000
"""Per reading: bytes that all look like a start must not take all of the processor."""


class Wire:
    """One companion's codec.

    Args:
        system_id: Of this companion.
        datagrams: Data come as whole datagrams.
        signer: None: nothing is signed and nothing checked.
    """

    def __init__(self, system_id: int, signer: Signer | None, *, datagrams: bool) -> None:
        self._codec = mavlink.MAVLink(None, system_id, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._signer = signer
        self._datagrams = datagrams
        self._lock = threading.Lock()
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._rest = bytearray()

    @property
    def refused(self) -> tuple[int, int]:
        """Messages without a signature, and with one that is not valid."""
        return (0, 0) if self._signer is None else (self._signer.unsigned, self._signer.forged)

    @property
    def warning(self) -> str:
        """What a person should change of the signing, empty when nothing."""
        return '' if self._signer is None else self._signer.warning

    def restart(self) -> None:
        """Forget half a message: the line was opened anew."""
        self._rest = bytearray()

    def decode(self, data: bytes) -> list[Any]:
        """Return the messages; with signing, only those with a valid signature."""
        self._rest += data
        messages = [m for m in self._take_messages() if self._is_genuine(m)]
        if self._datagrams:
            # They are independent: invalid bytes in one must not hide the start of the next.
            self._rest.clear()
        return messages

    def pack(self, message: Any) -> bytes:
        """Return the bytes of a message, signed when there is a key."""
        with self._lock:
            data = bytes(message.pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
        return data if self._signer is None else self._signer.sign(_declared_signed(data, message))

    def keep(self, now_s: float, *, at_once: bool = False) -> None:
        """Keep the time stamps of signatures on disk."""
        if self._signer is not None:
            self._signer.save(now_s, at_once=at_once)

    def _take_messages(self) -> list[Any]:
        """Take the whole messages from what has arrived.

        A byte that only looks like the start of a message claims up to 279 bytes after it. When
        their checksum is wrong, the search goes on at the next byte, not after all of them.
        """
        found, at, searched = [], 0, 0
        while at < len(self._rest):
            self._parser.buf, self._parser.buf_index = bytearray(), 0
            message = self._parser.parse_char(self._rest[at : at + _LONGEST_BYTES])
            if message is None:
                # What is missing of a datagram does not follow: this was no start.
                if not self._datagrams or searched >= _MOST_SEARCHES:
                    break
                searched += 1
                at += 1
                continue
            if message.get_msgId() >= 0:
                found.append(message)
            elif self._rest[at] in _STARTS and searched < _MOST_SEARCHES:
                searched += 1
                at += 1
                continue
            at += len(message.get_msgbuf())
        del self._rest[:at]
        return found

    def _is_genuine(self, message: Any) -> bool:
        if self._signer is None or message.get_msgId() == RADIO_STATUS:
            return True
        return self._signer.accepts(
            bytes(message.get_msgbuf()), message.get_srcSystem(), message.get_srcComponent()
        )


def _declared_signed(data: bytes, message: Any) -> bytes:
    """Set the flag that a signature follows, and the checksum that belongs to it."""
    body = bytearray(data[:-CHECKSUM_BYTES])
    body[2] |= SIGNED
    checksum = mavlink.x25crc(bytes(body[1:]) + bytes([message.crc_extra]))
    return bytes(body) + int(checksum.crc).to_bytes(CHECKSUM_BYTES, 'little')

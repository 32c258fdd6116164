# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""RAW_IMU, SCALED_IMU and HIGHRES_IMU -> inertial samples with stamps of the node clock; pure."""

from __future__ import annotations

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain import InertialSample
from peace_ros.core.domain.geometry import GRAVITY_M_S2
from peace_ros.core.vehicle.clock import TimeMap

MESSAGES = ('RAW_IMU', 'SCALED_IMU', 'HIGHRES_IMU')
_KEPT = 512
"""Samples that nobody has taken yet: 5 s at 100 Hz."""
_NEEDED = 0b111 * int(mavlink.HIGHRES_IMU_UPDATED_XACC | mavlink.HIGHRES_IMU_UPDATED_XGYRO)
"""Of fields_updated: three axes of each, beside each other."""


class InertialIntake:
    """Keeps the samples until they are taken.

    A sample whose moment is not known on the node clock is dropped: rates that belong to another
    moment than the picture turn it wrongly.

    Args:
        clock: The autopilot's clock in terms of ours.
    """

    def __init__(self, clock: TimeMap) -> None:
        self._clock = clock
        self._samples: deque[InertialSample] = deque(maxlen=_KEPT)
        self.undated = 0
        """Samples that were dropped."""

    def take(self, m: Any, received_ns: int) -> None:
        """Take one of the messages.

        Args:
            m: Its values are in range.
            received_ns: Node clock at receipt.
        """
        fine = m.get_type() == 'HIGHRES_IMU'
        # Zero says that a sender does not fill in the field.
        if fine and m.fields_updated and not _has_new(m.fields_updated):
            return
        microseconds = m.time_boot_ms * 1000 if m.get_type() == 'SCALED_IMU' else m.time_usec
        stamp_ns = self._clock.moment_ns(microseconds * 1000, received_ns)
        if stamp_ns is None:
            self.undated += 1
            return
        # ArduPilot sends RAW_IMU, too, in mG and mrad/s.
        force, rates = (1.0, 1.0) if fine else (GRAVITY_M_S2 / 1000.0, 0.001)
        self._samples.append(
            InertialSample(
                stamp_ns,
                (rates * m.xgyro, rates * m.ygyro, rates * m.zgyro),
                (force * m.xacc, force * m.yacc, force * m.zacc),
            )
        )

    def drain(self) -> list[InertialSample]:
        """Return the samples since the last call, oldest first."""
        samples = list(self._samples)
        self._samples.clear()
        return samples


def _has_new(fields: int) -> bool:
    return not _NEEDED & ~fields

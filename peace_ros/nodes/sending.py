# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Set-points to the vehicle: the timed sender, from the first landing on."""

from __future__ import annotations

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.core.vehicle import SenderParameters, SetpointSender, VehicleLink
from peace_ros.nodes.node import PeaceNode


class Sending:
    """The sender of a landing node; before the first landing there is none, and nothing is sent.

    Args:
        node: says what cannot be sent, and fails with the sender's thread.
    """

    def __init__(self, node: PeaceNode) -> None:
        self._node = node
        self._sender: SetpointSender | None = None

    @property
    def state(self) -> str:
        """What the sender does, empty while there is none."""
        return '' if self._sender is None else self._sender.statistics().state.value

    def begin(self, link: VehicleLink) -> None:
        """Send what is submitted from now on."""
        if self._sender is None:
            parameters = self._node.filled(SenderParameters)
            self._sender = SetpointSender(link, parameters=parameters, on_defect=self._node.fail)
            self._sender.start()
        self._sender.resume()

    def submit(self, setpoint: Setpoint) -> None:
        """Send a set-point until the next one, while it is not too old."""
        if self._sender is None:
            return
        try:
            self._sender.submit(setpoint)
        except VehicleError as error:
            self._node.say('sender', str(error))

    def forget(self) -> None:
        """Forget the last set-point: nothing is sent until the next one."""
        if self._sender is not None:
            self._sender.resume()

    def watch(self) -> None:
        """Raise when the thread of the sender does not run."""
        if self._sender is not None:
            self._sender.watch()

    def stop(self) -> bool:
        """Send zero and then nothing; return whether there was a sender."""
        if self._sender is None:
            return False
        self._sender.stop()
        self._sender = None
        return True

    def halt(self) -> None:
        """Let a node that has failed send nothing but zero."""
        if self._sender is not None:
            self._sender.halt()

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What follows HANDOVER: hold, the autopilot's landing, or LANDING_TARGET for the next stage."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from peace_ros.core.domain import Site, Telemetry, VehicleError
from peace_ros.core.threads import GuardedThread, OnDefect
from peace_ros.core.vehicle import VehicleLink

_PERIOD_S = 0.1
_ATTEMPTS = 3
_PAUSE_S = 2.0


class AfterHandover:
    """Carries out one policy once per HANDOVER.

    Args:
        policy: ``hold``, ``land`` or ``landing_target``.
        say: Takes a sentence about the result.
        on_defect: Takes what ended the thread.
    """

    def __init__(
        self, policy: str, say: Callable[[str], None], on_defect: OnDefect | None = None
    ) -> None:
        self._policy, self._say, self._on_defect = policy, say, on_defect
        self._site: Site | None = None
        self._begun = False
        self._ended = threading.Event()
        self._due_s = 0.0
        self._asking = False
        self._refused = ''
        self._landing_mode = ''
        """Mode of the autopilot's landing, once it has begun."""
        self.stage = ''
        """What happens since the hand-over, in words; empty before it."""

    def follow(self, link: VehicleLink, site: Site | None, *, handed_over: bool) -> None:
        """Do what is due; never blocks.

        Args:
            link: The vehicle.
            site: The newest site, None when none is known now.
            handed_over: The state is HANDOVER.
        """
        if not handed_over:
            self._begun = False
            self._landing_mode = self._refused = self.stage = ''
            self._site = None
            self._ended.set()
            return
        self._site = site or self._site
        self.stage = self._stage(link.telemetry(), taken_over=link.taken_over)
        if self._policy == 'landing_target':
            self._point(link)
        elif self._policy == 'land' and not self._begun:
            self._begun, self._asking, ended = True, True, threading.Event()
            self._ended = ended
            GuardedThread(
                lambda: self._land(link, ended), 'after_handover', self._on_defect
            ).start()

    def end(self) -> None:
        """Ask for nothing any more."""
        self._ended.set()

    def _point(self, link: VehicleLink) -> None:
        now_s = time.monotonic()
        told = link.telemetry()
        site = self._site
        if now_s < self._due_s or site is None or told.pose is None:
            return
        self._due_s = now_s + _PERIOD_S
        ground_down_m = told.pose.down_m + told.pose.altitude_agl_m
        try:
            link.send_landing_target((site.north_m, site.east_m, ground_down_m), told.pose)
        except VehicleError as error:
            self._say(f'LANDING_TARGET was not sent: {error}')

    def _stage(self, told: Telemetry, *, taken_over: bool) -> str:
        mode = self._landing_mode
        if told.landed:
            return 'on the ground' if told.armed else 'on the ground, disarmed'
        if not told.armed:
            return 'disarmed'
        if taken_over or not (told.mode == mode if mode else told.in_control or self._asking):
            return f'mode {told.mode or "unknown"}: a pilot or a failsafe is in control'
        if mode:
            return f'LANDING by the autopilot in mode {mode}'
        if self._asking:
            return 'the autopilot is asked to land'
        return 'hovering over a safe site' + (f'; {self._refused}' if self._refused else '')

    def _land(self, link: VehicleLink, ended: threading.Event) -> None:
        self._request_land(link, ended)
        self._asking = False

    def _request_land(self, link: VehicleLink, ended: threading.Event) -> None:
        for _ in range(_ATTEMPTS):
            if ended.is_set():
                return
            try:
                result = link.request_land(lambda: not ended.is_set())
            except VehicleError as error:
                self._say(f'landing after the hand-over: {error}')
            else:
                if result:
                    self._landing_mode = link.telemetry().mode
                    self._say('handed over: the autopilot lands by itself')
                    return
                self._refused = f'landing {result.answer.value}: {result.reason}'
                self._say(f'handed over; {self._refused}')
            if ended.wait(_PAUSE_S):
                return

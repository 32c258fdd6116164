# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the altitude above ground can be relied on: it is compared with every other height.

The altitude that a landing flies by rests on one barometer, whose error the position filter follows
within seconds and without a jump. Other sources know other things: a rangefinder and the scale of
the pictures the height above ground, GNSS only how the height has changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf

from peace_ros.core.domain import HeightReport, Pose
from peace_ros.core.landing.parameters import LandingParameters

_ERRORS = 3.0
"""A source may differ by so many of its standard deviations more."""
_LEAST_LIMIT_M = 1.0
"""Barometers wander by so much, however low the vehicle is."""
_DOUBT_NS = 1_000_000_000
"""A difference that lasts for so long is no outlier."""
_AGREE_NS = 3_000_000_000
_AGREE = 0.7
"""Heights agree again within this part of the limit, for so long."""
_SETTLE_NS = 1_500_000_000
"""Longer than a picture needs to be measured: each source has been heard meanwhile."""


@dataclass(frozen=True)
class HeightSight:
    """What the other sources say of the altitude above ground."""

    problem: str = ''
    """Why the altitude cannot be relied on, empty when it can."""
    above_lowest_m: float = 0.0
    """Altitude minus the lowest height that is believed, 0 or more."""
    may_hand_over: bool = True
    """Every source that speaks agrees, for a while at the hand-over altitude."""
    heights_m: Mapping[str, float] = field(default_factory=dict)
    """Source -> height above ground."""


NO_OTHER_HEIGHT = HeightSight()


class _Source:
    """One of the other sources, since the engagement."""

    def __init__(self) -> None:
        self.doubt = ''
        """A sentence, empty while it agrees."""
        self._first_m: float | None = None
        """What it reported more than the altitude when it was first heard."""
        self._turned_ns: int | None = None
        """Since when it has spoken against the present doubt, or lack of one."""

    def height_m(self, report: HeightReport, altitude_m: float) -> float:
        """Return its height above ground; of one that knows only changes, since the first."""
        if report.above_ground:
            return report.height_m
        if self._first_m is None:
            self._first_m = report.height_m - altitude_m
        return report.height_m - self._first_m

    def judge(self, now_ns: int, off_m: float, limit_m: float, sentence: str) -> bool:
        """Renew the doubt, with hysteresis; return whether the heights agree at this moment."""
        turns = off_m <= _AGREE * limit_m if self.doubt else off_m > limit_m
        since_ns = self._turned_ns if turns and self._turned_ns is not None else now_ns
        self._turned_ns = since_ns if turns else None
        if turns and now_ns - since_ns >= (_AGREE_NS if self.doubt else _DOUBT_NS):
            self.doubt = '' if self.doubt else sentence
            self._turned_ns = None
        elif self.doubt:
            self.doubt = sentence
        return off_m <= limit_m

    def pause(self) -> None:
        """Say nothing at this moment: a doubt needs agreement without a gap to end."""
        if self.doubt:
            self._turned_ns = None


class HeightWatch:
    """Compares the altitude with all other heights."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self.begin()

    def begin(self) -> None:
        """Begin an engagement: changes count from now on."""
        self._sources: dict[str, _Source] = {}
        self._low_ns: int | None = None

    def see(
        self, now_ns: int, pose: Pose | None, reports: Iterable[HeightReport], *, over_site: bool
    ) -> HeightSight:
        """Compare fresh reports with the altitude of now; the doubt of a silent source stays.

        Args:
            now_ns: The clock of the landing.
            pose: None while there is no valid one.
            reports: Of the sources that speak.
            over_site: The ground below is a site, and level: elsewhere a rangefinder may measure
                a roof or a tree.
        """
        heights_m: dict[str, float] = {}
        altitude_m = 0.0 if pose is None else pose.altitude_agl_m
        heard: list[tuple[float, float]] = []
        agree = True
        for each in () if pose is None else reports:
            source = self._sources.setdefault(each.source, _Source())
            if each.is_narrow and not (over_site or source.doubt):
                continue
            height_m = heights_m[each.source] = source.height_m(each, altitude_m)
            heard.append((height_m, each.error_m))
            share_m = self._p.height_share * min(altitude_m, height_m)
            limit_m = max(_LEAST_LIMIT_M, share_m) + _ERRORS * each.error_m
            sentence = (
                f'the altitude above ground is {altitude_m:.1f} m by the autopilot and '
                f'{height_m:.1f} m by {each.source} (limit {limit_m:.1f} m apart): '
                'holding until they agree'
            )
            off_m = abs(height_m - altitude_m)
            agree &= source.judge(now_ns, off_m, limit_m, sentence)
        for name in self._sources.keys() - heights_m.keys():
            self._sources[name].pause()
        lowest_m = min(altitude_m, _lowest_m(heard))
        return HeightSight(
            problem='; '.join(each.doubt for each in self._sources.values() if each.doubt),
            above_lowest_m=altitude_m - lowest_m,
            may_hand_over=not heights_m or self._has_settled(now_ns, lowest_m, agree=agree),
            heights_m=heights_m,
        )

    def _has_settled(self, now_ns: int, lowest_m: float, *, agree: bool) -> bool:
        is_low = lowest_m <= self._p.handover_altitude_m + self._p.handover_tolerance_m
        if not (is_low and agree):
            self._low_ns = None
            return False
        if self._low_ns is None:
            self._low_ns = now_ns
        return now_ns - self._low_ns >= _SETTLE_NS


def _lowest_m(heard: list[tuple[float, float]]) -> float:
    """Return the lowest of heights with their standard errors, infinite without any.

    The most precise one counts one error higher than it says, the others three, so that noise
    does not lift a floor that a precise source confirms.
    """
    least_m = min((error_m for _, error_m in heard), default=0.0)
    shares = ((h, e if e == least_m else _ERRORS * e) for h, e in heard)
    return min((height_m + error_m for height_m, error_m in shares), default=inf)

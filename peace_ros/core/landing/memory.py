# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places that an engagement remembers: those that failed, and the best of those that did not."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from peace_ros.core.domain import Site
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.worth import Merits, worth

_SAME_PLACE_M = 10.0
_PLACES_LIMIT = 32


@dataclass(frozen=True)
class FailedPlace:
    """A circle on the ground in which no site is chosen."""

    north_m: float
    east_m: float
    radius_m: float
    until_ns: int
    failures: int = 1

    def covers(self, site: Site) -> bool:
        """Tell whether the middle of a site lies in the circle."""
        return hypot(site.north_m - self.north_m, site.east_m - self.east_m) <= self.radius_m


class SiteMemory:
    """Failures with their radius, which grows where they repeat, and the places seen besides."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._failed: list[FailedPlace] = []
        self._seen: list[Site] = []

    @property
    def failed(self) -> tuple[FailedPlace, ...]:
        """What is not forgiven yet."""
        return tuple(self._failed)

    def forgive(self, now_ns: int) -> None:
        """Drop what is older than the memory lasts."""
        self._failed = [each for each in self._failed if each.until_ns > now_ns]

    def fail(self, site: Site, now_ns: int) -> FailedPlace:
        """Remember a failure; one near to others takes their place with a larger radius."""
        p = self._p
        near = [each for each in self._failed if each.covers(site)]
        failures = 1 + sum(each.failures for each in near)
        # A field of 50 m is not lost for one person on it; that it failed twice is remembered.
        radius_m = max(p.failed_site_radius_m, min(site.clearance_m, p.ample_clearance_m))
        grown_m = min(
            p.failed_site_radius_limit_m, radius_m * p.failed_site_growth ** (failures - 1)
        )
        place = FailedPlace(
            site.north_m,
            site.east_m,
            max(radius_m, grown_m),
            now_ns + round(p.failed_site_memory_s * 1e9),
            failures,
        )
        # A larger circle around another middle need not cover the old one: it stays then.
        covered = [each for each in self._failed if _within(each, place)]
        self._failed = [each for each in self._failed if each not in covered]
        self._failed.append(place)
        return place

    def see(self, site: Site) -> None:
        """Remember a site as it was last seen."""
        self._seen = [
            each
            for each in self._seen
            if hypot(each.north_m - site.north_m, each.east_m - site.east_m) > _SAME_PLACE_M
        ][-_PLACES_LIMIT:]
        self._seen.append(site)

    def best(self) -> Site | None:
        """Return the best site seen that has not failed, None without one."""
        open_sites = [
            site for site in self._seen if not any(each.covers(site) for each in self._failed)
        ]
        return max(
            open_sites,
            key=lambda site: float(worth(Merits(site.clearance_m, site.confidence), self._p)),
            default=None,
        )


def _within(inner: FailedPlace, outer: FailedPlace) -> bool:
    apart_m = hypot(inner.north_m - outer.north_m, inner.east_m - outer.east_m)
    return apart_m + inner.radius_m <= outer.radius_m

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places remembered during an engagement: those that failed, and those seen besides."""

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
    """Failed places, whose radius grows where failures repeat, and every other site seen."""

    def __init__(self, parameters: LandingParameters) -> None:
        self._p = parameters
        self._failed: list[FailedPlace] = []
        self._seen: list[Site] = []

    @property
    def failed(self) -> tuple[FailedPlace, ...]:
        """Places that are excluded now."""
        return tuple(self._failed)

    @property
    def seen(self) -> tuple[Site, ...]:
        """Sites as they were seen last, failed ones too."""
        return tuple(self._seen)

    def forgive(self, now_ns: int) -> None:
        """Allow the places again whose time is over."""
        self._failed = [each for each in self._failed if each.until_ns > now_ns]

    def fail(self, site: Site, now_ns: int) -> FailedPlace:
        """Exclude a place that failed; where others failed before, with a larger radius."""
        p = self._p
        near = [each for each in self._failed if each.covers(site)]
        failures = 1 + sum(each.failures for each in near)
        # One person on a field of 50 m does not exclude all of it; a second failure excludes more.
        radius_m = max(p.failed_site_radius_m, min(site.clearance_m, p.ample_clearance_m))
        grown_m = radius_m * p.failed_site_growth ** (failures - 1)
        grown_m = max(radius_m, min(p.failed_site_radius_limit_m, grown_m))
        until_ns = now_ns + round(p.failed_site_memory_s * 1e9)
        place = FailedPlace(site.north_m, site.east_m, grown_m, until_ns, failures)
        # An old circle that the new one does not cover stays.
        self._failed = [each for each in self._failed if not _within(each, place)] + [place]
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

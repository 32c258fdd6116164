# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds what of a plan lies in a window, so that a large place can be drawn in small parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from peace_ros.simulation.drawing.plan import Building, Plan, Thing, Tree
from peace_ros.simulation.drawing.window import DrawnWindow

_BEYOND_PX = 2.0
"""Things are drawn this far beyond their outline at most."""

_Item = TypeVar('_Item')


class PlanIndex:
    """Bounding boxes of everything in a plan, which must be complete.

    Args:
        plan: of the whole place.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._grounds = _Boxes([g.low_m for g in plan.grounds], [g.high_m for g in plan.grounds])
        self._buildings = _around(plan.buildings)
        self._trees = _around(plan.trees)
        self._things = _around(plan.things)
        starts = np.array([each.start_m for each in plan.barriers]).reshape(-1, 2)
        ends = np.array([each.end_m for each in plan.barriers]).reshape(-1, 2)
        wide = np.array([each.width_m for each in plan.barriers]).reshape(-1, 1)
        self._barriers = _Boxes(np.minimum(starts, ends) - wide, np.maximum(starts, ends) + wide)
        quads = plan.quads()
        self._painted = _Boxes(quads.min(axis=1), quads.max(axis=1))

    def within(self, window: DrawnWindow) -> Plan:
        """Return the plan of what may show in a window, in the same order."""
        plan = self._plan
        return replace(
            plan,
            grounds=self._grounds.chosen(plan.grounds, window),
            buildings=self._buildings.chosen(plan.buildings, window),
            trees=self._trees.chosen(plan.trees, window),
            things=self._things.chosen(plan.things, window),
            barriers=self._barriers.chosen(plan.barriers, window),
            painted=self._painted.chosen(plan.painted, window),
        )


class _Boxes:
    """Lower and higher corners (x, y) of items, in metres, N x 2."""

    def __init__(
        self,
        low_m: NDArray[np.float64] | Sequence[NDArray[np.float64]],
        high_m: NDArray[np.float64] | Sequence[NDArray[np.float64]],
    ) -> None:
        self._low_m = np.asarray(low_m, float).reshape(-1, 2)
        self._high_m = np.asarray(high_m, float).reshape(-1, 2)

    def chosen(self, items: Sequence[_Item], window: DrawnWindow) -> list[_Item]:
        """Return the items whose boxes touch a window."""
        beyond_m = _BEYOND_PX * window.gsd_m
        seen = (self._low_m - beyond_m < (window.right_m, window.bottom_m)).all(axis=1)
        seen &= (self._high_m + beyond_m > (window.left_m, window.top_m)).all(axis=1)
        return [items[at] for at in np.flatnonzero(seen).tolist()]


def _around(items: Sequence[Building | Tree | Thing]) -> _Boxes:
    """Return the boxes around the outer circles of items."""
    centres = np.array([(each.x_m, each.y_m) for each in items]).reshape(-1, 2)
    reach = np.array([_reach_m(each) for each in items]).reshape(-1, 1)
    return _Boxes(centres - reach, centres + reach)


def _reach_m(item: Building | Tree | Thing) -> float:
    if isinstance(item, Tree):
        return 0.5 * item.diameter_m
    return 0.5 * float(np.hypot(item.length_m, item.width_m))

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the ground truth says of a place: the judge of a demo, unknown to the vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from peace_ros.core.domain import Label, Pose, is_safe
from peace_ros.simulation.camera import NadirCamera

_LEAST_LABELLED = 0.5
"""With less of the circle labelled, the truth has no opinion."""


@dataclass(frozen=True)
class GroundVerdict:
    """Ground truth of one point."""

    safe: bool | None
    """All that is labelled within the radius is safe; None where too little is labelled."""
    clearance_m: float | None
    """To the nearest ground that is not labelled safe; None where nothing is."""


NO_TRUTH = GroundVerdict(None, None)


def judge(camera: NadirCamera, pose: Pose, radius_m: float) -> GroundVerdict:
    """Judge the ground in a circle below a vehicle; beyond its edge the world is mirrored."""
    labels = camera.labels_at(pose.north_m, pose.east_m, radius_m)
    if labels is None or float(np.mean(labels != Label.UNLABELED)) < _LEAST_LABELLED:
        return NO_TRUTH
    unsafe = (labels != Label.UNLABELED) & ~is_safe(labels)
    clearance_m = camera.clearance_m(pose.north_m, pose.east_m)
    known = clearance_m is not None and isfinite(clearance_m)
    return GroundVerdict(not bool(unsafe.any()), clearance_m if known else None)

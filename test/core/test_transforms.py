# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mount of a camera out of the static transforms of a vehicle."""

from __future__ import annotations

from types import SimpleNamespace as Fields

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.geometry import mount_from_degrees
from peace_ros.core.transforms import StaticTransforms

HALF = 0.5**0.5
NADIR_OPTICAL = (0.0, HALF, -HALF, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def transform(parent: str, child: str, q=LEVEL, at=(0.0, 0.0, 0.0)) -> Fields:
    w, x, y, z = q
    return Fields(
        header=Fields(frame_id=parent),
        child_frame_id=child,
        transform=Fields(
            translation=Fields(x=at[0], y=at[1], z=at[2]), rotation=Fields(w=w, x=x, y=y, z=z)
        ),
    )


def tree(*transforms: Fields) -> StaticTransforms:
    found = StaticTransforms()
    for each in transforms:
        found.add(Fields(transforms=[each]))
    return found


def test_a_chain_is_followed_from_the_camera_up_to_the_vehicle() -> None:
    """A mast 1 m ahead that is turned to the left, with a camera 0.5 m ahead on it."""
    left = (HALF, 0.0, 0.0, HALF)
    found = tree(
        transform('/base_link', 'mast', left, (1.0, 0.0, 0.2)),
        transform('mast', 'camera', LEVEL, (0.5, 0.0, 0.0)),
        transform('camera', 'camera_optical', NADIR_OPTICAL),
        transform('map', 'base_link', LEVEL, (100.0, 0.0, 0.0)),
    ).mount('base_link', '/camera_optical')
    assert found.offset_frd_m == pytest.approx((1.0, -0.5, -0.2))
    expected = mount_from_degrees((0.0, 0.0, -90.0), (0.0, 0.0, 0.0)).quaternion
    assert found.quaternion == pytest.approx(expected)


@pytest.mark.parametrize(
    ('transforms', 'optical', 'ends'),
    [
        ([], 'camera_optical', 'camera_optical'),
        ([transform('camera', 'camera_optical')], 'camera_optical', 'camera'),
        ([transform('a', 'b'), transform('b', 'a')], 'a', 'a'),
        ([], '', r'\(no name\)'),
    ],
)
def test_a_chain_that_does_not_reach_the_vehicle_says_where_it_ends(
    transforms: list[Fields], optical: str, ends: str
) -> None:
    with pytest.raises(ConfigurationError, match=f'ends at {ends}, not at base_link'):
        tree(*transforms).mount('base_link', optical)


def test_a_rotation_that_is_none_is_refused() -> None:
    for q in ((0.0, 0.0, 0.0, 0.0), (float('nan'), 0.0, 0.0, 0.0)):
        with pytest.raises(ConfigurationError, match='quaternion'):
            tree(transform('base_link', 'camera', q)).mount('base_link', 'camera')

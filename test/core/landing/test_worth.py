# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a place is worth: each criterion by itself decides between places that are else equal."""

from dataclasses import fields, replace
from math import inf

import numpy as np
import pytest

from peace_ros.core.landing import LandingParameters
from peace_ros.core.landing.worth import CRITERIA, Merits, worth

P = LandingParameters()
LAWN = Merits(clearance_m=8.0, confidence=0.9, half_width_m=5.0, compactness=0.6, distance_m=30.0)


def test_the_worth_is_the_product_of_all_criteria():
    # 8 x (1 - 3 / 9) x 0.92 x 0.81 / 2
    assert worth(LAWN, P) == pytest.approx(8.0 * (2.0 / 3.0) * 0.92 * 0.81 * 0.5)


@pytest.mark.parametrize(
    ('better', 'worse'),
    [
        ({'clearance_m': 8.1}, {}),
        ({}, {'clearance_m': 7.9}),
        ({'half_width_m': 5.1}, {}),
        ({'half_width_m': inf}, {'half_width_m': 100.0}),
        ({'compactness': 0.61}, {}),
        ({'confidence': 0.91}, {}),
        ({'distance_m': 29.0}, {}),
        # What weighs more: half a metre of clearance, or doubt, way, and the shape of a lawn.
        ({'clearance_m': 9.0, 'distance_m': 35.0}, {}),
        ({}, {'clearance_m': 9.0, 'distance_m': 40.0}),
        ({}, {'clearance_m': 9.0, 'confidence': 0.84}),
        ({'clearance_m': 9.0, 'confidence': 0.86}, {}),
        ({'clearance_m': 9.0, 'compactness': 0.1}, {}),
        ({'half_width_m': 6.0, 'compactness': 0.5}, {}),
    ],
)
def test_each_criterion_orders_places(better, worse):
    assert worth(replace(LAWN, **better), P) > worth(replace(LAWN, **worse), P)


def test_more_than_ample_clearance_is_worth_no_more():
    ample = replace(LAWN, clearance_m=P.ample_clearance_m)
    assert worth(replace(ample, clearance_m=50.0), P) == worth(ample, P)
    assert worth(replace(ample, clearance_m=11.9), P) < worth(ample, P)


@pytest.mark.parametrize(
    ('name', 'merits', 'factor'),
    [
        ('clearance', {'clearance_m': 0.0}, 0.0),
        ('clearance', {'clearance_m': 12.5}, 12.0),
        ('width', {'half_width_m': 0.0}, 0.25),
        ('width', {'half_width_m': 2.0}, 0.5),
        ('width', {'half_width_m': inf}, 1.0),
        ('compactness', {'compactness': 0.0}, 0.8),
        ('compactness', {'compactness': 1.0}, 1.0),
        ('confidence', {'confidence': 0.5}, 0.25),
        ('nearness', {'distance_m': 0.0}, 1.0),
        ('nearness', {'distance_m': 30.0}, 0.5),
        ('nearness', {'distance_m': 60.0}, 1.0 / 3.0),
    ],
)
def test_exact_factors(name, merits, factor):
    (criterion,) = (each for each in CRITERIA if each.name == name)
    assert criterion.factor(replace(LAWN, **merits), P) == pytest.approx(factor)


def test_what_is_not_known_speaks_neither_for_nor_against_a_place():
    assert worth(Merits(8.0), P) == pytest.approx(8.0)
    assert worth(Merits(8.0, 0.9), P) == pytest.approx(8.0 * 0.81)


def test_there_is_a_criterion_for_every_merit_and_arrays_give_what_numbers_give():
    assert len(CRITERIA) == len(fields(Merits))
    north = np.array([[0.0], [1.0]], np.float32)
    many = worth(replace(LAWN, clearance_m=north + 8.0, distance_m=np.array([[30.0, 60.0]])), P)
    assert many.shape == (2, 2)
    assert many.dtype == np.float32
    assert many[0, 0] == pytest.approx(worth(LAWN, P))
    assert many[1, 1] == pytest.approx(worth(replace(LAWN, clearance_m=9.0, distance_m=60.0), P))

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nouns refuse what cannot be true, in one sentence."""

from dataclasses import dataclass

import numpy as np
import pytest

from peace_ros.core.domain import (
    Camera,
    ConfigurationError,
    Frame,
    Heatmap,
    ImageError,
    Label,
    Prompt,
    Setpoint,
    is_safe,
)
from peace_ros.core.domain.parameters import ParameterSet, describe, parameter


@pytest.mark.parametrize(
    'image',
    [
        np.zeros((4, 4), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4, 4, 3), np.float32),
    ],
)
def test_a_frame_is_a_non_empty_rgb_image(image: np.ndarray) -> None:
    with pytest.raises(ImageError, match=r'uint8 RGB'):
        Frame(image, 0)


def test_a_heatmap_is_two_dimensional_float32() -> None:
    with pytest.raises(ImageError, match='float32'):
        Heatmap(np.zeros((4, 4)), 0)


@pytest.mark.parametrize(('width', 'fov'), [(0, 73.0), (352, 0.0), (352, 180.0)])
def test_a_camera_needs_pixels_and_a_field_of_view(width: int, fov: float) -> None:
    with pytest.raises(ConfigurationError):
        Camera.from_degrees(width, 352, fov)


def test_a_prompt_fills_in_the_term_and_refuses_a_template_without_one() -> None:
    prompt = Prompt('A rendered image of {term} in spring.', 1)
    assert prompt.text_for('grass') == 'A rendered image of grass in spring.'
    with pytest.raises(ConfigurationError, match='lacks'):
        Prompt('A photo.', 1)


def test_only_grass_and_bare_ground_are_safe_and_the_unknown_is_not() -> None:
    labels = np.arange(10, dtype=np.uint8)
    assert set(np.flatnonzero(is_safe(labels))) == {Label.GRASS, Label.BARE_GROUND}


def test_zero_is_exactly_zero() -> None:
    assert Setpoint(5).is_zero
    assert not Setpoint(5, v_down_m_s=1e-12).is_zero


@dataclass(frozen=True)
class _Parameters(ParameterSet):
    gain: float = parameter(0.5, 'Proportional gain.', unit='1/s', low=0.0, high=2.0)
    mode: str = parameter('a', 'Which.', choices=('a', 'b'))


def test_parameters_know_their_unit_and_bounds() -> None:
    gain, mode = describe(_Parameters)
    assert (gain.name, gain.default, gain.unit, gain.low, gain.high) == (
        'gain',
        0.5,
        '1/s',
        0.0,
        2.0,
    )
    assert mode.choices == ('a', 'b')


@pytest.mark.parametrize(
    'bad', [{'gain': -0.1}, {'gain': 2.1}, {'gain': float('nan')}, {'mode': 'c'}]
)
def test_a_parameter_out_of_bounds_is_refused_with_its_value(bad: dict) -> None:
    with pytest.raises(ConfigurationError, match=str(next(iter(bad.values())))):
        _Parameters(**bad)

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the map of safe ground."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.domain.parameters import ParameterSet, parameter


@dataclass(frozen=True)
class MapParameters(ParameterSet):
    """Size, evidence and memory of a :class:`~peace_ros.core.mapping.SafetyMap`."""

    map_cell_m: float = parameter(0.5, 'Edge of a map cell.', low=0.1, high=5.0)
    map_size_m: float = parameter(
        240.0, 'Edge of the square window that follows the vehicle.', low=20.0, high=1000.0
    )
    neutral_score: float = parameter(
        0.5, 'Heatmap value that is evidence for neither safe nor unsafe.', low=0.05, high=0.95
    )
    look_limit: float = parameter(
        1.5, 'Largest evidence of one look, in log-odds.', unit='nat', low=0.1, high=5.0
    )
    unsafe_weight: float = parameter(
        1.5, 'Weight of evidence for unsafe against evidence for safe.', low=1.0, high=10.0
    )
    safe_limit: float = parameter(
        4.0, 'Log-odds at which evidence for safe saturates.', unit='nat', low=1.0, high=10.0
    )
    unsafe_limit: float = parameter(
        4.0, 'Log-odds at which evidence for unsafe saturates.', unit='nat', low=1.0, high=10.0
    )
    repeat_limit: float = parameter(
        5.0,
        'Equal looks at one place count at most as this many independent ones.',
        low=1.0,
        high=20.0,
    )
    independent_after_s: float = parameter(
        0.4, 'Frames closer in time than this count less.', low=0.0, high=10.0
    )
    safe_half_life_s: float = parameter(
        20.0, 'Evidence for safe halves in this time.', low=1.0, high=600.0
    )
    unsafe_half_life_s: float = parameter(
        60.0, 'Evidence for unsafe halves in this time.', low=1.0, high=3600.0
    )
    border_fraction: float = parameter(
        0.03, 'Part of the image at each edge that is ignored.', low=0.0, high=0.4
    )
    off_nadir_limit_deg: float = parameter(
        60.0, 'Rays that slant more than this are ignored.', low=5.0, high=80.0
    )

    tilt_limit_deg: float = parameter(
        40.0, 'Frames are rejected while the camera tilts more than this.', low=5.0, high=80.0
    )
    fine_memory_s: float = parameter(
        60.0,
        'Half-life of the resolution of a cell: until then a coarser look cannot make ground safe '
        'that a finer look called unsafe.',
        low=1.0,
        high=3600.0,
    )
    # What moves in
    veto_score: float = parameter(
        0.25,
        'A heatmap value up to this is clearly unsafe and closes ground at once.',
        low=0.0,
        high=0.45,
    )
    veto_blob_m: float = parameter(
        0.3,
        'Smallest width of a clearly unsafe blob that closes ground (a person from above); at '
        'least two pixels.',
        low=0.0,
        high=5.0,
    )
    veto_pixel_m: float = parameter(
        0.35,
        'With larger pixels on the ground nothing is closed at once: they do not tell a person '
        'from noise. Their evidence still counts.',
        low=0.01,
        high=5.0,
    )
    clear_score: float = parameter(
        0.6,
        'A look of at least this heatmap value helps to open closed ground.',
        low=0.5,
        high=0.95,
    )
    veto_looks: int = parameter(
        3, 'Looks that open closed ground again, none of them coarser.', low=1, high=100
    )
    veto_s: float = parameter(
        1.0,
        'Ground stays closed this long after the last clearly unsafe look, times the number of '
        'such looks (up to 5).',
        low=0.0,
        high=120.0,
    )
    # Flatness, where depth is given
    depth_smoothness_m: float = parameter(
        0.5,
        'With depth: ground is closed while its heights deviate by more than this (DOVESEI: 0.5).',
        low=0.01,
        high=10.0,
    )
    depth_range_m: float = parameter(
        20.0,
        'With depth: range of the sensor; larger values are ignored (DOVESEI: 20).',
        low=0.5,
        high=200.0,
    )
    flat_width_m: float = parameter(
        3.0, 'With depth: width of the ground over which heights are compared.', low=0.5, high=20.0
    )
    # Without position
    position_gap_limit_s: float = parameter(
        3.0, 'The map is dropped when the position is unknown for this long.', low=0.5, high=60.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.clear_score < self.neutral_score:
            raise ConfigurationError(
                f'parameter clear_score = {self.clear_score} must not be below neutral_score = '
                f'{self.neutral_score}: unsafe ground would be opened'
            )

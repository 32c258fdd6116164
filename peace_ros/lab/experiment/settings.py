# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an experiment is asked to fly."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

from peace_ros import __version__
from peace_ros.core.domain import ConfigurationError
from peace_ros.core.presets import load_preset
from peace_ros.lab.experiment.flight import LIMIT_S, Perception
from peace_ros.lab.experiment.places import Place

POLICIES = ('ours', 'dovesei')
EYES = ('model', 'truth')
CONFIGURATIONS = ('dd_cs', 'd_cs', 'peace_cs', 'dd_fs', 'd_fs', 'peace_fs')
"""The six of the paper."""
_FORMAT = 1


@dataclass(frozen=True)
class ExperimentSettings:
    """Runs of each configuration with each policy, from the same starts."""

    runs: int
    configurations: tuple[str, ...] = ('peace_cs',)
    """Presets by name, or parameter files."""
    policies: tuple[str, ...] = ('ours',)
    eyes: str = 'model'
    error_rate: float = 0.0
    """With eyes of the truth: share of the ground that each heatmap shows wrongly."""
    places: tuple[Place, ...] = (Place(),)
    """Run N flies over place N modulo their number."""
    seed: int = 1
    perception: Perception = field(default_factory=Perception)
    limit_s: float = LIMIT_S

    def __post_init__(self) -> None:
        _within('--runs', self.runs, 1, 100_000)
        _within('--seed', self.seed, 0, 10_000)
        _within('--rate', self.perception.rate_hz, 0.1, 50.0, 'heatmaps per second')
        _within('--latency', self.perception.latency_s, 0.0, 10.0, 'seconds')
        _within('--limit', self.limit_s, 10.0, 7200.0, 'seconds')
        _within('--error-rate', self.error_rate, 0.0, 0.45)
        for name, values, known in (
            ('--policy', self.policies, POLICIES),
            ('--eyes', (self.eyes,), EYES),
        ):
            if not values or (unknown := set(values) - set(known)):
                given = ', '.join(sorted(unknown)) if values else 'nothing'
                raise ConfigurationError(f'{name} {given}: choose among {", ".join(known)}')
        if not self.configurations:
            raise ConfigurationError(
                f'--configs names none: choose among {", ".join(CONFIGURATIONS)}, or give files'
            )
        if self.error_rate and self.eyes != 'truth':
            raise ConfigurationError(
                f'--error-rate {self.error_rate} belongs to --eyes truth: give both'
            )
        for name in self.configurations:
            load_preset(name)

    def place_of(self, run: int) -> Place:
        """Return the world of a run."""
        return self.places[run % len(self.places)]

    def flights_of(self, run: int) -> Iterator[FlightKey]:
        """Yield every flight from the start of a run."""
        for configuration in self.configurations:
            for policy in self.policies:
                yield FlightKey(run, load_preset(configuration).name, policy)

    def identity(self) -> dict[str, Any]:
        """Return what all flights of one file have in common; more may be added to it."""
        return {
            'format': _FORMAT,
            'version': __version__,
            'eyes': self.eyes,
            'error_rate': self.error_rate,
            'places': [asdict(each) for each in self.places],
            'seed': self.seed,
            'rate_hz': self.perception.rate_hz,
            'latency_s': self.perception.latency_s,
            'limit_s': self.limit_s,
        }

    def fingerprints(self) -> dict[str, str]:
        """Return preset name -> checksum of its file."""
        presets = [load_preset(each) for each in self.configurations]
        return {each.name: hashlib.sha256(each.path.read_bytes()).hexdigest() for each in presets}


@dataclass(frozen=True)
class FlightKey:
    """Which flight of an experiment."""

    run: int
    configuration: str
    policy: str


def _within(name: str, value: float, low: float, high: float, unit: str = '') -> None:
    if not low <= value <= high:
        raise ConfigurationError(f'{name} {value}: give {low:g} to {high:g} {unit}'.rstrip())

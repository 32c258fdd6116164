# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The flights of an experiment in one Parquet file: a row for each, which pandas opens.

The file is written whole after each run and then takes the place of the one before, so that
neither an interruption nor a full disk loses a finished run.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from peace_ros.core.domain import ConfigurationError, RecordingError
from peace_ros.lab.experiment.settings import ExperimentSettings, FlightKey
from peace_ros.recording.run_folder import write_whole

NAME = 'flights.parquet'
_IDENTITY, _FINGERPRINTS = b'peace_ros.experiment', b'peace_ros.presets'
_TEXT, _NUMBER, _COUNT, _NUMBERS = pa.string(), pa.float64(), pa.int64(), pa.list_(pa.float32())
SCHEMA = pa.schema(
    [
        ('run', _COUNT),
        ('configuration', _TEXT),
        ('policy', _TEXT),
        ('world', _TEXT),
        ('world_seed', _COUNT),
        ('start_east_m', _NUMBER),
        ('start_north_m', _NUMBER),
        ('start_heading_rad', _NUMBER),
        ('result', _TEXT),
        ('hazard', _TEXT),
        ('no_zone_right', pa.bool_()),
        ('reason', _TEXT),
        ('time_s', _NUMBER),
        ('horizontal_distance_m', _NUMBER),
        ('clearance_m', _NUMBER),
        ('nearest_person_m', _NUMBER),
        ('attempts', _COUNT),
        ('heatmaps', _COUNT),
        ('miou', _NUMBER),
        ('state_s', pa.map_(_TEXT, _NUMBER)),
        ('track_time_s', _NUMBERS),
        ('track_east_m', _NUMBERS),
        ('track_north_m', _NUMBERS),
        ('track_altitude_m', _NUMBERS),
        ('track_state', pa.list_(_TEXT)),
        ('end_quaternion_ned_frd', _NUMBERS),
        ('core_s', _NUMBER),
        ('wall_s', _NUMBER),
    ]
)
"""Positions are metres from the start; `core_s` is time of the processor, drawing included."""

Row = dict[str, Any]


class FlightStore:
    """The file of an experiment.

    Args:
        folder: of the experiment; created when missing.
        settings: what is flown into it.

    Raises:
        RecordingError: the file is damaged, or the folder cannot be used.
        ConfigurationError: it holds flights of other settings.
    """

    def __init__(self, folder: Path, settings: ExperimentSettings) -> None:
        self.path = folder / NAME
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(
                f'folder {folder} cannot be used ({error.strerror}): give another --out'
            ) from error
        identity, presets = settings.identity(), settings.fingerprints()
        self._table = SCHEMA.empty_table()
        if self.path.exists():
            self._table = read_flights(self.path)
            presets = self._checked(identity, presets)
        self._metadata = {
            _IDENTITY: json.dumps(identity).encode(),
            _FINGERPRINTS: json.dumps(presets).encode(),
        }

    @property
    def finished(self) -> set[FlightKey]:
        """The flights that the file holds."""
        columns = self._table.select(['run', 'configuration', 'policy']).to_pydict()
        return {FlightKey(*each) for each in zip(*columns.values(), strict=True)}

    def rows(self) -> list[Row]:
        """Return all flights."""
        rows: list[Row] = self._table.to_pylist()
        return rows

    def add(self, rows: list[Row]) -> None:
        """Keep finished flights.

        Raises:
            RecordingError: the disk is full or the folder is gone; what it held before is kept.
        """
        self._table = pa.concat_tables([self._table, pa.Table.from_pylist(rows, SCHEMA)])
        content = io.BytesIO()
        pq.write_table(
            self._table.replace_schema_metadata(self._metadata), content, compression='zstd'
        )
        write_whole(self.path, content.getvalue(), 'flights')

    def _checked(self, identity: Row, presets: dict[str, str]) -> dict[str, str]:
        """Return the presets of the file and the new ones; refuse those of another kind."""
        held = read_identity(self.path)
        for name, value in identity.items():
            if held.get(name) != value:
                raise ConfigurationError(
                    f'{self.path} was flown with {name} = {held.get(name)}, and now it is {value}: '
                    'give another --out, or the same options'
                )
        known: dict[str, str] = json.loads(pq.read_schema(self.path).metadata[_FINGERPRINTS])
        for name, checksum in presets.items():
            if known.get(name, checksum) != checksum:
                raise ConfigurationError(
                    f'{self.path} was flown with other values of preset {name}: give another --out'
                )
        return {**known, **presets}


def read_flights(path: Path) -> pa.Table:
    """Read the file of an experiment.

    Raises:
        RecordingError: it is missing, cut or no such file.
    """
    try:
        table = pq.read_table(path)
    except FileNotFoundError as error:
        raise RecordingError(
            f'{path} does not exist: run peace experiment --out {path.parent} first'
        ) from error
    except (OSError, pa.ArrowInvalid) as error:
        raise RecordingError(
            f'{path} is damaged or no Parquet file: move it away and fly the runs again'
        ) from error
    if not table.schema.equals(SCHEMA):
        raise RecordingError(
            f'{path} has other columns than an experiment of this version: move it away'
        )
    return table


def read_identity(path: Path) -> Row:
    """Return what all flights of a file have in common: see ExperimentSettings.identity.

    Raises:
        RecordingError: it is no file of an experiment.
    """
    metadata = pq.read_schema(path).metadata or {}
    if _IDENTITY not in metadata:
        raise RecordingError(f'{path} is no file of an experiment: give another folder')
    identity: Row = json.loads(metadata[_IDENTITY])
    return identity

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace doctor``."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from peace_ros.cli.extras import how_to_install
from peace_ros.core.domain import ConfigurationError, VehicleError
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.core.presets import DEFAULT_PRESET, Preset, load_preset
from peace_ros.core.vehicle import VehicleParameters, check_access
from peace_ros.lab.doctor.finding import CheckResult, Finding
from peace_ros.lab.doctor.run import DoctorOptions, as_json, examine, needs_mending
from peace_ros.recording.run_folder import write_whole

EXIT_MEND = 1
_MARKS = {
    CheckResult.OK: Text('OK', style='green'),
    CheckResult.MEND: Text('MEND', style='bold red'),
    CheckResult.NOT_CHECKED: Text('-', style='yellow'),
}
_TOPIC = re.compile(r'[/~]?[A-Za-z_][A-Za-z0-9_/]*')


def doctor(
    *,
    mavlink: Annotated[
        str, typer.Option(metavar='URL', help='The autopilot, as the landing node takes it.')
    ] = '',
    image: Annotated[
        str,
        typer.Option(metavar='TOPIC', help='The camera; none: the only one that is published.'),
    ] = '',
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset or parameter file of the nodes.')
    ] = DEFAULT_PRESET,
    json_file: Annotated[
        Path | None, typer.Option('--json', metavar='FILE', help='Write the findings here.')
    ] = None,
) -> None:
    """Check ROS, models, camera, autopilot and computer, and say what must be mended.

    Nothing moves, and nothing is set: the autopilot is asked for its message streams only. Exit
    status 0 when all is well, 1 when something must be mended, 2 for wrong arguments.
    """
    preset = load_preset(config)
    if image and not _TOPIC.fullmatch(image):
        raise ConfigurationError(f'--image {image!r}: give a topic such as /camera/image_raw')
    if json_file is not None and not json_file.absolute().parent.is_dir():
        raise ConfigurationError(f'--json {json_file}: its folder does not exist; create it first')
    if mavlink:
        _check_access(mavlink, preset)
    began_s = time.monotonic()
    found = examine(DoctorOptions(preset, mavlink, image), how_to_install)
    taken_s = time.monotonic() - began_s
    _show(found, taken_s, Console())
    if json_file is not None:
        text = json.dumps(as_json(found, taken_s), indent=2, allow_nan=False)
        write_whole(json_file, f'{text}\n', 'findings')
    if needs_mending(found):
        raise typer.Exit(EXIT_MEND)


def _check_access(url: str, preset: Preset) -> None:
    vehicle = preset.fill('landing', VehicleParameters)
    dialect = preset.fill('landing', LandingOptions).dialect
    try:
        check_access(url, dialect, vehicle.signing_key_file, vehicle.system_id)
    except VehicleError as error:
        raise ConfigurationError(f'--mavlink {error}') from error


def _show(found: Mapping[str, list[Finding]], seconds: float, console: Console) -> None:
    for subject, findings in found.items():
        if not findings:
            continue
        console.print(Text(subject, style='bold'))
        table = Table.grid(padding=(0, 1))
        table.add_column(width=4)
        table.add_column()
        for each in findings:
            text = Text(each.found)
            if each.remedy:
                text.append(f'\n-> {each.remedy}', style='cyan')
            table.add_row(_MARKS[each.outcome], text)
        console.print(Padding(table, (0, 0, 0, 2), expand=False))
    count = needs_mending(found)
    result = f'{count} to mend before a flight' if count else 'nothing to mend'
    console.print(Text(f'{result} ({seconds:.1f} s)', style='bold'))

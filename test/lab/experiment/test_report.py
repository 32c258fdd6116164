# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner

pytest.importorskip('pyarrow')

from peace_ros.cli.main import app
from peace_ros.lab.experiment.fly import fly_run
from peace_ros.lab.experiment.places import Place
from peace_ros.lab.experiment.settings import ExperimentSettings
from peace_ros.lab.experiment.store import FlightStore

LOADED = re.compile(r'(?:src|href)="(?!data:|#)|url\((?!data:|#)|@import')


class Cells(HTMLParser):
    """Collects the text of every cell, by row."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, _: object) -> None:
        if tag == 'tr':
            self.rows.append([])
        elif tag in {'td', 'th'} and self.rows:
            self.rows[-1].append('')
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in {'td', 'th'} and self.open:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open:
            self.rows[-1][-1] += data


@pytest.fixture(scope='module')
def flown(tmp_path_factory: pytest.TempPathFactory, shared_town: Path) -> Path:
    """An experiment of two short runs, whose results are then written over."""
    folder = tmp_path_factory.mktemp('experiment')
    settings = ExperimentSettings(
        2,
        eyes='truth',
        policies=('ours', 'dovesei'),
        places=(Place(str(shared_town), 0.5),),
        limit_s=10.0,
    )
    rows = [row for run in range(2) for row in fly_run(settings, list(settings.flights_of(run)))]
    for row, result in zip(rows, ('safe', 'unsafe', 'no_zone', 'timeout'), strict=True):
        row['result'] = result
        row['hazard'] = 'person' if result == 'unsafe' else ''
        row['no_zone_right'] = True if result == 'no_zone' else None
    FlightStore(folder, settings).add(rows)
    return folder


def write(folder: Path, *options: str) -> tuple[str, int]:
    done = CliRunner().invoke(app, ['report', str(folder), *options])
    return done.output, done.exit_code


@pytest.fixture(scope='module')
def page(flown: Path) -> str:
    out, status = write(flown, '--charts', str(flown / 'charts'))
    assert status == 0, out
    return (flown / 'report.html').read_text()


def test_the_table_stands_beside_the_papers(page):
    cells = Cells()
    cells.feed(page)
    by_name = {' '.join(row[0].split()): row for row in cells.rows if row}
    assert by_name['PEACE-CS, ours'][2].startswith('50')
    assert by_name['PEACE-CS, dovesei'][3].startswith('50.0')
    assert by_name['PEACE-CS, paper'][2] == '92'
    assert by_name['PEACE-CS, ours'][4:6] == ['1', '1']
    runs = [row for row in cells.rows if len(row) == 11 and row[0].isdigit()]
    assert [row[3] for row in runs] == ['safe', 'unsafe', 'no zone', 'timeout']


def test_failures_have_pictures_and_a_right_no_zone_is_none(page):
    failures = page.split('Where and why runs failed')[1].split('Along a flight')[0]
    assert failures.count('<figure>') == 2
    assert failures.index('hazard: person') < failures.index('>timeout<')
    assert failures.count('src="data:image/jpeg;base64,') == 6
    along = page.split('Along a flight')[1].split('Every run')[0]
    assert along.count('src="data:image/jpeg;base64,') == 5


def test_the_page_needs_no_other_file(page):
    assert LOADED.search('<img src="x.png">')
    assert not LOADED.search(page)
    assert page.count('<svg') == 6


def test_charts_are_written_for_papers(page, flown):
    names = {path.stem for path in (flown / 'charts').iterdir()}
    assert names == {'results', 'time', 'distance', 'runs', 'paths', 'states'}
    for name in names:
        assert (flown / 'charts' / f'{name}.png').read_bytes().startswith(b'\x89PNG')
        assert (flown / 'charts' / f'{name}.pdf').read_bytes().startswith(b'%PDF')


def test_what_cannot_be_shown_is_refused(flown, tmp_path):
    told, status = write(
        flown, '--strip', '9', '--pictures', '0', '--out', str(tmp_path / 'a.html')
    )
    assert (status, 'run 9 was not flown' in told) == (2, True)
    told, status = write(tmp_path / 'nothing')
    assert (status, 'run peace experiment --out' in told) == (2, True)

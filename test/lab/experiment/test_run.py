# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import errno
import multiprocessing
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('pyarrow')

from peace_ros.core.domain import ConfigurationError, RecordingError
from peace_ros.lab.experiment import run as running
from peace_ros.lab.experiment.figures import figures
from peace_ros.lab.experiment.flight import Perception
from peace_ros.lab.experiment.fly import fly_run
from peace_ros.lab.experiment.places import Place, draw_start
from peace_ros.lab.experiment.run import run_experiment
from peace_ros.lab.experiment.settings import ExperimentSettings
from peace_ros.lab.experiment.store import FlightStore, read_flights


def settings_for(*worlds: Path, runs: int = 1, **given) -> ExperimentSettings:
    return ExperimentSettings(
        runs=runs,
        eyes=given.pop('eyes', 'truth'),
        places=tuple(Place(str(world), 0.5) for world in worlds),
        perception=Perception(2.0, 0.2),
        **given,
    )


def fly(settings: ExperimentSettings, run: int = 0) -> list[dict]:
    return fly_run(settings, list(settings.flights_of(run)))


def test_with_eyes_of_the_truth_it_lands_on_the_meadow(town):
    (row,) = fly(settings_for(town))
    assert (row['result'], row['hazard']) == ('safe', '')
    assert 30.0 < row['time_s'] < 200.0
    assert row['miou'] == pytest.approx(1.0, abs=0.03)
    assert row['clearance_m'] > 3.0
    assert row['track_altitude_m'][0] == pytest.approx(100.0, abs=0.5)
    assert row['track_altitude_m'][-1] == pytest.approx(20.3, abs=0.4)
    assert sum(seconds for _, seconds in row['state_s']) == pytest.approx(row['time_s'], abs=0.1)
    assert np.diff(row['track_time_s']).max() <= 1.01


def test_without_a_place_the_answer_no_zone_is_right(stones, tmp_path):
    impatient = tmp_path / 'impatient.yaml'
    impatient.write_text('landing:\n  ros__parameters:\n    max_search_s: 20.0\n')
    (row,) = fly(settings_for(stones, configurations=(str(impatient),)))
    assert (row['result'], row['no_zone_right']) == ('no_zone', True)


def test_the_limit_of_time_ends_a_run(stones):
    (row,) = fly(settings_for(stones, limit_s=10.0))
    assert row['result'] == 'timeout'
    assert row['time_s'] == pytest.approx(10.0, abs=0.1)
    assert row['no_zone_right'] is None


def test_every_flight_of_a_run_has_the_same_start(town):
    settings = settings_for(town, policies=('ours', 'dovesei'), limit_s=10.0)
    rows = fly(settings)
    assert [row['policy'] for row in rows] == ['ours', 'dovesei']
    assert rows[0]['start_east_m'] == rows[1]['start_east_m']
    assert rows[0]['start_heading_rad'] == rows[1]['start_heading_rad']
    other = draw_start(settings.places[0], settings.seed, 1, settings.places[0].load())
    assert other.east_m != rows[0]['start_east_m']


def test_the_same_seed_flies_the_same_flight(town):
    first, second = (fly(settings_for(town, error_rate=0.01, limit_s=12.0))[0] for _ in range(2))
    assert first['track_east_m'] == second['track_east_m']
    assert first['miou'] == second['miou'] < 0.995


def test_a_flight_over_a_drawn_town_stays_as_it_was():
    """Whoever makes a run faster must not change what it does."""
    settings = ExperimentSettings(runs=6, eyes='truth', limit_s=40.0)
    (row,) = fly(settings, run=5)
    track = list(
        zip(*(row[f'track_{axis}_m'] for axis in ('north', 'east', 'altitude')), strict=True)
    )
    assert row['heatmaps'] == 33
    assert row['track_state'][::10] == ['SEARCHING', *['AIMING'] * 4]
    expected = [(0, 0, 100.4), (8.2, -6.7, 100.4), (14.7, -11.7, 87.3), (14.7, -11.7, 72.7)]
    assert track[:40:10] == [pytest.approx(each, abs=0.5) for each in expected]


def test_finished_runs_are_kept_and_not_flown_again(town, tmp_path, monkeypatch):
    settings = settings_for(town, runs=2, limit_s=10.0)
    run_experiment(settings, FlightStore(tmp_path / 'out', settings))
    flown = []
    monkeypatch.setattr(running, '_fly_all', lambda *given: flown.append(given))
    run_experiment(settings, FlightStore(tmp_path / 'out', settings))
    assert not flown
    more = replace(settings, runs=3)
    run_experiment(more, FlightStore(tmp_path / 'out', more))
    ((_, _, waiting, _, _),) = flown
    assert [key.run for keys in waiting for key in keys] == [2]


def test_the_run_of_a_worker_that_died_is_flown_again(town, tmp_path):
    settings = settings_for(town, runs=2, limit_s=40.0)
    store, killed = FlightStore(tmp_path / 'out', settings), []

    def kill_the_first() -> None:
        until = time.monotonic() + 60.0
        while not killed and time.monotonic() < until:
            for each in multiprocessing.active_children():
                time.sleep(1.0)
                killed.append(each.pid)
                each.kill()
                return
            time.sleep(0.05)

    killer = threading.Thread(target=kill_the_first)
    killer.start()
    run_experiment(settings, store)
    killer.join()
    assert killed
    assert sorted(row['run'] for row in store.rows()) == [0, 1]


def test_a_file_of_other_options_is_refused(town, tmp_path):
    settings = settings_for(town, limit_s=10.0)
    store = FlightStore(tmp_path / 'out', settings)
    store.add(fly(settings))
    with pytest.raises(ConfigurationError, match=r'seed = 1, and now it is 2'):
        FlightStore(tmp_path / 'out', replace(settings, seed=2))
    assert len(FlightStore(tmp_path / 'out', replace(settings, runs=9)).rows()) == 1


def test_a_cut_file_is_refused_in_a_sentence(town, tmp_path):
    settings = settings_for(town, limit_s=10.0)
    store = FlightStore(tmp_path / 'out', settings)
    store.add(fly(settings))
    store.path.write_bytes(store.path.read_bytes()[:-100])
    with pytest.raises(RecordingError, match='damaged or no Parquet file'):
        FlightStore(tmp_path / 'out', settings)


def test_a_full_disk_keeps_what_was_finished(town, tmp_path, monkeypatch):
    settings = settings_for(town, limit_s=10.0)
    store = FlightStore(tmp_path / 'out', settings)
    store.add(fly(settings))
    before = store.path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, 'write_bytes', full)
    with pytest.raises(RecordingError, match='No space left on device'):
        store.add(store.rows())
    assert store.path.read_bytes() == before


def test_figures_have_every_count_with_its_interval(town, stones):
    settings = settings_for(town, stones, runs=2, policies=('ours', 'dovesei'), limit_s=12.0)
    told = figures([row for run in range(2) for row in fly(settings, run)])
    ours, dovesei = told['groups']
    assert (ours['policy'], dovesei['policy']) == ('ours', 'dovesei')
    for group in told['groups']:
        counts = [group[name] for name in ('safe', 'unsafe', 'no_zone', 'timeout', 'unknown')]
        assert sum(counts) == group['runs'] == 2
        low, high = group['timeout_interval']
        assert 0.0 <= low <= group['timeout'] / 2 <= high <= 1.0
        assert group['realtime_factor'] > 0.0
    assert told['paired'][0]['runs'] == 2


@pytest.mark.parametrize(
    ('given', 'sentence'),
    [
        ({'runs': 0}, r'--runs 0: give 1 to 100000'),
        ({'policies': ('best',)}, '--policy best: choose among ours, dovesei'),
        ({'eyes': 'closed'}, '--eyes closed: choose among model, truth'),
        ({'eyes': 'model', 'error_rate': 0.1}, '--error-rate 0.1 belongs to --eyes truth'),
        ({'configurations': ('peace_xs',)}, "preset 'peace_xs' does not exist"),
        ({'limit_s': 0.0}, '--limit 0.0: give 10 to 7200 seconds'),
    ],
)
def test_what_makes_no_sense_is_refused(town, given, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        settings_for(town, **given)


def test_a_world_needs_labels(town):
    town.with_name('town_label.png').unlink()
    with pytest.raises(ConfigurationError, match=r'put town_label.png beside it'):
        Place(str(town), 0.5)


def test_a_dask_cluster_flies_the_same(town, tmp_path):
    distributed = pytest.importorskip('distributed')
    settings = settings_for(town, runs=2, limit_s=10.0)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        store = FlightStore(tmp_path / 'out', settings)
        run_experiment(settings, store, scheduler=cluster.scheduler_address)
    assert sorted(row['run'] for row in store.rows()) == [0, 1]
    (alone,) = fly(settings)
    (far,) = (row for row in store.rows() if row['run'] == 0)
    assert far['track_east_m'] == pytest.approx(alone['track_east_m'])


def test_a_scheduler_that_does_not_answer_is_refused(town, tmp_path):
    pytest.importorskip('distributed')
    settings = settings_for(town)
    with pytest.raises(
        ConfigurationError, match=r'--scheduler tcp://127\.0\.0\.1:9 does not answer'
    ):
        run_experiment(
            settings, FlightStore(tmp_path / 'out', settings), scheduler='tcp://127.0.0.1:9'
        )


def test_an_interrupted_experiment_ends_at_once_and_goes_on(town, tmp_path):
    command = [
        *(sys.executable, '-m', 'peace_ros.cli.main', 'experiment', '--eyes', 'truth'),
        *('--world', str(town), '--gsd', '0.5', '--limit', '10', '--out', str(tmp_path / 'out')),
    ]
    process = subprocess.Popen(
        [*command, '--runs', '200'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    store, until = tmp_path / 'out/flights.parquet', time.monotonic() + 120.0
    while not store.exists() and time.monotonic() < until:
        time.sleep(0.1)
    process.terminate()
    told, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    kept = len(read_flights(store))
    assert f'interrupted: {kept} flights are kept' in told
    assert 'Traceback' not in told
    assert 0 < kept < 200
    again = subprocess.run(
        [*command, '--runs', str(kept + 1)], capture_output=True, text=True, check=True
    )
    assert again.stdout.count('peace_cs ours: timeout') == 1
    assert len(read_flights(store)) == kept + 1

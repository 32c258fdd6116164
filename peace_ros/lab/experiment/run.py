# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs an experiment on processes of this machine or on a Dask cluster; finished runs are kept."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import groupby

import cv2

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.lab.experiment.fly import fly_run
from peace_ros.lab.experiment.settings import ExperimentSettings, FlightKey
from peace_ros.lab.experiment.store import FlightStore, Row

_TRIES = 3
"""Of a run whose worker died."""

Watch = Callable[[list[Row]], None]
"""Gets the flights of each finished run."""


class WorkerError(PeaceError):
    """Workers died again and again."""


def run_experiment(
    settings: ExperimentSettings,
    store: FlightStore,
    *,
    workers: int = 1,
    scheduler: str = '',
    watch: Watch = lambda _: None,
) -> None:
    """Fly what the store does not hold yet.

    Args:
        settings: of the experiment.
        store: takes the flights of each run when it is finished.
        workers: processes of this machine.
        scheduler: address of a Dask scheduler, whose workers fly instead.
        watch: is called after each run.

    Raises:
        PeaceError: a world or configuration cannot be used, or workers die again and again.
    """
    waiting = _missing(settings, store)
    deaths: Counter[int] = Counter()
    while waiting:
        with _executor(workers, scheduler) as executor:
            try:
                _fly_all(executor, settings, waiting, store, watch)
            except BrokenProcessPool as error:
                # The pool does not say whose worker died: every run under way has had a try.
                deaths.update(keys[0].run for keys in waiting[:workers])
                waiting = _missing(settings, store)
                lost = next((run for run, count in deaths.items() if count >= _TRIES), None)
                if lost is not None and any(keys[0].run == lost for keys in waiting):
                    raise WorkerError(
                        f'the worker of run {lost} died {_TRIES} times, perhaps because '
                        'memory ran out: use fewer --workers; finished runs are kept'
                    ) from error
                continue
        waiting = []


def _missing(settings: ExperimentSettings, store: FlightStore) -> list[list[FlightKey]]:
    """Return the flights that are still to be flown, by run."""
    finished = store.finished
    keys = [
        key
        for run in range(settings.runs)
        for key in settings.flights_of(run)
        if key not in finished
    ]
    return [list(group) for _, group in groupby(keys, lambda key: key.run)]


def _fly_all(
    executor: Executor,
    settings: ExperimentSettings,
    waiting: list[list[FlightKey]],
    store: FlightStore,
    watch: Watch,
) -> None:
    pending: set[Future[list[Row]]] = {executor.submit(fly_run, settings, keys) for keys in waiting}
    try:
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            for each in done:
                rows = each.result()
                store.add(rows)
                watch(rows)
    finally:
        for each in pending:
            each.cancel()


@contextmanager
def _executor(workers: int, scheduler: str) -> Iterator[Executor]:
    if not scheduler:
        # A fresh interpreter: threads of the networks do not survive a fork.
        # OpenCV's own threads would only take cores from the other workers.
        pool = ProcessPoolExecutor(
            workers,
            mp_context=multiprocessing.get_context('spawn'),
            initializer=cv2.setNumThreads,
            initargs=(1,),
        )
        try:
            yield pool
        except KeyboardInterrupt:
            # Nobody waits for the flights under way: they are flown again.
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        return
    from distributed import Client  # noqa: PLC0415 - of an extra, for clusters only

    try:
        client = Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f'--scheduler {scheduler} does not answer: give the address that dask scheduler prints'
        ) from error
    with client:
        yield client.get_executor(retries=_TRIES)

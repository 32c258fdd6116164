# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read many damaged files, each in a process that is watched.

    python -m peace_ros.lab.damage.run FILE... --count 1000 --seed 1

Each damaged file has to be used or refused with an error of this package: no other exception, not
longer than 10 s of processor time, less than 2 GB, and no half-written result.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import shutil
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from peace_ros.core.domain import PeaceError
from peace_ros.lab.damage.mutations import damaged
from peace_ros.lab.damage.readers import READERS

LONGEST_S = 10.0
LARGEST_BYTES = 2 << 30
_SLOW_MACHINE = 6.0
"""Wall clock may take so many times longer than the processor, where others work too."""
GOOD = ('used', 'refused')


@dataclass(frozen=True)
class Mutant:
    """One damaged file and the result of reading it."""

    file: str
    number: int
    """Seed of the damage, beside that of the run."""
    damage: str
    result: str
    """used, refused, traceback, hang, crash, memory or half-written."""
    detail: str


def read_damaged(files: Sequence[Path], count: int, seed: int) -> Iterator[Mutant]:
    """Yield one result per damaged file; the files take turns."""
    worker: _DamageReader | None = None
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            source = files[number % len(files)]
            rng = np.random.default_rng([seed, number])
            damage, content = damaged(source.read_bytes(), rng)
            place = Path(folder) / str(number)
            place.mkdir()
            path = place / source.name
            path.write_bytes(content)
            worker = worker or _DamageReader()
            result, detail = worker.read(path, place / 'out')
            if result in {'hang', 'crash', 'memory'}:
                worker = None
            shutil.rmtree(place)
            yield Mutant(source.name, number, damage, result, detail)
        if worker is not None:
            worker.stop()


class _DamageReader:
    """A process that reads files one after the other."""

    def __init__(self) -> None:
        context = multiprocessing.get_context('spawn')
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs,), daemon=True)
        self._process.start()
        self._pipe.recv()  # imports are done

    def read(self, path: Path, out: Path) -> tuple[str, str]:
        self._pipe.send((path, out))
        try:
            if not self._pipe.poll(LONGEST_S * _SLOW_MACHINE):
                self.stop()
                return 'hang', f'no answer within {LONGEST_S * _SLOW_MACHINE:g} s'
            result, detail, cpu_s, peak_bytes = self._pipe.recv()
        except EOFError:
            self.stop()
            return 'crash', f'the process ended with {self._process.exitcode}'
        if peak_bytes > LARGEST_BYTES:
            self.stop()
            return 'memory', f'{peak_bytes / 2**30:.1f} GB ({detail})'
        if cpu_s > LONGEST_S:
            return 'hang', f'{cpu_s:.1f} s ({detail})'
        return result, detail

    def stop(self) -> None:
        self._process.kill()
        self._process.join()


def _work(pipe: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    pipe.send('ready')
    while True:
        path, out = pipe.recv()
        began_s = _used().ru_utime + _used().ru_stime
        try:
            result, detail = _read(path, out)
        except MemoryError as error:
            result, detail = 'memory', repr(error)
        used = _used()
        pipe.send((result, detail, used.ru_utime + used.ru_stime - began_s, _peak_bytes()))


def _peak_bytes() -> int:
    """Return the most memory of this process so far; ru_maxrss would count its parent's too."""
    status = Path('/proc/self/status').read_text(encoding='ascii')
    return int(status.partition('VmHWM:')[2].split()[0]) * 1024


def _used() -> resource.struct_rusage:
    return resource.getrusage(resource.RUSAGE_SELF)


def _read(path: Path, out: Path) -> tuple[str, str]:
    try:
        READERS[path.suffix.lower()](path, out)
        result, detail = 'used', ''
    except PeaceError as error:
        result, detail = 'refused', str(error)
    except MemoryError:
        raise
    except Exception:
        return 'traceback', traceback.format_exc()
    written = sorted(each.name for each in out.rglob('*')) if out.exists() else []
    hidden = [name for name in written if name.startswith('.')]
    if hidden or (result == 'refused' and written):
        return 'half-written', f'{", ".join(written)} after: {detail or result}'
    return result, detail


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 1 when a file did more than to be used or refused."""
    parser = argparse.ArgumentParser(prog='python -m peace_ros.lab.damage.run')
    parser.add_argument('files', nargs='+', type=Path, metavar='FILE', help='Intact files.')
    parser.add_argument('--count', type=int, default=1000, help='Damaged files in all.')
    parser.add_argument('--seed', type=int, default=1)
    given = parser.parse_args(arguments)
    for path in given.files:
        if path.suffix.lower() not in READERS or not path.is_file():
            print(f'{path}: give a file of {", ".join(READERS)}', file=sys.stderr)
            return 2
    counts: Counter[str] = Counter()
    for mutant in read_damaged(given.files, given.count, given.seed):
        counts[mutant.result] += 1
        if mutant.result not in GOOD:
            print(f'{mutant.result}: {mutant.file} no. {mutant.number}, {mutant.damage}')
            print(f'  {mutant.detail.strip()}', flush=True)
    print(f'{given.count} damaged files, seed {given.seed}: ', end='')
    print(', '.join(f'{number} {result}' for result, number in counts.most_common()))
    return 1 if set(counts) - set(GOOD) else 0


if __name__ == '__main__':
    sys.exit(main())

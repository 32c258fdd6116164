# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Print what mutmut found in some folders: a table per module, then the mutants that survived.

python test/mutation_table.py build/mutants/*/
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

from mutmut.stats import status_by_exit_code

KILLED = {'killed', 'timeout', 'segfault', 'caught by type check'}
LEFT = {'survived', 'no tests', 'suspicious'}


def results_of(folder: Path) -> dict[str, dict[str, str]]:
    """Module -> mutant -> what became of it."""
    found: dict[str, dict[str, str]] = {}
    for path in sorted((folder / 'mutants').rglob('*.py.meta')):
        codes = json.loads(path.read_text(encoding='utf-8'))['exit_code_by_key']
        module = str(path.relative_to(folder / 'mutants' / 'peace_ros')).removesuffix('.meta')
        if codes:
            found[module] = {name: status_by_exit_code[code] for name, code in codes.items()}
    return found


def row(name: str, counts: Counter[str]) -> str:
    """One line of the table."""
    killed, left = (sum(counts[each] for each in those) for those in (KILLED, LEFT))
    share = f'{100 * killed / (killed + left):.1f} %' if killed + left else '-'
    waiting = sum(counts.values()) - killed - left
    return f'| {name} | {killed + left} | {killed} | {left} | {share} | {waiting or ""} |'


def change(folder: Path, mutant: str) -> str:
    """What the mutant changes: the lines that go and the lines that come."""
    shown = subprocess.run(
        ['mutmut', 'show', mutant], cwd=folder, capture_output=True, text=True, check=True
    ).stdout
    lines = [each for each in shown.splitlines() if each[:1] in {'-', '+'}]
    return '\n'.join(each for each in lines if not each.startswith(('---', '+++')))


def main(folders: list[Path]) -> None:
    """Print both."""
    total: Counter[str] = Counter()
    survivors = []
    print('| module | mutants | killed | survived | share | not run |\n|---|---|---|---|---|---|')
    for folder in folders:
        for module, results in results_of(folder).items():
            counts = Counter(results.values())
            total += counts
            print(row(f'`{module}`', counts))
            survivors += [(folder, name, how) for name, how in results.items() if how in LEFT]
    print(row('all', total))
    for folder, name, how in survivors:
        print(f'\n{name} ({how})\n{change(folder, name)}')


if __name__ == '__main__':
    main([Path(each) for each in sys.argv[1:]])

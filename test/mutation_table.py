# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Print what mutmut found in some folders: a table per module, then the mutants that survived.

python test/mutation_table.py build/mutants/*/
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from pathlib import Path

from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.stats import status_by_exit_code
from mutmut.utils.file_utils import change_cwd

KILLED = {'killed', 'timeout', 'segfault', 'caught by type check'}
LEFT = {'survived', 'no tests', 'suspicious'}


TYPES_ONLY = re.compile(r"cast\((None|'[^']*')")
"""What `cast` is told is for the type checker: a mutant of it is left out."""


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


def change(folder: Path, module: str, mutant: str) -> list[str]:
    """What the mutant changes: the lines that go and the lines that come."""
    with change_cwd(folder):
        shown = get_diff_for_mutant(mutant, path=Path('peace_ros', module))
    lines = [each for each in shown.splitlines() if each[:1] in {'-', '+'}]
    return [each for each in lines if not each.startswith(('---', '+++'))]


def concerns_types_only(lines: list[str]) -> bool:
    """Whether nothing but what `cast` is told has changed."""
    gone, come = (
        [TYPES_ONLY.sub('cast(', each[1:]) for each in lines if each[0] == sign] for sign in '-+'
    )
    return gone == come


def main(folders: list[Path]) -> None:
    """Print both."""
    total: Counter[str] = Counter()
    survivors = []
    print('| module | mutants | killed | survived | share | not run |\n|---|---|---|---|---|---|')
    for folder in folders:
        for module, results in results_of(folder).items():
            counts = Counter(results.values())
            for name, how in results.items():
                if how in LEFT:
                    lines = change(folder, module, name)
                    if concerns_types_only(lines):
                        counts[how] -= 1
                    else:
                        survivors.append((name, how, lines))
            total += counts
            print(row(f'`{module}`', counts))
    print(row('all', total))
    for name, how, lines in survivors:
        print('\n' + '\n'.join([f'{name} ({how})', *lines]))


if __name__ == '__main__':
    main([Path(each) for each in sys.argv[1:]])

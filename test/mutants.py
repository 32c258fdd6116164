# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mutation testing with mutmut: changes one thing at a time and asks whether a test fails.

    python test/mutants.py run GROUP [CHILDREN]   segmentation, mapping, landing, core or vehicle
    python test/mutants.py table                  figures and survivors of what has run so far

Takes hours, so no check runs it; docs/testing.md holds the figures. Needs the extras `test` and
`mutation`. Works on a copy of the checkout in build/mutants/GROUP. What was killed there stands
until its function changes; what survived runs again when any code has changed.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COPIES = ROOT / 'build' / 'mutants'


class Group(NamedTuple):
    """Modules that are mutated, the tests that have to notice, and which of them are left out."""

    modules: list[str]
    tests: list[str]
    without: tuple[str, ...] = ()


# The tests are those beside the modules, but for files that take seconds: they would be run for
# every mutant, and a test that says what was broken is worth more.
GROUPS = {
    'segmentation': Group(
        ['core/segmentation/fusion.py', 'core/segmentation/looks.py'],
        ['core/segmentation/test_fusion.py', 'core/segmentation/test_looks.py'],
    ),
    'mapping': Group(
        ['core/mapping/*.py'],
        ['core/mapping'],
        ('veto', 'projection', 'registration', 'safety_map'),
    ),
    'landing': Group(
        ['core/landing/[!cs]*.py', 'core/landing/si*.py'],  # but core.py and states.py
        ['core/landing'],
        ('flights', 'core', 'states'),
    ),
    'states': Group(['core/landing/states.py'], ['core/landing/test_states.py']),
    'core': Group(['core/landing/core.py'], ['core/landing/test_core.py']),
    'vehicle': Group(
        ['core/vehicle/sender.py', 'core/vehicle/obedience.py', 'core/vehicle/faulty_axes.py'],
        [
            'core/vehicle/test_sender.py',
            'core/vehicle/test_sender_limits.py',
            'core/vehicle/test_obedience.py',
            'core/vehicle/test_obedience_limits.py',
            'core/vehicle/test_faulty_axes_steps.py',
        ],
    ),
}
# The words of a message are nobody's interface: what `raise` says, and lines that begin with text
# in which there is a space.
MESSAGES = [r'^\s*raise ', r"^\s*(return |yield |else )?[(]?f?'[^' ]+ "]
TYPES_ONLY = re.compile(r"cast\((None|'[^']*')")
"""What `cast` is told is for the type checker."""

SKIPPED, SURVIVED, NO_TESTS = 34, 0, 33
"""Codes of mutmut's results."""
KILLED = {'killed', 'timeout', 'segfault'}
LEFT = {'survived', 'no tests', 'suspicious'}


def run(name: str, children: int) -> None:
    """Run what has not run yet of a group."""
    group, copy = GROUPS[name], COPIES / name
    if _copy_checkout(copy):
        # Which tests come by which function is found out anew.
        (copy / 'mutants' / 'mutmut-stats.json').unlink(missing_ok=True)
        _change_results(copy, lambda _module, _mutant, code: code in {SURVIVED, NO_TESTS}, None)
    settings = {
        'source_paths': ['peace_ros'],
        'only_mutate': [f'peace_ros/{each}' for each in group.modules],
        'do_not_mutate': ['*/__init__.py'],
        'do_not_mutate_patterns': MESSAGES,
        'also_copy': ['config', 'models', 'package.xml'],
        'pytest_add_cli_args_test_selection': [f'test/{each}' for each in group.tests],
        'pytest_add_cli_args': [
            *('-p', 'no:xdist', '-p', 'no:cacheprovider'),
            *(f'--deselect=test/{group.tests[0]}/test_{each}.py' for each in group.without),
        ],
        'timeout_constant': 10.0,
        'timeout_multiplier': 5.0,
    }
    project = (ROOT / 'pyproject.toml').read_text(encoding='utf-8')
    section = '\n'.join(f'{key} = {json.dumps(value)}' for key, value in settings.items())
    text = f'{project}\n[tool.mutmut]\n{section}\n'
    if (copy / 'pyproject.toml').read_text(encoding='utf-8') != text:
        (copy / 'pyproject.toml').write_text(text, encoding='utf-8')
    # No threads in a process that is forked; with CI, Hypothesis has no deadlines and no chance.
    os.environ.update(OPENCV_FOR_THREADS_NUM='1', OMP_NUM_THREADS='1', PYTHONPATH='', CI='1')
    os.nice(10)
    os.chdir(copy)
    from mutmut import __main__ as mutmut

    Path('mutants').mkdir(exist_ok=True)
    mutmut.set_mutant_under_test('mutant_generation')
    mutmut.copy_src_dir()
    mutmut.create_mutants(children)
    _change_results(copy, lambda *mutant: _concerns_types_only(copy, *mutant), SKIPPED)
    mutmut._run((), children)


def _copy_checkout(copy: Path) -> bool:
    """Copy what git knows and has changed; return whether it is code or a test."""
    listed = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    code_changed = False
    for path in [*copy.rglob('*.py')]:
        here = path.relative_to(copy)
        name = here.relative_to('mutants') if here.parts[0] == 'mutants' else here
        if not (ROOT / name).is_file():
            path.unlink()
    for name in filter(None, names.split('\0')):
        source, target = ROOT / name, copy / name
        if name == 'pyproject.toml' and target.is_file():
            continue  # written anew below
        if not source.is_file() or (
            target.is_file() and target.read_bytes() == source.read_bytes()
        ):
            continue  # a file that keeps its time keeps its results
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
        code_changed |= name.endswith('.py')
    return code_changed


def _results(copy: Path) -> dict[str, Path]:
    """Module -> file of its results."""
    folder, found = copy / 'mutants' / 'peace_ros', {}
    for path in sorted(folder.rglob('*.py.meta')):
        module = str(path.relative_to(folder)).removesuffix('.meta')
        mutated = any(fnmatch(module, each) for each in GROUPS[copy.name].modules)
        if mutated and (ROOT / 'peace_ros' / module).is_file():
            found[module] = path
    return found


def _change_results(copy: Path, concerns, code: int | None) -> None:
    for module, path in _results(copy).items():
        results = json.loads(path.read_text(encoding='utf-8'))
        codes = results['exit_code_by_key']
        for mutant, old in codes.items():
            if concerns(module, mutant, old):
                codes[mutant] = code
        path.write_text(json.dumps(results), encoding='utf-8')


def _change(copy: Path, module: str, mutant: str) -> list[str]:
    """What a mutant changes: the lines that go and the lines that come."""
    from mutmut.mutation.diff_apply import get_diff_for_mutant
    from mutmut.utils.file_utils import change_cwd

    with change_cwd(copy):
        shown = get_diff_for_mutant(mutant, path=Path('peace_ros', module))
    lines = [each for each in shown.splitlines() if each[:1] in {'-', '+'}]
    return [each for each in lines if not each.startswith(('---', '+++'))]


@cache
def _functions_that_cast(path: Path) -> set[str]:
    functions = [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.FunctionDef)
    ]
    return {each.name for each in functions if 'cast(' in ast.unparse(each)}


def _concerns_types_only(copy: Path, module: str, mutant: str, code: int | None) -> bool:
    """Whether a mutant that no test killed changes nothing but what `cast` is told."""
    if code not in {None, SURVIVED}:
        return False
    name = mutant.rpartition('.')[2].partition('__mutmut_')[0].rpartition('ǁ')[2].removeprefix('x_')
    if name not in _functions_that_cast(copy / 'peace_ros' / module):
        return False
    lines = _change(copy, module, mutant)
    gone, come = (
        [TYPES_ONLY.sub('cast(', each[1:]) for each in lines if each[0] == sign] for sign in '-+'
    )
    return gone == come


def table() -> None:
    """Print a table by module and group, then the mutants that survived."""
    from mutmut.stats import status_by_exit_code

    total: Counter[str] = Counter()
    survivors = []
    print('| module | mutants | killed | survived | share | not run |\n|---|---|---|---|---|---|')
    for copy in map(COPIES.joinpath, GROUPS):
        group: Counter[str] = Counter()
        for module, path in _results(copy).items():
            counts: Counter[str] = Counter()
            codes = json.loads(path.read_text(encoding='utf-8'))['exit_code_by_key']
            for mutant, code in codes.items():
                status = status_by_exit_code[code]
                if status in LEFT and not _concerns_types_only(copy, module, mutant, code):
                    change = '\n'.join(_change(copy, module, mutant))
                    survivors.append(f'\n{mutant} ({status})\n{change}')
                elif status in LEFT or status == 'skipped':
                    continue
                counts[status] += 1
            group += counts
            if counts:
                print(_row(f'`{module}`', counts))
        total += group
        if group:
            print(_row(f'group {copy.name}', group))
    print(_row('all', total))
    print('\n'.join(survivors))


def _row(name: str, counts: Counter[str]) -> str:
    killed, left = (sum(counts[each] for each in those) for those in (KILLED, LEFT))
    share = f'{100 * killed / (killed + left):.1f} %' if killed + left else '-'
    waiting = counts.total() - killed - left
    return f'| {name} | {killed + left} | {killed} | {left} | {share} | {waiting or ""} |'


if __name__ == '__main__':
    if sys.argv[1:2] == ['run'] and sys.argv[2:3] and sys.argv[2] in GROUPS:
        run(sys.argv[2], int(sys.argv[3]) if sys.argv[3:] else os.cpu_count() or 1)
    elif sys.argv[1:] == ['table']:
        table()
    else:
        sys.exit(__doc__)

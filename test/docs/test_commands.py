# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every command of the pages is possible: its verb, options, files, arguments and extras exist.

Those that are quick are run. The others stand in tables here with the reason why they are not.
"""

from __future__ import annotations

import ast
import configparser
import importlib
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
import typer

from peace_ros.cli import main as command_line
from peace_ros.cli.options import for_typer
from peace_ros.core.node_parameters import FLYING_NODES, OTHER_NODES, RECORDER, named
from peace_ros.core.presets import preset_names
from peace_ros.lab.parameter_docs import NODE_PARAMETERS

ROOT = Path(__file__).resolve().parents[2]
PAGES = tuple(
    sorted(
        path
        for pattern in ('*.md', 'models/*.md', '.github/*.md', 'docs/**/*.md')
        for path in ROOT.glob(pattern)
        if path.name != 'changelog.md'  # history: its commands need not exist any more
    )
)
KINDS = {'sh': 'commands', 'python': 'no commands', 'yaml': 'no commands', 'text': 'no commands'}
"""What is behind the opening of a fenced block -> what is in it; a block of another kind fails."""
QUICK = (
    'peace --help',
    'peace models list',
    'peace doctor',
    'peace faults --list',
    'peace models warm --size 352x352',
    'ros2 run peace_ros peace models warm',
)
"""Run as they stand (``ros2 run peace_ros peace`` as ``peace``), each must end with status 0."""
NOT_RUN = {
    'peace ablate': 'minutes; test/lab/evaluation runs it on few scenes',
    'peace benchmark': 'minutes; test/lab/benchmark',
    'peace demo': 'a flight of minutes; test/simulation/demo',
    'peace doctor': 'with a camera and an autopilot; test/cli runs it with simulated ones',
    'peace evaluate': 'minutes, or data of the reader; test/lab/evaluation',
    'peace experiment': 'minutes for each landing; test/lab/experiment',
    'peace faults': 'a flight for each fault; test/lab/faults',
    'peace models': 'downloads, or takes minutes; test/lab/export and test/cli',
    'peace replay': 'a recording of the reader; test/lab/replay',
    'peace report': 'reads an experiment; test/lab/experiment',
    'peace watch': 'serves a page until Ctrl-C; test/watch and test/cli',
    'peace words': 'images of the reader; test/lab/evaluation',
    'peace world': 'a map server of the reader; test/simulation/tiles and test/cli',
    'peace <verb>': 'no command, but the form of all',
    'ros2': 'ros2cli has no wheels; verbs, parameters and arguments are checked',
    'rviz2': 'has no wheels; a test holds the topics of its file against those of the node',
    'python -m': 'minutes, or a page that another test compares; the module is checked',
    'python -c': 'makes a network of the true size',
    'python test/watch/measure.py': 'a browser and a node for a while; a measurement',
    'python test/mutants.py': 'takes hours',
    'pip': 'changes the environment; extras are checked',
    'pre-commit': 'changes the checkout',
    'pytest': 'runs this test',
    'launch_scripts/demo.sh': 'a flight of minutes: test/simulation/demo flies it',
    'launch_scripts/test.sh': 'runs this test',
    '.ci/run': 'runs this test',
    '.ci/ubuntu-24.04': 'installs packages',
    'docker': 'no Docker where the tests run; test_deployment.py checks the images',
    'sudo': 'changes the machine',
    'journalctl': 'reads the log of the units',
    'git': 'a download',
    './build.sh': 'builds ONNX Runtime, on a Jetson',
    'rosdep': 'needs the index of ROS; test_package_xml.py checks the keys',
    'colcon': 'builds in a workspace; .ci/ubuntu-24.04 colcon does it',
    'mkdocs': 'test_pages.py builds the site',
    'cd': 'changes the folder',
    'source': 'changes the shell',
    'export': 'changes the shell',
}
"""First words of a command -> why it is not run, unless it stands in QUICK."""
FILE = re.compile(r'(?:\./)?((?:launch_scripts|docs|config|models|test|findings|\.ci)/[\w./@-]+)')


class Command(NamedTuple):
    page: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f'{self.page}: {" ".join(self.words)}'


def _lines_of_code(text: str) -> Iterator[str]:
    """Yield each line of the blocks that hold commands, and inline code that begins with one.

    Raises:
        AssertionError: A fenced block is of no kind that is listed.
    """
    text = re.sub(r'\\\n\s*', ' ', text)
    prose, kind, may_begin, in_list = [], '', True, False
    for line in text.splitlines():
        if line.lstrip().startswith('```'):
            named = line.strip().removeprefix('```')
            assert kind or named in KINDS, f'a block of kind {named!r}: use one of {list(KINDS)}'
            kind = '' if kind else named
        elif kind:
            if KINDS[kind] == 'commands':
                yield line
        elif may_begin and not in_list and line.startswith('    '):
            yield line
        else:
            # Only after an empty line is an indented one code, and it may also belong to a list.
            may_begin = not line
            if line and not line.startswith(' '):
                in_list = bool(re.match(r'[-*] |\d+\. ', line))
            prose.append(line)
    for code in re.findall(r'`([^`]+)`', '\n'.join(prose)):
        if len(code.split()) > 1 and _reason(tuple(code.split())) is not None:
            yield ' '.join(code.split())


def _reason(words: tuple[str, ...]) -> str | None:
    """Return why a command is not run, None where nothing says it."""
    if (name := Path(words[0]).name) in {'peace', 'pip'}:
        words = (name, *words[1:])
    for count in (2, 1):
        if (reason := NOT_RUN.get(' '.join(words[:count]))) is not None:
            return reason
    return None


def _parts(line: str) -> Iterator[tuple[str, ...]]:
    """Yield the commands of a line of shell, without variables before them and comments."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=';&|')
    lexer.whitespace_split = True
    words: list[str] = []
    for word in (*lexer, ';'):
        if not set(word) <= set(';&|'):
            if words or not re.fullmatch(r'[A-Z_]+=\S*', word):
                words.append(word)
        elif words:
            yield tuple(words)
            words = []


def _commands(name: str, text: str) -> list[Command]:
    return [Command(name, words) for line in _lines_of_code(text) for words in _parts(line)]


COMMANDS = [each for page in PAGES for each in _commands(page.name, page.read_text())]


def _of_peace(words: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return what follows ``peace`` where a command runs it, also in ROS or a container."""
    if Path(words[0]).name == 'peace' or words[0] == 'launch_scripts/demo.sh':
        return words[1:] if Path(words[0]).name == 'peace' else ('demo', *words[1:])
    for index in range(len(words) - 2):
        if words[index : index + 3] == ('run', 'peace_ros', 'peace'):
            return words[index + 3 :]
    return None


def _launch_arguments() -> set[str]:
    tree = ast.parse((ROOT / 'launch_scripts/landing.launch.py').read_text())
    declared = {
        row.elts[0].value
        for node in ast.walk(tree)
        if re.match(r'ARGUMENTS\b', ast.unparse(node)) and isinstance(node, ast.stmt)
        for row in ast.walk(node)
        if isinstance(row, ast.Tuple) and row.elts and isinstance(row.elts[0], ast.Constant)
    }
    return declared | {
        node.args[0].value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and ast.unparse(node.func).endswith('DeclareLaunchArgument')
        and node.args
        and isinstance(node.args[0], ast.Constant)
    }


def _options_of(words: tuple[str, ...]) -> tuple[set[str], int]:
    """Return the options of a verb, and how many words its name has."""
    groups = {'models': command_line.MODEL_VERBS, 'world': command_line.WORLD_VERBS}
    if words[0] in groups and len(words) > 1:
        assert words[1] in groups[words[0]], words
        module, function, count = words[0], f'{words[0]}_{words[1]}', 2
    else:
        assert words[0] in command_line.VERBS, words
        module, function, count = words[0], words[0], 1
    verb = getattr(importlib.import_module(f'peace_ros.cli.{module}'), function)
    own = typer.Typer()
    own.command()(for_typer(verb))
    options = typer.main.get_command(own).params
    return {name for each in options for name in (*each.opts, *each.secondary_opts)}, count


def _check_peace(words: tuple[str, ...]) -> None:
    if not words or words[0] in {'--help', '--version'} or not re.match(r'[a-z]', words[0]):
        return
    if words in {('models',), ('world',)}:
        return
    options, count = _options_of(words)
    for word in words[count:]:
        if word.startswith('--') and word != '--help':
            assert word.partition('=')[0] in options, word
    if '--config' in words[:-1]:
        preset = words[words.index('--config') + 1]
        names = {*preset_names(), 'all', 'PRESET', 'own'}
        assert preset in names or preset.endswith('.yaml'), preset


def _check_ros(words: tuple[str, ...]) -> None:
    if words[1:3] == ('run', 'peace_ros') and words[3] != 'peace':
        names = (*FLYING_NODES, RECORDER, *OTHER_NODES)
        executables = {name: (name,) for name in names}
        executables['perception'] = ('prompt_generator', 'segmentation')
        assert words[3] in executables
        known = {key for node in executables[words[3]] for key in named(NODE_PARAMETERS[node])}
        for option, value in pairwise(words):
            if option == '-p':
                name = value.partition(':=')[0]
                assert name in known or name == 'use_sim_time', value
    elif words[1:3] == ('launch', 'peace_ros'):
        assert words[3] == 'landing.launch.py'
        for word in words[4:]:
            assert word.startswith('-') or word.partition(':=')[0] in _launch_arguments(), word
    elif words[1:3] == ('service', 'call'):
        assert words[3].rpartition('/')[2] in {'engage', 'disengage'}


def _check_extras(words: tuple[str, ...]) -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    for word in words:
        for extras in re.findall(r'(?:\.|peace_ros)\[([\w,]+)\]', word):
            assert set(extras.split(',')) <= set(config['options.extras_require']), word


def test_the_pages_have_commands_of_each_kind() -> None:
    assert len(COMMANDS) > 80
    assert {each.words[0] for each in COMMANDS} >= {'peace', 'ros2', 'pip', 'docker', 'sudo'}
    assert sum(_of_peace(each.words) is not None for each in COMMANDS) > 40


@pytest.mark.parametrize('command', COMMANDS, ids=str)
def test_a_command_is_possible(command: Command) -> None:
    words = command.words
    is_run = ' '.join(words) in QUICK
    assert is_run or _reason(words), f'{command}: say in NOT_RUN why it is not run'
    given = _of_peace(words)
    if given is not None:
        _check_peace(given)
    elif words[0] == 'ros2':
        _check_ros(words)
    elif words[:2] == ('python', '-m') and words[2].startswith('peace_ros'):
        path = ROOT / Path(*words[2].split('.'))
        assert path.with_suffix('.py').is_file() or (path / '__main__.py').is_file()
    elif words[0] == 'pip':
        _check_extras(words)
    for word in words:
        for file in FILE.findall(word):
            assert (ROOT / file).exists(), word


@pytest.mark.parametrize(
    'block',
    [
        '```sh\nfly_now --fast\n```\n',
        'Text:\n\n    fly_now --fast\n',
        'Text:\n\n    peace doctor && fly_now --fast\n',
        '```sh\ncd folder; fly_now --fast\n```\n',
    ],
)
def test_a_command_that_is_neither_run_nor_excused_is_found(block: str) -> None:
    command = _commands('page', block)[-1]
    assert command.words == ('fly_now', '--fast')
    with pytest.raises(AssertionError, match='say in NOT_RUN why'):
        test_a_command_is_possible(command)


@pytest.mark.parametrize('kind', ['', 'bash', 'console', 'shell'])
def test_a_block_of_a_kind_that_is_not_listed_is_found(kind: str) -> None:
    with pytest.raises(AssertionError, match='a block of kind'):
        _commands('page', f'Text:\n\n```{kind}\nfly_now\n```\n')


def test_commands_inside_of_sentences_are_found_also_over_two_lines() -> None:
    (command,) = _commands('page', 'Run `peace evaluate\n--drawn 60` for `drawn` scenes.')
    assert command.words == ('peace', 'evaluate', '--drawn', '60')


def test_no_excuse_is_left_over() -> None:
    used = {reason for each in COMMANDS if (reason := _reason(each.words))}
    assert set(NOT_RUN.values()) == used


@pytest.mark.parametrize('reason', NOT_RUN.values())
def test_a_test_that_an_excuse_names_exists(reason: str) -> None:
    for name in re.findall(r'test_\w+\.py', reason):
        assert list((ROOT / 'test').rglob(name)), name
    for name in re.findall(r'test/[\w/]+', reason):
        assert (ROOT / name).exists(), name


def test_impossible_commands_are_found() -> None:
    for words in (('fly',), ('demo', '--altitude'), ('models', 'burn'), ('demo', '--config', 'x')):
        with pytest.raises(AssertionError):
            _check_peace(words)
    for words in (
        ('ros2', 'run', 'peace_ros', 'landin'),
        ('ros2', 'run', 'peace_ros', 'landing', '--ros-args', '-p', 'heigth:=3'),
        ('ros2', 'launch', 'peace_ros', 'landing.launch.py', 'mavlnk:=x'),
    ):
        with pytest.raises(AssertionError):
            _check_ros(words)
    with pytest.raises(AssertionError):
        _check_extras(('pip', 'install', '.[no_such]'))


@pytest.mark.parametrize('line', QUICK)
def test_a_quick_command_of_the_pages_works(line: str, tmp_path: Path) -> None:
    words = tuple(shlex.split(line))
    stands = any(each.words[: len(words)] == words for each in COMMANDS)
    assert stands or any(words == each.words[-len(words) :] for each in COMMANDS), line
    given = _of_peace(words)
    assert given is not None
    done = subprocess.run(
        [sys.executable, '-m', 'peace_ros.cli.main', *given],
        cwd=tmp_path,
        env={
            **os.environ,
            'PYTHONPATH': str(ROOT),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(101 + os.getpid() % 100),
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr

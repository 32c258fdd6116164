# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits that keep what flies small and readable."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / 'peace_ros'
LINES_OF_WHAT_FLIES = 19_300
"""Of core and nodes: 14,500, what learns a biased velocity and finds faulty axes, what names the
cause that stops the vehicle (fence, second commander, failsafe after a silent line), what compares
heights, what knows lens, mount, gimbal, shape and encodings of the camera, diagnostics of every
input, live parameters, managed nodes that may share a process, what people see, a search lower
down, the parameters of the flight recorder, and why places are refused."""
LINES_OF_A_NODE_FILE = 200


def _lines(path: Path) -> int:
    return len(path.read_text(encoding='utf-8').splitlines())


def _relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


def test_what_flies_stays_small() -> None:
    files = [*(PACKAGE / 'core').rglob('*.py'), *(PACKAGE / 'nodes').rglob('*.py')]
    assert len(files) > 50
    assert sum(map(_lines, files)) <= LINES_OF_WHAT_FLIES


def test_a_file_of_a_node_is_read_at_one_sitting() -> None:
    files = {_relative(path): _lines(path) for path in (PACKAGE / 'nodes').rglob('*.py')}
    assert files
    assert {name: n for name, n in files.items() if n >= LINES_OF_A_NODE_FILE} == {}


def test_a_class_name_stands_for_one_thing() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for path in sorted(PACKAGE.rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip('_')].append(_relative(path))
    assert len(places) > 100
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def _is_private(name: str) -> bool:
    return name.startswith('_') and not name.endswith('__')


def _own_names(tree: ast.AST) -> Iterator[str]:
    """Yield what a file's classes define: methods, attributes of self, class variables."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def private_uses(tree: ast.AST, own: set[str]) -> set[str]:
    """Find private names of others: of another object, inherited, imported, or by getattr."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and _is_private(node.attr):
            whose = ast.unparse(node.value)
            if whose != 'os' and (whose not in {'self', 'cls'} or node.attr not in own):
                found.add(ast.unparse(node))
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [*node.module.split('.'), *(each.name for each in node.names)]
            if names[0] == 'rclpy' and ('impl' in names or any(map(_is_private, names))):
                found.add(ast.unparse(node))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in {'getattr', 'setattr'}:
            name = node.args[1]
            if isinstance(name, ast.Constant) and _is_private(str(name.value)):
                found.add(ast.unparse(node))
    return found


def test_nodes_use_nothing_private_of_rclpy() -> None:
    trees = {
        _relative(path): ast.parse(path.read_text(encoding='utf-8'))
        for path in (PACKAGE / 'nodes').rglob('*.py')
    }
    own = {name for tree in trees.values() for name in _own_names(tree)}
    found = {name: uses for name, tree in trees.items() if (uses := private_uses(tree, own))}
    assert found == {}


def test_private_uses_are_found() -> None:
    source = """
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy._lost import thing
from rclpy.node import Node

class Mine(Node):
    def __init__(self):
        self._mine = 1
        self._mine += self.__len__()

    def use(self):
        self._inherited()
        os._exit(1)
        self.executor._tasks.clear()
        getattr(self, '_parameters')
"""
    tree = ast.parse(source)
    assert private_uses(tree, set(_own_names(tree))) == {
        'from rclpy.impl.implementation_singleton import rclpy_implementation',
        'from rclpy._lost import thing',
        'self._inherited',
        'self.executor._tasks',
        "getattr(self, '_parameters')",
    }

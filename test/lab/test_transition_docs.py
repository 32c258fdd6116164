# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The documentation of the states is the code of the states."""

from pathlib import Path

import pytest

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.landing import State
from peace_ros.core.landing.states import GUARDS, RULES, TRANSITIONS
from peace_ros.lab.transition_docs import BEGIN, END, inserted, main, markdown

DOCUMENT = Path(__file__).parents[2] / 'docs' / 'landing.md'


def test_the_document_holds_the_current_table():
    text = DOCUMENT.read_text(encoding='utf-8')
    assert inserted(text) == text, 'run python -m peace_ros.lab.transition_docs docs/landing.md'


def test_every_rule_is_in_the_table_with_its_reason():
    table = markdown()
    assert table.count('\n| ') >= len(GUARDS) + sum(map(len, RULES.values()))
    for state in State:
        for rule in RULES[state]:
            assert f'| {state.value} | ' in table
            assert rule.reason.replace('{blocked}', '*blocked*') in table
    assert '`giveup_after_s` (5)' in table
    assert '{' not in table


def test_the_allowed_transitions_are_those_of_the_rules():
    for state in State:
        planned = {rule.target for rule in RULES[state]}
        outranking = {rule.target for rule in GUARDS}
        assert planned <= TRANSITIONS[state] | {state}
        assert TRANSITIONS[state] - {state} <= planned | outranking


def test_writes_between_the_markers_only(tmp_path):
    document = tmp_path / 'landing.md'
    document.write_text(f'before\n{BEGIN}\noutdated\n{END}\nafter\n')
    assert main([str(document)]) == 0
    text = document.read_text()
    assert text.startswith('before\n')
    assert text.endswith(f'{END}\nafter\n')
    assert 'outdated' not in text
    assert markdown() in text


def test_a_document_without_markers_is_refused(tmp_path, capsys):
    with pytest.raises(ConfigurationError, match='markers'):
        inserted('nothing')
    document = tmp_path / 'landing.md'
    document.write_text('nothing')
    assert main([str(document)]) == 2
    assert 'markers' in capsys.readouterr().err

# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the table of transitions into docs/landing.md.

``python -m peace_ros.lab.transition_docs docs/landing.md`` replaces what stands between the two
markers.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from peace_ros.core.domain import ConfigurationError, PeaceError
from peace_ros.core.domain.parameters import describe
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.states import GUARDS, RULES, Rule, State

BEGIN = '<!-- transitions: written by python -m peace_ros.lab.transition_docs docs/landing.md -->'
END = '<!-- end of transitions -->'
_KNOWN = {info.name: info for info in describe(LandingParameters)}


def markdown() -> str:
    """Return the table of what outranks every plan, and that of the plan of each state."""
    rows = [
        '| what holds, checked from top to bottom | next state | reason in the status |',
        '|---|---|---|',
        *(_row((_words(rule), rule.target.value, _reason(rule))) for rule in GUARDS),
        '',
        '| state | what holds, checked from top to bottom | next state | reason in the status |',
        '|---|---|---|---|',
    ]
    rows += [
        _row((state.value, _words(rule), rule.target.value, _reason(rule)))
        for state in State
        for rule in RULES[state]
    ]
    return '\n'.join(rows) + '\n'


def inserted(document: str) -> str:
    """Return a document with the tables between its markers.

    Raises:
        ConfigurationError: the markers are missing.
    """
    begin, end = document.find(BEGIN), document.find(END)
    if begin < 0 or end < begin:
        raise ConfigurationError(
            f'the markers {BEGIN!r} and {END!r} are missing: add both lines where the tables belong'
        )
    return f'{document[: begin + len(BEGIN)]}\n\n{markdown()}\n{document[end:]}'


def _words(rule: Rule) -> str:
    """Return the condition; parameters are named with their defaults."""

    def name(match: re.Match[str]) -> str:
        info = _KNOWN[match.group(1)]
        return f'`{info.name}` ({info.default:g})'

    return re.sub(r'\{(\w+)\}', name, rule.when)


def _reason(rule: Rule) -> str:
    """Return the sentence; what an event fills in stands in italics."""
    return re.sub(r'\{(\w+)\}', lambda match: f'*{match.group(1).replace("_", " ")}*', rule.reason)


def _row(cells: tuple[str, ...]) -> str:
    return f'| {" | ".join(cells)} |'


def main(args: Sequence[str] | None = None) -> int:
    """Write the tables into the document named by the argument; without one, print them."""
    given = sys.argv[1:] if args is None else list(args)
    if not given:
        sys.stdout.write(markdown())
        return 0
    path = Path(given[0])
    try:
        path.write_text(inserted(path.read_text(encoding='utf-8')), encoding='utf-8')
    except (OSError, PeaceError) as error:
        sys.stderr.write(f'{path}: {error}\n')
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())

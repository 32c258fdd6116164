# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options of a verb: declared once as the fields of a class, and read by every typer."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields
from operator import getitem
from types import UnionType
from typing import Annotated, Any, Optional, get_args, get_origin, get_type_hints

Verb = Callable[..., None]


def with_options(kind: type) -> Callable[[Verb], Verb]:
    """Give a verb the fields of a dataclass as options; it gets them as ``options``."""

    def decorate(verb: Verb) -> Verb:
        @functools.wraps(verb)
        def run(**given: Any) -> None:
            names = [each.name for each in fields(kind)]
            verb(options=kind(**{name: given.pop(name) for name in names}), **given)

        own = dict(inspect.signature(verb, eval_str=True).parameters)
        del own['options']
        hints = get_type_hints(kind, include_extras=True)
        shared = [
            inspect.Parameter(
                each.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=each.default,
                annotation=hints[each.name],
            )
            for each in fields(kind)
        ]
        parameters = [*own.values(), *shared]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate


def for_typer(verb: Verb) -> Verb:
    """Return the verb with annotations that the typer of Ubuntu 24.04 (0.9) understands.

    It does not evaluate annotations that are strings, and reads ``Optional[Path]``, not
    ``Path | None``.
    """

    @functools.wraps(verb)
    def run(**given: Any) -> None:
        verb(**given)

    hints = get_type_hints(verb, include_extras=True)
    parameters = [
        each.replace(annotation=_with_optional(hints[each.name]))
        for each in inspect.signature(verb).parameters.values()
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run


def _with_optional(hint: Any) -> Any:
    """Return ``Optional[X]`` for ``X | None``, also inside Annotated."""
    if get_origin(hint) is Annotated:
        kind, *rest = get_args(hint)
        return getitem(Annotated, (_with_optional(kind), *rest))
    if get_origin(hint) is UnionType:
        (kind,) = (each for each in get_args(hint) if each is not type(None))
        return Optional[kind]  # noqa: UP045 - made for who reads only this
    return hint

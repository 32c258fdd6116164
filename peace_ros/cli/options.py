# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options of a verb that are declared once, as the fields of a class."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Any, get_type_hints

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

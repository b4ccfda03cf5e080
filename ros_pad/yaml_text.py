# SPDX-License-Identifier: Apache-2.0
"""Read YAML texts with limits; PyYAML is imported here, and only when a text is read."""

from __future__ import annotations

from typing import Any

import yaml

SAFE_LOADER: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
"""The safe loader of libyaml, six times as fast as that of PyYAML, where PyYAML has it."""

DEEPEST_YAML = 100
"""Most levels of nesting of a YAML text."""


class _StrictLoader(SAFE_LOADER):
    """A safe loader that raises an error for a key that occurs twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return the content of a mapping; raise ConstructorError for a key that occurs twice."""
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'key {key.value!r} occurs twice', key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_yaml(text: str) -> Any:
    """Return the content of a YAML text.

    Raises
    ------
    yaml.YAMLError
        When the text is not valid, has a key twice, or is nested more than 100 deep.
    Exception
        Of other kinds, for text that only looks like a date or number (2026-99-99, !!int '').
    """
    depth = 0
    # The functions that make objects from events call themselves for each level of nesting; those
    # of libyaml end the process when the stack is full.
    for event in yaml.parse(text, Loader=SAFE_LOADER):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEEPEST_YAML:
                problem = f'nested more than {DEEPEST_YAML} deep'
                mark: Any = event.start_mark  # libyaml has a class of its own
                raise yaml.MarkedYAMLError(None, None, problem, mark)
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
    return yaml.load(text, Loader=_StrictLoader)

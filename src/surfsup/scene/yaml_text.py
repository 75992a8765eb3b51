"""YAML from strangers: plain data or one clear line."""

from __future__ import annotations

import yaml

from surfsup.errors import InputError


class PlainLoader(yaml.SafeLoader):
    """YAML without what can hide or multiply content: no aliases, no key twice.

    A few lines of nested aliases unfold to more values than a machine can hold ("billion laughs"), and of two
    equal keys YAML silently keeps the last.
    """

    def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node:
        """The next node; an alias is refused."""
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.MarkedYAMLError(
                problem="aliases are not read, write the values out", problem_mark=event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        """The mapping; a key that comes twice is refused."""
        seen = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.MarkedYAMLError(problem=f"key '{name}' comes twice", problem_mark=key.start_mark)
            seen.add(name)
        return super().construct_mapping(node, deep)


def parse_yaml(text: str, source: str) -> object:
    """The data that ``text`` holds.

    Args:
        text: YAML.
        source: what to call the text in a complaint, usually the file's name.

    Raises:
        InputError: it is not YAML, or not plain data.
    """
    try:
        return yaml.load(text, PlainLoader)  # a safe loader
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1} " if mark else ""
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or error
    except RecursionError:
        where, reason = "", "it is nested too deep"
    except (ValueError, AttributeError, TypeError) as error:
        # Dates and numbers that look right and are not: the YAML library lets Python's own errors through.
        where, reason = "", error
    raise InputError(f"{source}: {where}is not YAML that can be read: {' '.join(str(reason).split())}")

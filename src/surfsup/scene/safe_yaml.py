"""YAML from untrusted files: plain data or an error of one line."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import yaml

from surfsup.errors import InputError


class PlainLoader(yaml.SafeLoader):
    """A safe loader that also refuses aliases and duplicate keys.

    A few lines of nested aliases expand to more values than fit in memory ("billion laughs"). YAML silently keeps the
    last of two equal keys.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose the next node.

        Raises:
            MarkedYAMLError: it is an alias.
        """
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.MarkedYAMLError(
                problem="aliases are not allowed, repeat the value", problem_mark=event.start_mark
            )
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Construct a dictionary.

        Raises:
            MarkedYAMLError: a key occurs twice.
        """
        seen = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.MarkedYAMLError(problem=f"key '{name}' occurs twice", problem_mark=key.start_mark)
            seen.add(name)
        return super().construct_mapping(node, deep)


def parse_yaml(text: str, source: str) -> object:
    """Parse YAML into plain data.

    Args:
        text: YAML.
        source: name of the text in an error message, usually the file's.

    Raises:
        InputError: the text is not YAML, or not plain data.
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
        # The YAML library passes on Python's own errors about dates and numbers that only look right.
        where, reason = "", error
    raise InputError(f"{source}: {where}is not YAML: {' '.join(str(reason).split())}")

"""Reads YAML that somebody else wrote, at a cost that its length bounds.

An alias makes a list of a file's few bytes as long as it likes ("billion laughs"), and the parser calls itself for each
level of nesting.
"""

from typing import Any

import yaml


class _Loader(yaml.SafeLoader):
    """Without aliases, which no map and no zone needs."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        """yaml: the next value."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not read")
        return super().compose_node(parent, index)


def load_first_document(text: str) -> Any:
    """The values of the first document; None for an empty text.

    Raises:
        ValueError: it is no YAML, or holds aliases, or is nested too deep.
    """
    try:
        return next(yaml.load_all(text, _Loader), None)
    except (yaml.YAMLError, OverflowError) as error:
        raise ValueError(f"not valid YAML: {' '.join(str(error).split())}") from error
    except RecursionError:
        raise ValueError("not valid YAML: lists or tables are nested too deep") from None

"""Reads YAML that somebody else wrote, at a cost that its length bounds.

An alias makes a list of a file's few bytes as long as it likes ("billion laughs"), and the parser calls itself for each
level of nesting.
"""

from collections.abc import Callable
from typing import Any, Final

import yaml
from yaml.composer import Composer


class _WithoutAliases(Composer):
    """Aliases, which no map and no zone needs, are refused."""

    check_event: Callable[..., bool]

    def compose_node(self, parent: Any, index: Any) -> Any:
        """yaml: the next value."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not read")
        return super().compose_node(parent, index)


class PlainLoader(_WithoutAliases, yaml.SafeLoader):
    """In Python alone."""


def _fast_loader() -> type[Any]:
    """With the parser of libyaml, which takes a quarter of the time; values are still composed in Python.

    PyYAML may be built without it.
    """
    try:
        from yaml import CSafeLoader
    except ImportError:
        return PlainLoader

    class FastLoader(_WithoutAliases, CSafeLoader):
        def __init__(self, text: str) -> None:
            CSafeLoader.__init__(self, text)
            Composer.__init__(self)

    return FastLoader


LOADER: Final = _fast_loader()


def load_first_document(text: str) -> Any:
    """The values of the first document; None for an empty text.

    Raises:
        ValueError: it is no YAML, or holds aliases, or is nested too deep.
    """
    try:
        return next(yaml.load_all(text, LOADER), None)
    except (yaml.YAMLError, OverflowError) as error:
        raise ValueError(f"not valid YAML: {' '.join(str(error).split())}") from error
    except RecursionError:
        raise ValueError("not valid YAML: lists or tables are nested too deep") from None

"""Packages as if they were not installed."""

import sys

import pytest

URDF_PARSER = ("urdf_parser_py", "lxml")
PILLOW = ("PIL",)

USERS = ("chefbotd.components.maps.cli.png", "chefbotd.settings.description", "chefbotd.settings.description")
"""Our modules that import one of these when they are imported themselves: another test may have loaded them."""


def hide(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Let every import of these packages fail as it does where they are not installed."""
    for name in [*sys.modules]:
        if name.partition(".")[0] in packages or name in USERS:
            monkeypatch.delitem(sys.modules, name)
    for package in packages:
        monkeypatch.setitem(sys.modules, package, None)

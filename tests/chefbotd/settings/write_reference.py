"""Writes docs/reference/configuration.md from the classes that check a configuration: part of ``make client``."""

from pathlib import Path

from chefbotd.settings.reference import page

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "configuration.md"

if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

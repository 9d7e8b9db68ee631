"""Checks in Chromium that every page of the site fits a desktop and a phone: python docs/_site/check_widths.py [SITE].

What is wider than the window must scroll within itself. Without Chromium or Playwright it says that nothing is checked.
"""

import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

WIDTHS_PX = (1280, 390)
HEIGHT_PX = 900
WIDER = """() => {
  const room = document.documentElement.clientWidth;
  const scrolls = (part) => part && part !== document.body
    && (["auto", "scroll"].includes(getComputedStyle(part).overflowX) || scrolls(part.parentElement));
  const isWide = (part) => {
    const box = part.getBoundingClientRect();
    return box.width > 0 && box.left < room && box.right > room + 1 && !scrolls(part);
  };
  const wide = [...document.querySelectorAll("article *")].filter(isWide);
  const words = document.createRange();
  const isNarrow = (cell) => {
    words.selectNodeContents(cell);
    const box = words.getBoundingClientRect();
    return box.width > 0 && box.width < 60 && box.height > 80;
  };
  const narrow = [...document.querySelectorAll("article td, article th")].filter(isNarrow);
  return {
    page_px: document.documentElement.scrollWidth,
    room_px: room,
    wide: wide.slice(-1).map((part) => `${part.tagName.toLowerCase()}: ${part.textContent.trim().slice(0, 60)}`),
    narrow: narrow.slice(0, 1).map((part) => part.textContent.trim().slice(0, 60)),
  };
}"""
"""How wide a page is, and the innermost part that sticks out."""


def main(site: Path) -> int:
    """Name each page that is wider than its window; the exit code says whether there is one."""
    chromium = shutil.which("chromium")
    if chromium is None or find_spec("playwright") is None:
        click.echo("The widths of the pages were not checked: Chromium or Playwright is missing")
        return 0
    problems = list(check(site, chromium))
    click.echo("\n".join(problems) or f"Every page fits windows of {' and '.join(map(str, WIDTHS_PX))} px")
    return 1 if problems else 0


def check(site: Path, chromium: str) -> Iterator[str]:
    """Each page at each width."""
    from playwright.sync_api import sync_playwright

    pages = sorted(path for path in site.rglob("*.html") if "_static" not in path.parts)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for width_px in WIDTHS_PX:
            window = browser.new_page(viewport={"width": width_px, "height": HEIGHT_PX})
            for path in pages:
                window.goto(path.resolve().as_uri(), wait_until="load")
                if problem := width_problem(window.evaluate(WIDER)):
                    yield f"{path.relative_to(site)} at {width_px} px: {problem}"
        browser.close()


def width_problem(seen: dict[str, Any]) -> str:
    """What is wrong with a page; empty where nothing is."""
    if seen["page_px"] > seen["room_px"]:
        return f"{seen['page_px']} px wide ({'; '.join(seen['wide'])})"
    if seen["wide"]:
        return f"cut off: {'; '.join(seen['wide'])}"
    return f"a column too narrow to be read: {'; '.join(seen['narrow'])}" if seen["narrow"] else ""


if __name__ == "__main__":
    sys.exit(main(Path(*sys.argv[1:2] or ["build/site"])))

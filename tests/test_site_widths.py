"""The check of the site's widths in Chromium, which `make docs` runs on every page."""

import os
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parents[1] / "docs" / "_site" / "check_widths.py"
CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(not SCRIPT.exists(), reason="the documentation is not part of an installed package"),
]


@pytest.fixture(scope="module")
def check_widths() -> Iterator[Any]:
    """The script, as a module."""
    if CHROMIUM is None or find_spec("playwright") is None:
        pytest.fail("no browser") if os.environ.get("ADDONS_TESTS") == "required" else pytest.skip(
            "no browser"
        )
    spec = spec_from_file_location("check_widths", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules["check_widths"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["check_widths"]


def test_what_sticks_out_of_a_window_is_named(check_widths: Any, tmp_path: Path) -> None:
    """A part of 600 px fits 1280 px alone, one of 2,000 px neither; one that scrolls within itself fits both."""
    page = '<html><body><article style="overflow: {}"><p style="width: {}px">{}</p></article></body></html>'
    for name, overflow, width_px in (("a", "visible", 600), ("b", "hidden", 2000), ("c", "auto", 2000)):
        (tmp_path / f"{name}.html").write_text(page.format(overflow, width_px, name * 3))
    told = [line.split(": ", 1) for line in check_widths.check(tmp_path, CHROMIUM)]
    assert [where for where, _ in told] == ["b.html at 1280 px", "a.html at 390 px", "b.html at 390 px"]
    assert all(name in why for (_, why), name in zip(told, ("bbb", "aaa", "bbb"), strict=True))


def test_a_column_whose_words_fall_apart_is_named(check_widths: Any, tmp_path: Path) -> None:
    """One of 20 px in which a name stands letter below letter, beside one that has room for it."""
    cell = '<td style="width: {0}px; max-width: {0}px; overflow-wrap: anywhere"><code>{1}</code></td>'
    row = cell.format(20, "goal_reached") + cell.format(200, "goal_failed")
    (tmp_path / "a.html").write_text(
        f"<html><body><article><table><tr>{row}</tr></table></article></body></html>"
    )
    told = list(check_widths.check(tmp_path, CHROMIUM))
    assert len(told) == 2
    assert all(line.endswith("a column too narrow to be read: goal_reached") for line in told)

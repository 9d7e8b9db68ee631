"""The notebook runs from its first cell to its last on a simulated robot, and is kept without outputs."""

import asyncio
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from chefbotd.cli.drive.simulated_daemon import simulated_daemon

NOTEBOOK = Path(__file__).with_name("drive.ipynb")


def code_cells(path: Path) -> list[dict[str, Any]]:
    """The cells with code, as in the file."""
    cells: list[dict[str, Any]] = json.loads(path.read_text())["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def test_it_is_kept_without_outputs() -> None:
    """A change of it can be read, and no picture grows the repository."""
    cells = code_cells(NOTEBOOK)
    assert [cell["outputs"] for cell in cells] == [[]] * 5
    assert {cell["execution_count"] for cell in cells} == {None}


def test_it_draws_two_pictures_and_drives_the_arc(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """At 0.5 rad/s for 3 s it turns by 86 degrees less the ramp, and drives 0.6 m less the ramp."""
    executed = Path(shutil.copy(NOTEBOOK, tmp_path))
    execute = [sys.executable, "-m", "jupyter", "execute", "--inplace", str(executed)]

    async def run() -> None:
        async with simulated_daemon("chefbot_lidar", {"CHEFBOTD_WATCHDOG__TIMEOUT_S": "3.0"}) as (where, _):
            monkeypatch.setenv("CHEFBOTCTL_CONNECT", str(where))
            monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
            await asyncio.to_thread(subprocess.run, execute, check=True, timeout=100)

    asyncio.run(run())
    outputs = [output for cell in code_cells(executed) for output in cell["outputs"]]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    (text,) = ["".join(output["text"]) for output in outputs if output["output_type"] == "stream"]
    metres, degrees = float(text.split()[0]), float(text.split()[2])
    assert 0.4 < metres < 0.75
    assert 60 < degrees < 100

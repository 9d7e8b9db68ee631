"""packaging/set_up.py, which makes the environment of a checkout."""

import importlib.util
import venv
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parents[1] / "packaging" / "set_up.py"
if not SCRIPT.exists():
    pytest.skip("only the sources have it", allow_module_level=True)


def test_ctrl_c_ends_it_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No traceback: who interrupts the first ``make run`` reads that the next one goes on."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    spec = importlib.util.spec_from_file_location("set_up", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    set_up = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(set_up)
    monkeypatch.setattr(venv, "create", interrupted)
    assert set_up.main([str(tmp_path / "environment")]) == 130
    assert "Interrupted: run it again to go on" in capsys.readouterr().out

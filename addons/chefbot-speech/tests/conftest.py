"""What the tests need of this computer."""

import os
import shutil

import pytest


@pytest.fixture(scope="session")
def espeak() -> str:
    """The path of espeak-ng; where it is missing, tests are skipped, unless ADDONS_TESTS=required."""
    path = shutil.which("espeak-ng")
    if path is None:
        why = "espeak-ng is not installed: make addons-tools"
        pytest.fail(why) if os.environ.get("ADDONS_TESTS") == "required" else pytest.skip(why)
    return path

"""What chefbotctl loads before it knows which command is wanted."""

import subprocess
import sys


def test_what_takes_long_to_load_is_loaded_by_the_commands_that_need_it():
    """None of these is there once every command can be listed; each takes longer than all of click."""
    heavy = ("pydantic", "numpy", "rich", "structlog", "textual", "zeroconf", "aiohttp", "mcap", "matplotlib")
    listing = f"""
import sys
from chefbotd.cli.programs import chefbotctl
sys.exit(", ".join(name for name in {heavy} if name in sys.modules) or 0)
"""
    done = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")

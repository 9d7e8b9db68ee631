"""The page in the browser: its files, and a WebSocket with the methods of the command socket."""

from pathlib import Path
from typing import Final

STOPS_SCRIPT: Final = Path(__file__).parent / "page" / "stops.js"
"""Buttons that act at the first contact: served as ``/stops.js`` by the pages of other programs too."""

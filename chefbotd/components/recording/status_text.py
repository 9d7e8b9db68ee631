"""The row of chefbotctl's status for the recorder."""

from chefbotd.cli.common.state_text import Data, Fact, Style, reason_of


def recording(data: Data) -> Fact:
    """What is being recorded, and what was lost."""
    parts = [data["state"]]
    if data["state"] == "recording":
        parts += [str(data["name"]), f"{data['seconds']:.0f} s", f"{data['bytes_written'] / 1e6:.1f} MB"]
    parts += [f"{data['dropped']} events dropped"] if data["dropped"] else []
    bad = data["state"] == "failed" or data["dropped"]
    return Fact("recording", ", ".join([*parts, *reason_of(data)]), Style.NOTICE if bad else Style.PLAIN)

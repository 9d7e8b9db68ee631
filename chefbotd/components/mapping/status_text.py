"""The row of chefbotctl's status for mapping."""

from chefbotd.cli.common.state_text import Data, Fact, Style, reason_of


def mapping(data: Data) -> Fact:
    """The map that is being made."""
    if data["state"] == "idle":
        left = "one was never finished" if data["unfinished"] else "none is being made"
        return Fact("mapping", left, Style.NOTICE if data["unfinished"] else Style.PLAIN)
    text = f"{data['state']}, {data['path_m']:.1f} m driven, {data['loops']} loops closed"
    return Fact(
        "mapping", ", ".join([text, *reason_of(data)]), Style.NOTICE if data["reason"] else Style.GOOD
    )

"""The row of chefbotctl's status for localization."""

from chefbotd.cli.common.state_text import Data, Fact, Style, reason_of


def localization(data: Data) -> Fact:
    """Whether the robot knows where it is, on which map, and how well the scan fits."""
    if data["map"] is None:
        return Fact("place", "no map is in use")
    style = {"localized": Style.GOOD, "lost": Style.ALARM}.get(data["state"], Style.NOTICE)
    text = f"{data['state']} on {data['map']}, fit {100 * data['fit']:.0f} %"
    return Fact("place", ", ".join([text, *reason_of(data)]), style)

"""The row of chefbotctl's status for navigation."""

from chefbotd.cli.common.state_text import Data, Fact, Style
from chefbotd.components.navigation.algorithms.states import FAILED


def navigation(data: Data) -> Fact:
    """The goal: its state, how far it is, and why it waits or has ended."""
    left = f"{data['distance_m']:.1f} m left" if data["distance_m"] is not None else ""
    failed = data["state"] in FAILED
    says_state = data["reason"].startswith(data["state"])  # such as "reached (1.25, 3.00)"
    parts = [data["reason"], left] if says_state else [data["state"], left, data["reason"]]
    return Fact("goal", ", ".join(filter(None, parts)), Style.NOTICE if failed else Style.PLAIN)

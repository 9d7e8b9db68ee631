"""The row of chefbotctl's status for the worker."""

from chefbotd.cli.common.state_text import Data, Fact, Style, reason_of


def worker(data: Data) -> Fact:
    """The state of the worker process, and what it takes."""
    used = [f"{data['rss_mb']:.0f} MB"] if data["rss_mb"] is not None else []
    used += [f"{data['cpu']:.2f} core"] if data["cpu"] is not None else []
    style = Style.GOOD if data["state"] == "ready" else Style.NOTICE
    return Fact("worker", ", ".join([data["state"], *used, *reason_of(data)]), style)

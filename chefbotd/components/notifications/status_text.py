"""The row of chefbotctl's status for messages to somebody who is away."""

from typing import Final

from chefbotd.cli.common.state_text import Data, Fact, Style

FARED: Final = {"silent": "nothing sent yet", "waits": "waits", "taken": "sent", "given_up": "given up"}


def notifications(data: Data) -> Fact:
    """Who is told, and how the last message fared."""
    servers = data["servers"]
    bad = any(server["problem"] for server in servers)
    text = "; ".join(_words_of(server) for server in servers)
    return Fact("told when away", text or "nobody", Style.NOTICE if bad else Style.PLAIN)


def _words_of(server: Data) -> str:
    last = f"'{server['title']}' " if server["title"] else ""
    problem = f" ({server['problem']})" if server["problem"] else ""
    more = f", {server['waiting']} waiting" if server["waiting"] > 1 else ""
    return f"{server['name']} at {server['host']}: {last}{FARED[server['state']]}{problem}{more}"

"""How the robot is found on the network."""

import re

from pydantic import Field, field_validator

from chefbotd.core.parameters import Parameters

LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
"""A label of a host's name: RFC 1123, section 2.1."""


class DiscoveryParameters(Parameters):
    """``name`` is what the robot is called on the network, with ``.local`` as a host; left out: ``[robot] name``."""

    enabled: bool = False
    """The robot announces itself on the network; it needs the extra ``discovery``."""
    name: str | None = Field(
        None,
        description='The name on the network, such as "kitchen-bot": letters, digits and hyphens, at most 63',
    )

    @field_validator("name")
    @classmethod
    def _is_a_label(cls, name: str | None) -> str | None:
        if name is not None and not re.fullmatch(LABEL, name):
            raise ValueError(
                f"expected letters, digits and hyphens, at most 63, such as kitchen-bot, got {name!r}"
            )
        return name

    def label(self, robot: str) -> str:
        """The name on the network; a robot's own name may hold what a host's may not."""
        return self.name or re.sub(r"[^a-z0-9]+", "-", robot.lower()).strip("-")[:63].strip("-") or "chefbot"

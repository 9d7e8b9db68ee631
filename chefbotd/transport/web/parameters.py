"""The parameters of the page: its address and its names."""

from pydantic import Field, field_validator

from chefbotd.core.parameters import Parameters


class PageParameters(Parameters):
    """The page; who may do what there is what ``[api]`` says.

    ``allowed_hosts`` are the names under which browsers may open it. Its addresses and ``localhost`` need no mention: a
    foreign name is what an attack by DNS would come with.
    """

    enabled: bool = False
    host: str = Field("127.0.0.1", min_length=1, description="address to listen on; loopback by default")
    port: int = Field(7380, ge=0, le=65535, description="TCP port; 0 lets the system choose")
    allowed_hosts: tuple[str, ...] = Field((), description='names of the robot, such as "chefbot.local"')

    @field_validator("allowed_hosts")
    @classmethod
    def _are_names(cls, hosts: tuple[str, ...]) -> tuple[str, ...]:
        for host in hosts:
            if not host or any(character in host for character in "/:*@ "):
                raise ValueError(
                    f"expected names without scheme and port, such as chefbot.local, got {host!r}"
                )
        return tuple([host.lower() for host in hosts])

"""Where the page listens."""

import re
from urllib.parse import urlsplit

from pydantic import Field, field_validator

from chefbotd.core.parameters import Parameters


class PageParameters(Parameters):
    """The page; who may do what there is what ``[api]`` says.

    ``allowed_hosts`` are the names under which browsers may open it. Its addresses and ``localhost`` need no mention: a
    foreign name is what an attack by DNS would come with. ``origins`` are those of a proxy that shows the page as its
    own: scheme, name, and the port if it is not the scheme's.
    """

    enabled: bool = False
    """A page in the browser is served; it needs the extra ``page``."""
    host: str = Field("127.0.0.1", min_length=1, description="The address to listen on; loopback by default")
    port: int = Field(7380, ge=0, le=65535, description="The TCP port; 0 lets the system choose")
    allowed_hosts: tuple[str, ...] = Field(
        (), description='Names under which browsers may open the page, such as "chefbot.local"'
    )

    origins: tuple[str, ...] = Field(
        (), description='Where a proxy of yours shows the page, such as "https://robot.example"'
    )

    @field_validator("origins")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        return tuple([_origin(origin) for origin in origins])

    @property
    def host_names(self) -> tuple[str, ...]:
        """Every name under which a browser may open it: a proxy may pass on the name that it was asked for."""
        return (
            *self.allowed_hosts,
            *(name for origin in self.origins if (name := urlsplit(origin).hostname)),
        )

    @field_validator("allowed_hosts")
    @classmethod
    def _are_names(cls, hosts: tuple[str, ...]) -> tuple[str, ...]:
        for host in hosts:
            if not host or any(character in host for character in "/:*@ "):
                raise ValueError(
                    f"expected names without scheme and port, such as chefbot.local, got {host!r}"
                )
        return tuple([host.lower() for host in hosts])


DEFAULT_PORTS = {"http": 80, "https": 443}


def _origin(text: str) -> str:
    """An origin as browsers send it: in lower case, and without the port that its scheme has anyway."""
    expected = (
        f"expected scheme and name, such as https://robot.example or https://robot.example:8443, got {text!r}"
    )
    try:
        parts = urlsplit(text.lower())
        port = parts.port
    except ValueError as problem:
        raise ValueError(expected) from problem
    name = parts.hostname or ""
    is_bare = not parts.path.strip("/") and not parts.query and not parts.fragment and parts.username is None
    if parts.scheme not in DEFAULT_PORTS or not is_bare or not re.fullmatch(r"[a-z0-9.:-]+", name):
        raise ValueError(expected)
    host = f"[{name}]" if ":" in name else name
    return f"{parts.scheme}://{host}" + ("" if port in (None, DEFAULT_PORTS[parts.scheme]) else f":{port}")

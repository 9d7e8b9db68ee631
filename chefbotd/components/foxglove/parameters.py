"""Where Foxglove's server listens."""

from pydantic import Field, field_validator

from chefbotd.core.parameters import Parameters
from chefbotd.rpc.parameters import is_loopback


class FoxgloveParameters(Parameters):
    """The server for Foxglove, which only shows. Its protocol knows no tokens, so it stays on this computer."""

    enabled: bool = False
    """Topics are served live to Foxglove; it needs the extra ``foxglove``."""
    host: str = Field(
        "127.0.0.1",
        min_length=1,
        description="The address to listen on; from elsewhere: ssh -L 8765:localhost:8765",
    )
    port: int = Field(8765, ge=0, le=65535, description="The TCP port; 0 lets the system choose")

    @field_validator("host")
    @classmethod
    def _stays_here(cls, host: str) -> str:
        if not is_loopback(host):
            raise ValueError(
                f"the protocol of Foxglove knows no tokens, so it is served on this computer only, got {host!r}: "
                "leave 127.0.0.1, and run ssh -L 8765:localhost:8765 on the other computer"
            )
        return host

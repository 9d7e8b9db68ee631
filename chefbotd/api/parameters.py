"""Where the socket listens and what a client may cost."""

from pydantic import Field

from chefbotd.core.parameters import Parameters


class ApiParameters(Parameters):
    """The command socket's limits; memory for a client is at most the two buffers and one request."""

    host: str = Field("127.0.0.1", min_length=1, description="address to listen on; loopback by default")
    port: int = Field(7333, ge=0, le=65535, description="TCP port; 0 lets the system choose")
    max_clients: int = Field(128, ge=1, le=4096)
    max_request_bytes: int = Field(4096, ge=256, le=1 << 20, description="a longer line ends the connection")
    requests_per_turn: int = Field(32, ge=1, le=1024, description="then others have a turn")
    write_buffer_bytes: int = Field(
        32_768, ge=4096, le=1 << 24, description="unread output before telemetry waits"
    )
    outbox_bytes: int = Field(
        131_072, ge=4096, le=1 << 24, description="waiting telemetry before the oldest goes"
    )
    stuck_s: float = Field(
        5.0, gt=0.0, le=600.0, description="a client that reads nothing for so long is cut off"
    )

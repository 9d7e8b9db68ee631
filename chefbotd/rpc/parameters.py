"""The parameters of the socket: its address, access, and the limits of a client."""

import ipaddress
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationInfo, field_serializer, field_validator

from chefbotd.core.parameters import Parameters


class Role(StrEnum):
    """What a client may do; each includes the ones before it, but a guest has only what is ``for_guests`` of observers'.

    ``observe`` looks, and stops the robot; ``guest`` answers and presses the buttons of agents; ``agent`` is one, and
    sends the robot to goals; ``drive`` moves it in any way; ``admin`` changes how it works.
    """

    rank: int

    OBSERVE = "observe"
    GUEST = "guest"
    AGENT = "agent"
    DRIVE = "drive"
    ADMIN = "admin"

    def __init__(self, _: str) -> None:
        self.rank = len(type(self).__members__)

    def allows(self, needed: "Role") -> bool:
        """Whether a client with this role may call a method that needs ``needed``."""
        return self.rank >= needed.rank


class ApiParameters(Parameters):
    """The command socket's guards and limits; a client's memory is at most what these buffers hold."""

    token_file: Path | None = Field(
        None, description="A file with a line for each token, ROLE TOKEN; readable by its owner only"
    )
    token_credential: str | None = Field(
        None,
        min_length=1,
        pattern=r"^[\w.-]+$",
        description="The name of a systemd credential of the same form, instead of a file",
    )
    host: str = Field("127.0.0.1", min_length=1, description="The address to listen on; loopback by default")
    port: int = Field(7333, ge=0, le=65535, description="The TCP port; 0 lets the system choose")
    tls_certificate: Path | None = Field(
        None,
        description="The certificate of the socket and the page (PEM, with its chain): with it they speak TLS alone",
    )
    tls_key: Path | None = Field(
        None, validate_default=True, description="The certificate's key (PEM); readable by its owner only"
    )
    default_role: Role = Field(Role.ADMIN, description="The role of a client where no token is asked for")
    arm_role: Role = Field(Role.DRIVE, description="The least role that may arm")

    max_clients: int = Field(128, ge=1, le=4096)
    """The most clients at a time."""
    max_clients_per_address: int = Field(
        112,
        ge=1,
        le=4096,
        description="The most clients from one address, so that they leave room for others",
    )
    reserved_stop_connections: int = Field(
        8, ge=0, le=16, description="Connections reserved for stop and estop when all others are taken"
    )
    max_new_connections: int = Field(
        2048,
        ge=1,
        le=8192,
        description="The most connections that have shown no token yet, or sent no request where none is asked for",
    )
    max_request_bytes: int = Field(4096, ge=256, le=1 << 20, description="A longer line ends the connection")
    backlog_bytes: int = Field(
        65_536, ge=4096, le=131_072, description="The answers that may wait for a client that does not read"
    )
    requests_per_turn: int = Field(
        32,
        ge=1,
        le=1024,
        description="The requests of all clients that are served before everything else runs",
    )
    requests_per_s: float = Field(
        2000.0,
        ge=1.0,
        le=1e6,
        description="The requests of a client that are served a second; stop and estop always pass",
    )
    requests_burst: int = Field(
        2000, ge=1, le=1_000_000, description="The most requests of a client that are served at once"
    )
    write_buffer_bytes: int = Field(
        32_768,
        ge=4096,
        le=1 << 24,
        description="The output that a client may leave unread before its telemetry waits",
    )
    outbox_bytes: int = Field(
        131_072,
        ge=4096,
        le=1 << 24,
        description="The telemetry that may wait for a client before the oldest is dropped",
    )
    write_timeout_s: float = Field(
        5.0, gt=0.0, le=600.0, description="A client that reads nothing for so long is disconnected"
    )
    authenticate_timeout_s: float = Field(
        5.0, gt=0.0, le=600.0, description="The longest time for TLS, and then for the token"
    )
    request_timeout_s: float = Field(
        10.0,
        gt=0.0,
        le=600.0,
        description="The longest time from a request's first byte to the end of its line",
    )
    idle_timeout_s: float = Field(
        600.0,
        gt=0.0,
        le=1e6,
        description="A client without a request and without a subscription is disconnected after so long",
    )
    lease_s: float = Field(
        3.0, ge=0.1, le=600.0, description="Control is released so long after the last command"
    )

    @field_validator("host")
    @classmethod
    def _guarded_off_loopback(cls, host: str, info: ValidationInfo) -> str:
        if not is_loopback(host) and not (info.data.get("token_file") or info.data.get("token_credential")):
            raise ValueError(
                "a socket that other computers can reach needs a token: set api.token_file (or api.token_credential), "
                "and better api.tls_certificate and api.tls_key too; or listen on 127.0.0.1"
            )
        return host

    @field_validator("tls_key")
    @classmethod
    def _key_and_certificate(cls, key: Path | None, info: ValidationInfo) -> Path | None:
        if (key is None) != (info.data.get("tls_certificate") is None):
            raise ValueError("TLS needs both, api.tls_certificate and api.tls_key")
        return key


class PluginsParameters(Parameters):
    """The plug-ins that run: a package that is installed does nothing before it is allowed.

    As JSON, which recordings and support bundles hold, ``settings`` is empty.
    """

    allow: tuple[str, ...] = Field(
        (), description="The packages of others that may run in the daemon, by the name of their entry point"
    )
    settings: Mapping[str, Mapping[str, Any]] = Field(
        {}, description="A table for each plug-in that is allowed, with its own keys"
    )

    @field_serializer("settings", when_used="json")
    def _left_out(self, _: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        """In no file that is passed on: only the plug-in knows which of its keys hold a secret."""
        return {}

    @field_validator("allow")
    @classmethod
    def _each_once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"each plug-in is allowed once, got {', '.join(repeated)} more often")
        return names

    @field_validator("settings")
    @classmethod
    def _of_allowed_plugins(
        cls, settings: Mapping[str, Mapping[str, Any]], info: ValidationInfo
    ) -> Mapping[str, Mapping[str, Any]]:
        allowed = info.data.get("allow", ())
        if unknown := sorted(settings.keys() - set(allowed)):
            raise ValueError(
                f"settings for {', '.join(unknown)}, which plugins.allow does not name: it has {list(allowed)}"
            )
        return settings


def is_loopback(host: str) -> bool:
    """Whether only programs on this computer can reach an address; a name other than localhost may be anything."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"

"""The announcement of a robot as a DNS-SD service (RFC 6763): how it is written and read."""

from collections.abc import Mapping

from chefbotd.core.record import Record

SERVICE_TYPE = "_chefbotd._tcp.local."


class Announcement(Record, frozen=True):
    """A robot on the network, by its name. A port is None if only the robot's own computer can reach it."""

    name: str
    addresses: tuple[str, ...]
    port: int | None
    page_port: int | None
    robot: str
    version: str
    encrypted: bool = False

    @property
    def instance(self) -> str:
        """The service's full name."""
        return f"{self.name}.{SERVICE_TYPE}"

    @property
    def host(self) -> str:
        """The host's name, to which the addresses belong."""
        return f"{self.name}.local."

    def properties(self) -> dict[str, str]:
        """The TXT record; unknown values have no key."""
        properties = {"robot": self.robot, "version": self.version, "tls": "1" if self.encrypted else "0"}
        return properties if self.page_port is None else {**properties, "page": str(self.page_port)}


def read(
    instance: str, addresses: tuple[str, ...], port: int | None, properties: Mapping[bytes, bytes | None]
) -> Announcement:
    """Read an announcement, which may contain anything; values that cannot be read are left out."""
    texts = {
        key.decode(errors="replace"): (value or b"").decode(errors="replace")
        for key, value in properties.items()
    }
    page = texts.get("page", "")
    return Announcement(
        instance.removesuffix(f".{SERVICE_TYPE}"),
        addresses,
        port or None,
        int(page) if page.isascii() and page.isdigit() and 0 < int(page) <= 65535 else None,
        texts.get("robot", ""),
        texts.get("version", ""),
        texts.get("tls") == "1",
    )

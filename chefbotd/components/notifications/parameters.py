"""Who is told, and of what."""

from enum import StrEnum
from urllib.parse import urlsplit

from pydantic import Field, SecretStr, field_validator

from chefbotd.core.parameters import Parameters


class NoticeKind(StrEnum):
    """What a message is about; stable names, for programs."""

    GOAL_DONE = "goal_done"
    GOAL_FAILED = "goal_failed"
    STUCK = "stuck"
    BATTERY_LOW = "battery_low"
    FAULT = "fault"
    DAEMON_GONE = "daemon_gone"
    TEST = "test"


class NotificationsParameters(Parameters):
    """The section [notifications]. Addresses are secrets: whoever knows one reads the messages, or sends some."""

    enabled: bool = False
    """Messages are sent; it needs ``ntfy_url`` or ``webhook_url``."""
    ntfy_url: SecretStr | None = Field(
        None, description="The address of an ntfy topic, such as https://ntfy.sh/TOPIC"
    )
    ntfy_token: SecretStr | None = Field(
        None, description="The access token of the ntfy server, where it wants one"
    )
    webhook_url: SecretStr | None = Field(None, description="The address to which each message goes as JSON")
    webhook_token: SecretStr | None = Field(None, description="Sent to the webhook as a bearer token")
    kinds: tuple[NoticeKind, ...] = Field(
        tuple([kind for kind in NoticeKind if kind is not NoticeKind.TEST]),
        description="What messages are sent about",
    )
    stuck_after_s: float = Field(
        60.0, ge=10.0, le=3600.0, description="How long a robot with a goal may come no nearer to it"
    )

    @field_validator("ntfy_url", "webhook_url")
    @classmethod
    def _is_an_address(cls, url: SecretStr | None) -> SecretStr | None:
        if url is not None and not _is_web_address(url.get_secret_value()):
            raise ValueError("expected an address that begins with http:// or https:// and names a host")
        return url

    @field_validator("ntfy_token", "webhook_token")
    @classmethod
    def _fits_into_a_header(cls, token: SecretStr | None) -> SecretStr | None:
        text = "x" if token is None else token.get_secret_value()
        if not text or not text.isascii() or not text.isprintable():
            raise ValueError("expected a token of printable ASCII characters")
        return token


def _is_web_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        return False
    fits = text.isascii() and text.isprintable() and " " not in text and port != 0
    return fits and parts.scheme in ("http", "https") and bool(parts.hostname) and "@" not in parts.netloc

"""The arguments of ``chefbot-vda5050``: what is wrong is a usage error that names it."""

from pathlib import Path

import click
import pytest
from chefbot_vda5050.cli import address_or, broker_of, main
from chefbot_vda5050.service import Parameters
from chefbot_vda5050.topics import Kind
from click.testing import CliRunner

NO_OPTIONS = dict.fromkeys(("tls", "cafile", "certificate", "user", "password_file"))


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("broker.example", "broker.example", 1883),
        ("broker.example:99", "broker.example", 99),
        ("[::1]", "::1", 1883),
        ("[::1]:99", "::1", 99),
    ],
)
def test_a_broker_has_a_name_or_an_address_of_either_kind(text: str, host: str, port: int) -> None:
    """With a port, or with that of MQTT."""
    found = broker_of(NO_OPTIONS | {"broker": text})
    assert (found.host, found.port) == (host, port)


@pytest.mark.parametrize("text", ["::1", "broker:", "broker:65536", "broker:x", ":99", ""])
def test_what_is_no_address_is_named(text: str) -> None:
    """Also an IPv6 address without brackets: where its port begins cannot be told."""
    with pytest.raises(click.BadParameter, match="is not HOST:PORT"):
        address_or(text, 1883)


@pytest.mark.parametrize(
    ("words", "topic"),
    [
        ([], "uagv/v2/chefbot/r1/order"),
        (["--version", "3.0.0"], "vda5050/v3/chefbot/r1/order"),
        (
            ["--version", "3.0.0", "--interface", "plant/a", "--major", "v3.0"],
            "plant/a/v3.0/chefbot/r1/order",
        ),
        (["--manufacturer", "acme", "--major", "v1"], "uagv/v1/acme/r1/order"),
    ],
)
def test_topics_are_those_of_the_version_or_of_the_options(
    words: list[str], topic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is agreed on with those who run the broker; the messages say the version."""
    served: list[Parameters] = []

    async def serve(parameters: Parameters, _: object) -> None:
        served.append(parameters)

    monkeypatch.setattr("chefbot_vda5050.service.serve", serve)
    result = CliRunner().invoke(main, ["run", "127.0.0.1", "r1", *words])
    assert result.exit_code == 0, result.output
    assert served[0].name.topic(Kind.ORDER) == topic
    assert served[0].version == ("3.0.0" if "3.0.0" in words else "2.1.0")


@pytest.mark.parametrize("content", ["", "\n"])
def test_an_empty_token_file_is_a_usage_error(content: str, tmp_path: Path) -> None:
    """It is no mistake of the program."""
    path = tmp_path / "token"
    path.write_text(content)
    result = CliRunner().invoke(main, ["run", "127.0.0.1", "r1", "--token-file", str(path)])
    assert result.exit_code == 2
    assert "token is empty" in result.output

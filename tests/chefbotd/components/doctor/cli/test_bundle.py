"""The support bundle: what is in it, and what never is."""

import json
import stat
import tarfile
from pathlib import Path

import pytest

from chefbotd.cli.common.exits import Exit, ProgramError
from chefbotd.components.doctor.cli.bundle import (
    REMOVED,
    Redactor,
    contents,
    fault_lines,
    secrets_in,
    versions,
    without_secrets,
    write_bundle,
)
from chefbotd.settings import load

TOKEN = "f3b1c5d7e9a2468bdf02468ace13579b"
OTHER = "0123456789abcdef0123456789abcdef"


def bundled(tmp_path: Path, log: str) -> dict[str, bytes]:
    """Every file of a bundle whose log, stats and state are full of secrets."""
    tokens = tmp_path / "tokens"
    tokens.write_text(f"# who\nadmin {TOKEN}\nobserve {OTHER}\n")
    files = contents(
        {"verdict": "ok", "findings": [{"measured": f"with {TOKEN}"}]},
        load().model_dump(mode="json", by_alias=True),
        {"note": TOKEN},
        {"note": OTHER},
        log,
    )
    path = tmp_path / "robot.tar.gz"
    write_bundle(path, files, Redactor([TOKEN, *secrets_in(tokens, None, tmp_path / "none")]))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with tarfile.open(path) as archive:
        return {entry.name: archive.extractfile(entry).read() for entry in archive}  # type: ignore[union-attr]


def test_no_token_is_in_any_byte_of_it(tmp_path: Path):
    """Tokens in the log, the findings, the figures: none is left, while the rest of the log is."""
    log = (
        f"12:00 client authenticated with {TOKEN}\n"
        f'12:01 {{"method":"authenticate","params":{{"token":"{OTHER}"}}}}\n'
        "12:02 lines around a fault fault=overspeed\n"
        "12:03 WebSocket subprotocol token.AbCdEfGhIjKlMnOp\n"
        "12:04 connecting to mqtt://ann:sesame@host\n"
        "12:05 password=open-up-now please\n"
    )
    members = bundled(tmp_path, log)
    everything = b"".join(members.values())
    for secret in (TOKEN, OTHER, "AbCdEfGhIjKlMnOp", "sesame", "open-up-now"):
        assert secret.encode() not in everything
    assert everything.count(REMOVED.encode()) >= 8
    assert b"12:02 lines around a fault fault=overspeed" in members["robot/log.txt"]
    assert members["robot/faults.txt"] == b"12:02 lines around a fault fault=overspeed\n"


def test_what_is_in_it(tmp_path: Path):
    """Findings, versions, configuration, figures, log: each where its name says, the JSON whole."""
    members = bundled(tmp_path, "")
    assert set(members) == {
        f"robot/{name}"
        for name in (
            "findings.json",
            "versions.txt",
            "configuration.json",
            "stats.json",
            "state.json",
            "log.txt",
            "faults.txt",
        )
    }
    assert json.loads(members["robot/configuration.json"])["robot"]["name"] == "chefbot"
    assert b"pyserial" in members["robot/versions.txt"]


def test_configuration_without_secrets():
    """A key that is a secret itself is taken out, a path to one stays."""
    values = {
        "api": {"token": "abc", "token_file": "/etc/tokens"},
        "mqtt": [{"password": "x", "user": "ann"}],
    }
    assert without_secrets(values) == {
        "api": {"token": REMOVED, "token_file": "/etc/tokens"},
        "mqtt": [{"password": REMOVED, "user": "ann"}],
    }


def test_a_private_key_in_a_log():
    """Its whole block goes, over many lines."""
    key = "-----BEGIN EC PRIVATE KEY-----\nMHcCAQ\nEEIA\n-----END EC PRIVATE KEY-----"
    assert Redactor([]).clean(f"a\n{key}\nb") == f"a\n{REMOVED}\nb"


def test_short_words_are_no_secrets():
    """A token file with a short word must not blank every letter of the log."""
    assert Redactor(["a", "drive"]).clean("a drive") == "a drive"


def test_a_bundle_that_is_there_already_stays(tmp_path: Path):
    """Nothing is overwritten."""
    path = tmp_path / "robot.tar.gz"
    path.write_bytes(b"mine")
    with pytest.raises(ProgramError, match="not overwritten") as failure:
        write_bundle(path, {}, Redactor([]))
    assert failure.value.code is Exit.FAILED
    assert path.read_bytes() == b"mine"


def test_a_recording_goes_in_as_it_is(tmp_path: Path):
    """Byte for byte, under its own name."""
    recording = tmp_path / "doctor_1.mcap"
    recording.write_bytes(b"\x89MCAP\r\n\x00\xff")
    path = tmp_path / "robot.tar.gz"
    write_bundle(path, {"log.txt": "well"}, Redactor([]), [recording])
    with tarfile.open(path) as archive:
        member = archive.extractfile("robot/doctor_1.mcap")
        assert member is not None
        assert member.read() == b"\x89MCAP\r\n\x00\xff"


def test_versions_and_fault_lines():
    """The program's own version is the first, and lines without a fault are none."""
    assert versions().startswith("chefbotd ")
    assert (
        fault_lines("started\nsafety mode changed mode=disarmed\n") == "safety mode changed mode=disarmed\n"
    )

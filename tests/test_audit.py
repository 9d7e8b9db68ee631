"""The audit of dependencies, with the real pip-audit and a vulnerability service of our own."""

import json
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.audit import DEVELOPERS, KNOWN_BAD, closure, main

pytestmark = pytest.mark.slow

pytest.importorskip("pip_audit", reason="pip-audit comes with the extra 'dev'")

Known = Mapping[str, str]
"""A vulnerability by the package that has it, in any version."""

CANARY = {next(iter(KNOWN_BAD)): "CVE-2019-10906"}


def _entry(name: str, vulnerability: str) -> dict[str, Any]:
    ranges = [{"type": "ECOSYSTEM", "events": [{"introduced": "0"}, {"fixed": "999"}]}]
    return {
        "id": vulnerability,
        "affected": [{"package": {"name": name, "ecosystem": "PyPI"}, "ranges": ranges}],
    }


@contextmanager
def service(known: Known, failing: frozenset[str] = frozenset()) -> Iterator[str]:
    """Speaks as OSV does, on loopback, and answers with an error for ``failing``; yields its address."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            name = json.loads(self.rfile.read(int(self.headers["Content-Length"])))["package"]["name"]
            vulnerabilities = {"vulns": [_entry(name, known[name])]} if name in known else {}
            body = json.dumps(vulnerabilities).encode()
            self.send_response(500 if name in failing else 200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *arguments: object) -> None:
            """Nobody reads it."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/v1/query"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def audit(address: str, *options: str) -> int:
    """Its exit code, when this service is asked."""
    return main(["--vulnerability-service", "osv", "--osv-url", address, *options])


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Callable[[], str]:
    """What was printed since it was last asked for."""
    return lambda: capsys.readouterr().out


def test_nothing_known_is_a_pass(printed: Callable[[], str]) -> None:
    """A service that knows the old hole, and none of ours."""
    with service(CANARY) as address:
        assert audit(address) == 0
    assert printed() == f"{len(closure())} packages looked up, 0 findings\n"


def test_a_vulnerable_dependency_fails_and_is_named(printed: Callable[[], str]) -> None:
    """With its version, the vulnerability, and what mends it."""
    with service({**CANARY, "numpy": "CVE-2030-1"}) as address:
        assert audit(address) == 1
    assert f"numpy {metadata.version('numpy')}: CVE-2030-1, fixed in 999\n" in printed()


def test_a_dependency_that_cannot_be_looked_up_fails(printed: Callable[[], str]) -> None:
    """What answers for one release must answer for all: half an audit is none."""
    with service(CANARY, failing=frozenset({"numpy"})) as address:
        assert audit(address) == 1
    assert "numpy" in printed()


@pytest.mark.parametrize("required", [False, True])
def test_a_service_that_knows_no_vulnerabilities_clears_nobody(
    printed: Callable[[], str], required: bool
) -> None:
    """It answers, and has never heard of the old hole: skipped, or a failure where the audit is required."""
    with service({}) as address:
        assert audit(address, *(["--required"] * required)) == int(required)
    assert printed().startswith("skipped: nobody can be asked")


def test_a_service_that_is_not_there_is_told(printed: Callable[[], str]) -> None:
    """Without a network: skipped, with the reason."""
    with service({}) as address:
        pass
    assert audit(address) == 0
    assert "ConnectionError" in printed()


def test_a_wrong_option_is_no_reason_to_skip() -> None:
    """What pip-audit refuses is our mistake."""
    with pytest.raises(ValueError, match="unrecognized arguments: --bogus"):
        main(["--bogus"])


def test_all_that_users_install_is_looked_up() -> None:
    """Dependencies of dependencies too, extras' among them (textual asks for markdown-it-py[linkify])."""
    assert {"numpy", "pydantic-core", "textual-plot", "linkify-it-py", "pysdl2-dll"} <= closure().keys()
    assert not {"pip-audit", "chefbotd", "colorama"} & closure().keys()


def test_every_extra_is_looked_up() -> None:
    """What ``pyproject.toml`` offers, but for what only developers install; also what is not installed here."""
    with Path("pyproject.toml").open("rb") as file:
        offered = tomllib.load(file)["project"]["optional-dependencies"]
    wanted = {
        canonicalize_name(Requirement(each).name)
        for extra, needs in offered.items()
        if extra not in DEVELOPERS
        for each in needs
    }
    assert {"zeroconf", "mcap", "openni", "foxglove-sdk", "matplotlib"} <= wanted
    assert wanted <= closure().keys()
    assert Version(closure(extras=("depth",))["openni"]) == Version(
        "2.3"
    )  # the oldest that is allowed, where none is installed

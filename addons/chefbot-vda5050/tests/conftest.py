"""Both versions: a test that asks for ``version`` runs in each, and its messages are of that version."""

import pytest
from vda5050_orders import HEADER


@pytest.fixture(params=["2.1.0", "3.0.0"])
def version(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """What everybody speaks in this test."""
    monkeypatch.setitem(HEADER, "version", request.param)
    return str(request.param)

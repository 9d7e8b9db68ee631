"""The golden conversations are what the core says; whoever models the firmware is held to the same files."""

import pytest

from tests.firmware import conversations, tools


@pytest.mark.parametrize("name", conversations.CONVERSATIONS)
def test_the_core_holds_each_golden_conversation(name: str) -> None:
    """Byte for byte, at each time; `python -m tests.firmware.conversations` writes them anew after a change."""
    tools.need("gcc", "make")
    golden = (conversations.FOLDER / f"{name}.jsonl").read_text(encoding="utf-8")
    assert conversations.text(name).splitlines() == golden.splitlines()


def test_there_is_no_golden_conversation_besides() -> None:
    """Each file is held."""
    assert {path.stem for path in conversations.FOLDER.iterdir()} == set(conversations.CONVERSATIONS)

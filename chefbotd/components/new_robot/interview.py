"""Asks until an answer can be used: a number in its range, yes or no, one of a few words."""

import re
from collections.abc import Callable, Sequence

from chefbotd.components.doctor.cli.diagnosis import YES, Asker

SKIP = "skip"
_NUMBER = re.compile(r"([+-]?[0-9]*[.,]?[0-9]+)\s*([a-zA-Z]*)")


class NobodyAnswersError(Exception):
    """The input has ended."""


class Interview:
    """Questions to one person; ``say`` shows what is no question."""

    def __init__(self, asker: Asker, say: Callable[[str], None]) -> None:
        self._asker, self.say = asker, say

    async def text(self, question: str, default: str = "") -> str:
        """What was typed; the default where Enter was pressed.

        Raises:
            NobodyAnswersError: the input has ended.
        """
        shown = f" [Enter: {default}]" if default else ""
        answer = await self._asker.ask(f"{question}{shown}")
        if answer is None:
            raise NobodyAnswersError
        return answer or default

    async def number(
        self, question: str, unit: str, lowest: float, highest: float, default: float | None = None
    ) -> float | None:
        """A number in this range; None where Enter was pressed and there is no default, or ``skip`` was typed."""
        shown = "Enter: skip" if default is None else f"Enter: {default:g}"
        while True:
            answer = await self.text(f"{question} ({unit}) [{shown}]")
            if not answer:
                return default
            if answer.lower() == SKIP:
                return None
            match = _NUMBER.fullmatch(answer)
            value = None if match is None else float(match[1].replace(",", "."))
            if match is not None and match[2] not in ("", unit):
                self.say(f"{answer!r} is in {match[2]}: type it in {unit}.")
            elif value is None or not lowest <= value <= highest:
                self.say(
                    f"{answer!r} cannot be used: a number from {lowest:g} to {highest:g} {unit} is expected."
                )
            else:
                return value

    async def choice(self, question: str, words: Sequence[str], default: str = "") -> str:
        """One of these words."""
        while True:
            answer = (await self.text(f"{question} ({', '.join(words)})", default)).lower()
            if answer in words:
                return answer
            self.say(f"{answer!r} is none of them: {', '.join(words)}.")

    async def agrees(self, question: str, *, default: bool) -> bool:
        """Yes or no, or y or n."""
        answer = await self.choice(question, ("yes", "no", "y", "n"), "yes" if default else "no")
        return answer.startswith("y")

    async def typed_yes(self, question: str) -> bool:
        """Whether the whole word yes was typed: what moves the robot asks so."""
        return await self.text(f"{question} Type {YES} to begin, or press Enter to skip it.") == YES

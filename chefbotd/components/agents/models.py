"""Agents: what they and others ask, what is answered, and their topics."""

from typing import Annotated, Any, Final

from msgspec import Meta, json
from pydantic import AfterValidator, Field

from chefbotd.components.agents.events import (
    AgentEventData,
    AgentMessageData,
    AgentNotified,
    AgentPublished,
    AgentSaid,
    AgentsChanged,
    AgentsData,
)
from chefbotd.core.record import Record
from chefbotd.rpc.models import Params
from chefbotd.rpc.topics import Topic, same_names

MOST_DATA_BYTES: Final = 2048
LINE: Final = r"^[^\x00-\x1f\x7f-\x9f]+$"
"""Text on one line, in letters that can be printed."""


def _small(data: dict[str, Any]) -> dict[str, Any]:
    if (size := len(json.encode(data))) > MOST_DATA_BYTES:
        raise ValueError(f"expected at most {MOST_DATA_BYTES} bytes as JSON, {size} are too many")
    return data


def _different(choices: list[str]) -> list[str]:
    if len(set(choices)) < len(choices):
        raise ValueError("expected each choice once")
    return choices


Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[\w][\w .-]*$")]
Label = Annotated[str, Field(min_length=1, max_length=40, pattern=LINE)]
Text = Annotated[str, Field(min_length=1, max_length=200, pattern=LINE)]
Data = Annotated[dict[str, Any], AfterValidator(_small)]


class RegisterAgentParams(Params):
    """What an agent calls itself, and the methods that others may call of it."""

    name: Name
    version: str = Field(max_length=32, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")
    methods: list[Name] = Field([], max_length=16)


class SayParams(Params):
    """A sentence for people."""

    text: Text


class AskParams(Params):
    """A question for people, its possible answers, and how long to wait for one of them."""

    question: Text
    choices: Annotated[list[Label], AfterValidator(_different)] = Field(min_length=1, max_length=8)
    timeout_s: float = Field(60.0, ge=0.1, le=3600.0)


class AnswerAgentParams(Params):
    """A question, and one of its choices."""

    question_id: int = Field(ge=1)
    choice: str = Field(min_length=1, max_length=40)


class AddButtonParams(Params):
    """What is written on the button."""

    label: Label


class ButtonParams(Params):
    """A button."""

    button_id: int = Field(ge=1)


class CallAgentParams(Params):
    """An agent's method with its parameters, and how long to wait for the answer."""

    agent: Name
    method: Name
    params: Data = {}
    timeout_s: float = Field(5.0, ge=0.1, le=60.0)


class AnswerCallParams(Params):
    """The answer to a call: its result, or in ``error`` a sentence about why there is none."""

    call_id: int = Field(ge=1)
    result: Data = {}
    error: str | None = Field(None, min_length=1, max_length=200, pattern=LINE)


class PublishToTopicParams(Params):
    """A topic of the agent's own, and what is published on it."""

    topic: Name
    data: Data


class AskResult(Record, frozen=True):
    """What was chosen, and by whom; ``choice`` is null where nobody answered in time."""

    choice: str | None
    by: str = ""
    stop_number: Annotated[int, Meta(description="that of the topic safety when it was chosen")] = 0


class ButtonAdded(Record, frozen=True):
    """The number of the new button."""

    button_id: int


class CallResult(Record, frozen=True):
    """What the agent answered."""

    result: Annotated[dict[str, Any], Meta(description="as the agent has it")] = {}


def _latest(before: AgentsChanged | None, event: AgentsChanged | AgentSaid) -> AgentsChanged | None:
    """What was said is in the next ``AgentsChanged`` too; by itself it is for the log."""
    return event if isinstance(event, AgentsChanged) else before


TOPICS = (
    Topic(
        "agents",
        (AgentsChanged, AgentSaid),
        AgentsData,
        same_names(AgentsData),
        join=_latest,
        always_known=True,
        for_guests=True,
    ),
    Topic(
        "agent_events",
        (AgentNotified,),
        AgentEventData,
        same_names(AgentEventData),
        passing=True,
        for_guests=True,
    ),
    Topic(
        "agent_data",
        (AgentPublished,),
        AgentMessageData,
        same_names(AgentMessageData),
        passing=True,
        for_guests=True,
    ),
)

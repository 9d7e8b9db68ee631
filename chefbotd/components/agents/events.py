"""Events of agents: programs on the socket that talk to people and to each other."""

from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta

from chefbotd.core.record import Level, LogLine, Record


class AgentData(Record, frozen=True):
    """An agent: what it calls itself, the methods that it offers, and what it said last."""

    name: str
    version: str
    methods: tuple[str, ...] = ()
    text: str = ""


class ButtonData(Record, frozen=True):
    """A button of an agent."""

    button_id: int
    agent: str
    label: str


class QuestionData(Record, frozen=True):
    """A question of an agent, and the answers of which one can be chosen."""

    question_id: int
    agent: str
    question: str
    choices: tuple[str, ...]


class AgentsData(Record, frozen=True):
    """The agents that are connected, their buttons, and their questions that wait for an answer."""

    agents: tuple[AgentData, ...] = ()
    buttons: tuple[ButtonData, ...] = ()
    questions: tuple[QuestionData, ...] = ()


class AgentsChanged(AgentsData, frozen=True, kw_only=True):
    """An agent came, left or said something, or its buttons or questions are others."""

    retained: ClassVar[bool] = True

    stamp_s: float


class AgentSaid(Record, frozen=True):
    """An agent has said something to people."""

    stamp_s: float
    agent: str
    text: str

    def log_line(self) -> LogLine:
        """The line in the log."""
        return LogLine(Level.INFO, self.agent, self.text)


class AgentEventData(Record, frozen=True):
    """What happened for an agent: a button of it was pressed, or a method of it was called."""

    agent: str
    event: Literal["pressed", "called"]
    by: Annotated[str, Meta(description="the client that did it")]
    button_id: int | None = None
    label: str | None = None
    call_id: Annotated[int | None, Meta(description="to be answered with answer_call")] = None
    method: str | None = None
    params: dict[str, Any] = {}
    stop_number: Annotated[
        int, Meta(description="that of the topic safety when it happened, for if_stop_number")
    ] = 0


class AgentNotified(AgentEventData, frozen=True, kw_only=True):
    """An agent is told of this."""

    stamp_s: float


class AgentMessageData(Record, frozen=True):
    """What an agent published on a topic of its own."""

    agent: str
    topic: str
    data: dict[str, Any]


class AgentPublished(AgentMessageData, frozen=True, kw_only=True):
    """An agent has published this."""

    stamp_s: float

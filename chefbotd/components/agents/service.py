"""The agents in the daemon: programs on the socket that talk to people and to each other.

An agent is its connection: when that ends, all that it has vanishes. Whatever changes does so where a request, a timer
or the end of a connection is handled; a request that waits only waits.
"""

from typing import Any, Literal

from chefbotd.bus import Bus
from chefbotd.clock import Clock
from chefbotd.components.agents.events import (
    AgentData,
    AgentNotified,
    AgentPublished,
    AgentSaid,
    AgentsChanged,
    ButtonData,
    QuestionData,
)
from chefbotd.components.agents.models import (
    TOPICS,
    AddButtonParams,
    AnswerAgentParams,
    AnswerCallParams,
    AskParams,
    AskResult,
    ButtonAdded,
    ButtonParams,
    CallAgentParams,
    CallResult,
    PublishToTopicParams,
    RegisterAgentParams,
    SayParams,
)
from chefbotd.components.agents.pending import PendingRequests, PendingState
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events import ClientDisconnected, SafetyChanged
from chefbotd.core.record import MutableState, Record, StatefulPart, replace
from chefbotd.core.sentence import Sentence
from chefbotd.features.feature import Feature
from chefbotd.inputs import ResumableTimer, inputs_of
from chefbotd.rpc.jobs import ProgressReporter
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Caller, Unserved, method, methods_of
from chefbotd.rpc.models import DONE, Done
from chefbotd.rpc.parameters import Role
from chefbotd.rpc.session import Session

MOST_AGENTS, MOST_BUTTONS, MOST_QUESTIONS, MOST_CALLS = 16, 32, 4, 16
"""The last three of each agent."""

SAY_PER_S, MOST_SAID = 2.0, 10.0
"""How often an agent may speak: a token bucket."""

TELL_PER_S, MOST_TOLD = 10.0, 50.0
"""How often the topic ``agents`` is published: a token bucket. What changes more often is told by the next one: each
holds everything of all agents, and a program can ask for two thousand changes a second."""

TIMER = "agents"
EARLY = 0.02
"""A timer may fire 2 ms too early: so much of a token."""


class RegisteredAgent(Record, frozen=True):
    """An agent, the number of its client, and how often it might still speak at ``stamp_s``."""

    data: AgentData
    client: int
    may_say: float
    stamp_s: float


class AgentsState(MutableState):
    """The agents, their buttons, what waits for an answer, and the last number that was given."""

    waits: PendingState
    agents: list[RegisteredAgent] = []
    buttons: list[ButtonData] = []
    last_number: int = 0
    stop_number: int = 0
    may_tell: float = MOST_TOLD
    told_s: float = 0.0
    due_s: float | None = None


class AgentsService(StatefulPart[AgentsState]):
    """Buttons, questions and calls are numbered together."""

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._bus, self._entries = bus, inputs_of(clock)
        self.waits = PendingRequests(self._entries, self._publish_state)
        self._timer = ResumableTimer(self._entries, self._publish_state, TIMER)
        self.memory = AgentsState(self.waits.memory)
        self.parts = {"waits": self.waits, "due_s": self._timer}
        bus.add_handler(self._take_client_left, ClientDisconnected)
        bus.add_handler(self._note_stop_number, SafetyChanged)

    # what an agent asks

    @method(role=Role.AGENT, moves=False)
    def register_agent(self, caller: Caller, params: RegisterAgentParams) -> Done:
        """Be an agent of this name, which no other may have, until the connection ends."""
        client, own = caller.session.number, self._agent_of(caller.session.number)
        if own is not None and own.data.name != params.name:
            why = Sentence(
                "agents.is_agent", "this connection is the agent {name!a} already", name=own.data.name
            )
            raise Refused(RefusalKind.AGENT_EXISTS, why)
        if own is None and any(agent.data.name == params.name for agent in self.memory.agents):
            raise Refused(
                RefusalKind.AGENT_EXISTS,
                Sentence("agents.name_used", "another agent is called {name!a} already", name=params.name),
            )
        _require_room("agents", len(self.memory.agents) - (own is not None), MOST_AGENTS)
        data = AgentData(params.name, params.version, tuple(params.methods))
        self._keep_agent(RegisteredAgent(data, client, MOST_SAID, self._entries.now_s()))
        self._publish_state()
        return DONE

    @method(role=Role.AGENT, moves=False)
    def say(self, caller: Caller, params: SayParams) -> Done:
        """Say a sentence to people: on the page and in the log. At most 10 at once, and 2 a second."""
        agent, now_s = self._agent(caller.session), self._entries.now_s()
        may_say = min(MOST_SAID, agent.may_say + (now_s - agent.stamp_s) * SAY_PER_S)
        if may_say < 1.0:
            raise Unserved(
                ErrorKind.RATE_LIMITED,
                Sentence("agents.too_often", "the agent {agent!a} speaks too often", agent=agent.data.name),
            )
        data = replace(agent.data, text=params.text)
        self._keep_agent(RegisteredAgent(data, agent.client, may_say - 1.0, now_s))
        self._publish_state()
        self._bus.publish(AgentSaid(now_s, data.name, params.text))
        return DONE

    @method(role=Role.AGENT, moves=False)
    async def ask(self, caller: Caller, params: AskParams, progress: ProgressReporter) -> AskResult:
        """Ask people a question; the answer is what one of them chose, or that nobody did in time."""
        name = self._agent(caller.session).data.name
        _require_room("questions of an agent", len(self.waits.of(name, questions=True)), MOST_QUESTIONS)
        number = self._next_number()
        question = QuestionData(number, name, params.question, tuple(params.choices))
        self.waits.add(number, name, params.timeout_s, question)
        self._publish_state()
        answer: AskResult = await self.waits.wait(number, progress)
        return answer

    @method(role=Role.AGENT, moves=False)
    def add_button(self, caller: Caller, params: AddButtonParams) -> ButtonAdded:
        """Offer people a button; each press of it comes on the topic agent_events."""
        name = self._agent(caller.session).data.name
        own = [button for button in self.memory.buttons if button.agent == name]
        _require_room("buttons of an agent", len(own), MOST_BUTTONS)
        number = self._next_number()
        self.memory.buttons.append(ButtonData(number, name, params.label))
        self._publish_state()
        return ButtonAdded(number)

    @method(role=Role.AGENT, moves=False)
    def remove_button(self, caller: Caller, params: ButtonParams) -> Done:
        """Take back a button of this agent."""
        button = self._button(params.button_id)
        if button.agent != self._agent(caller.session).data.name:
            why = Sentence(
                "agents.foreign_button",
                "the button {label!a} belongs to the agent {agent!a}",
                label=button.label,
                agent=button.agent,
            )
            raise Refused(RefusalKind.UNKNOWN_BUTTON, why)
        self.memory.buttons.remove(button)
        self._publish_state()
        return DONE

    @method(role=Role.AGENT, moves=False)
    def publish_to_topic(self, caller: Caller, params: PublishToTopicParams) -> Done:
        """Publish data on a topic of this agent; they come on the topic agent_data."""
        name, now_s = self._agent(caller.session).data.name, self._entries.now_s()
        self._bus.publish(AgentPublished(name, params.topic, params.data, stamp_s=now_s))
        return DONE

    @method(role=Role.AGENT, moves=False)
    def answer_call(self, caller: Caller, params: AnswerCallParams) -> Done:
        """Answer a call of a method of this agent, which came on the topic agent_events."""
        name, call = self._agent(caller.session).data.name, self.waits.get(params.call_id)
        if call is None or call.question is not None or call.agent != name:
            why = Sentence(
                "agents.no_call",
                "no call {call} of the agent {agent!a} waits for an answer",
                call=params.call_id,
                agent=name,
            )
            raise Refused(RefusalKind.UNKNOWN_CALL, why)
        refused = None if params.error is None else Refused(RefusalKind.AGENT_FAILED, params.error)
        self.waits.end(call.number, refused or CallResult(params.result))
        return DONE

    # what others ask

    @method(role=Role.GUEST, moves=False)
    def press_button(self, caller: Caller, params: ButtonParams) -> Done:
        """Press a button; its agent is told."""
        button = self._button(params.button_id)
        self._notify(button.agent, "pressed", caller.session, button_id=button.button_id, label=button.label)
        return DONE

    @method(role=Role.GUEST, moves=False)
    def answer_agent(self, caller: Caller, params: AnswerAgentParams) -> Done:
        """Choose one of the answers to a question; the first answer counts."""
        pending = self.waits.get(params.question_id)
        if pending is None or pending.question is None:
            why = Sentence(
                "agents.no_question",
                "no question {question} waits for an answer",
                question=params.question_id,
            )
            raise Refused(RefusalKind.UNKNOWN_QUESTION, why)
        choices = pending.question.choices
        if params.choice not in choices:
            why = Sentence(
                "agents.no_choice",
                "{choice!a} is none of the choices: {choices}",
                choice=params.choice,
                choices=", ".join(choices),
            )
            raise Refused(RefusalKind.OUT_OF_RANGE, why)
        self.waits.end(pending.number, AskResult(params.choice, str(caller.session), self.memory.stop_number))
        return DONE

    @method(role=Role.AGENT, moves=False)
    async def call_agent(
        self, caller: Caller, params: CallAgentParams, progress: ProgressReporter
    ) -> CallResult:
        """Call a method that an agent offers, and wait for its answer."""
        by_name = {other.data.name: other.data for other in self.memory.agents}
        agent = by_name.get(params.agent)
        if agent is None:
            names = ", ".join(by_name) or "none"
            why = Sentence(
                "agents.unknown",
                "no agent is called {agent!a}; there are: {names}",
                agent=params.agent,
                names=names,
            )
            raise Refused(RefusalKind.UNKNOWN_AGENT, why)
        if params.method not in agent.methods:
            offered = ", ".join(agent.methods) or "nothing"
            why = Sentence(
                "agents.not_offered",
                "the agent {agent!a} does not offer {method!a}; it offers: {offered}",
                agent=agent.name,
                method=params.method,
                offered=offered,
            )
            raise Refused(RefusalKind.UNKNOWN_AGENT, why)
        _require_room("calls of an agent", len(self.waits.of(agent.name, questions=False)), MOST_CALLS)
        number = self._next_number()
        self.waits.add(number, agent.name, params.timeout_s, None, params.method)
        details = {"call_id": number, "method": params.method, "params": params.params}
        self._notify(agent.name, "called", caller.session, **details)
        result: CallResult = await self.waits.wait(number, progress)
        return result

    # inside

    def _next_number(self) -> int:
        self.memory.last_number += 1
        return self.memory.last_number

    def _agent_of(self, client: int) -> RegisteredAgent | None:
        return next((agent for agent in self.memory.agents if agent.client == client), None)

    def _keep_agent(self, agent: RegisteredAgent) -> None:
        agents = {other.client: other for other in self.memory.agents}
        self.memory.agents = list((agents | {agent.client: agent}).values())

    def _agent(self, session: Session) -> RegisteredAgent:
        agent = self._agent_of(session.number)
        if agent is None:
            raise Refused(
                RefusalKind.NOT_AN_AGENT,
                Sentence("agents.no_agent", "this connection is no agent; it has to register first"),
            )
        return agent

    def _button(self, number: int) -> ButtonData:
        button = next((button for button in self.memory.buttons if button.button_id == number), None)
        if button is None:
            raise Refused(
                RefusalKind.UNKNOWN_BUTTON,
                Sentence("agents.no_button", "there is no button {number}", number=number),
            )
        return button

    def _notify(self, agent: str, event: Literal["pressed", "called"], by: Session, **details: Any) -> None:
        now_s = self._entries.now_s()
        details["stop_number"] = (
            self.memory.stop_number
        )  # what is decided now is decided before the next stop
        self._bus.publish(AgentNotified(agent, event, str(by), **details, stamp_s=now_s))

    def _publish_state(self) -> None:
        """Tell how things stand, now or as soon as the rate allows it."""
        if self._timer.due_s is not None:
            return
        now_s = self._entries.now_s()
        level = min(MOST_TOLD, self.memory.may_tell + (now_s - self.memory.told_s) * TELL_PER_S)
        if level < 1.0 - EARLY:
            self._timer.start((1.0 - level) / TELL_PER_S)
            return
        self.memory.may_tell, self.memory.told_s = max(0.0, level - 1.0), now_s
        agents = tuple(agent.data for agent in self.memory.agents)
        buttons = tuple(self.memory.buttons)
        self._bus.publish(AgentsChanged(agents, buttons, self.waits.questions(), stamp_s=now_s))

    def _note_stop_number(self, event: SafetyChanged) -> None:
        self.memory.stop_number = event.stop_number

    def _take_client_left(self, event: ClientDisconnected) -> None:
        """Everything of an agent vanishes with its connection."""
        agent = self._agent_of(event.client)
        if agent is None:
            return
        name = agent.data.name
        self.memory.agents.remove(agent)
        self.memory.buttons = [button for button in self.memory.buttons if button.agent != name]
        left = Refused(
            RefusalKind.AGENT_LEFT,
            Sentence("agents.left", "the agent {agent!a} has left before it answered", agent=name),
        )
        for pending in (*self.waits.of(name, questions=True), *self.waits.of(name, questions=False)):
            self.waits.end(pending.number, left)
        self._publish_state()


def _require_room(what: str, count: int, most: int) -> None:
    if count >= most:
        raise Refused(
            RefusalKind.OUT_OF_RANGE,
            Sentence(
                "agents.full",
                "at most {most} {what} are allowed, and there are {count}",
                most=most,
                what=what,
                count=count,
            ),
        )


def agents(bus: Bus, clock: Clock) -> Feature:
    """Programs on the socket that talk to people and to each other."""
    service = AgentsService(bus, clock)
    return Feature(
        "agents",
        methods=methods_of(service),
        topics=TOPICS,
        parts={"agents": service},
        waiting=service.waits.waiting,
    )

"""How long an agent's question takes to another client and its answer back, over the socket's own round trip.

The question and its answer pass the daemon twice, so twice the round trip of ``ping`` is what cannot be avoided.
"""

import json
import statistics
import threading
import time

from benchmarks.board import board
from benchmarks.figures import Figure, Outcome, latencies
from benchmarks.rig import connect, daemon
from benchmarks.rpc import Caller, CallFailed

QUESTIONS = 1000
NOT_COUNTED = 50
"""The first questions, for which the daemon still loads modules."""

SUBSCRIBED_WITHIN_S = 10.0


class Guest(Caller):
    """Answers each question at once, with its first choice, from when it is ``subscribed`` on."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self.subscribed = threading.Event()

    def answer_all(self) -> None:
        """Until the daemon hangs up."""
        self.call("subscribe", topics=["agents"])
        self.subscribed.set()
        try:
            while True:
                message = json.loads(self._line())
                for question in message.get("params", {}).get("data", {}).get("questions", ()):
                    chosen = {"question_id": question["question_id"], "choice": question["choices"][0]}
                    request = {"jsonrpc": "2.0", "method": "answer_agent", "params": chosen}
                    self._send(json.dumps(request).encode())
        except (CallFailed, OSError):
            return


def run(*, quick: bool = False) -> Outcome:
    """The medians of a question and of a ``ping``, by turns, and their ratio."""
    count = QUESTIONS // 5 if quick else QUESTIONS
    asked_s, pinged_s = [], []
    with board() as instrument, daemon(instrument.device) as running, connect(running) as agent:
        instrument.start(0.02)
        guest = Guest(running.port)
        answering = threading.Thread(target=guest.answer_all, daemon=True)
        answering.start()
        agent.call("register_agent", name="bench", version="1")
        if not guest.subscribed.wait(SUBSCRIBED_WITHIN_S):
            raise CallFailed("the guest's subscription was not answered")
        for _ in range(NOT_COUNTED + count):
            asked_s.append(_timed(agent, "ask", question="Well?", choices=["yes", "no"], timeout_s=5.0))
            pinged_s.append(_timed(agent, "ping"))
    asked_s, pinged_s = asked_s[NOT_COUNTED:], pinged_s[NOT_COUNTED:]
    answering.join(5.0)
    ratio = statistics.median(asked_s) / statistics.median(pinged_s)
    return Outcome(
        (
            Figure("question and answer to round trip", ratio, "x", 2.0),
            *latencies("question and answer", asked_s, {50: None, 99: None}),
            *latencies("round trip", pinged_s, {50: None, 99: None}),
        )
    )


def _timed(agent: Caller, method: str, **params: object) -> float:
    """Seconds from the request to its answer."""
    sent_ns, _ = agent.timed_call(method, **params)
    return (time.monotonic_ns() - sent_ns) * 1e-9

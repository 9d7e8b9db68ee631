"""What the daemon refuses can be said in another language: each sentence has an id and arguments beside its words."""

import ast
import json
import pickle
import re

import msgspec

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.events.robot import SafetyChanged
from chefbotd.core.record import Record, state_line
from chefbotd.core.sentence import (
    Sentence,
    join_sentences,
    join_words,
    sentence_data,
    sentence_of,
    with_sentences,
)
from chefbotd.event_classes import encode as encode_event
from chefbotd.rpc.encoding import encode
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Unserved
from chefbotd.safety.gate import not_armed
from chefbotd.snapshot import encode_state
from tests.sentences import ROOT, modules, patterns, unnamed_reasons

NO_EVENTS = {
    "components/agents/models.py",
    "components/calibration/fit_process.py",
    "components/calibration/service.py",
    "components/invitations/access_file.py",
    "components/recording/chunk.py",
    "components/recording/foxglove.py",
    "components/recording/replay/comparison.py",
    "components/recording/replay/run.py",
    "components/worker/messages.py",
    "safety/latch.py",
}
"""What encodes what it has made itself, without a sentence."""
OF_FILES = {
    "composition/components.py: replace: reason",
    "settings/sections.py: replace: reason",
}
"""What is wrong with the configuration or a plug-in, which is said to whoever writes those."""
REFERENCE = ROOT.parent / "docs" / "reference" / "refusals.md"


def as_listed(pattern: str) -> str:
    """Without formats, and with the quotes that they make around a name."""
    quoted = re.sub(r"\{(\w+)![ra]\}", r"'{\1}'", pattern)
    return re.sub(r"\{(\w+):[^}]*\}", r"{\1}", quoted)


def test_the_reference_lists_every_sentence_of_the_code_and_no_other() -> None:
    """One page says what a translator is to translate; a sentence that is changed is changed there too."""
    rows = re.findall(r"^\| `([a-z_.]+)` \| (.+) \|$", REFERENCE.read_text(), re.MULTILINE)
    assert rows == sorted({(name, as_listed(pattern)) for name, pattern in patterns()})


def test_an_id_has_one_sentence() -> None:
    """Nowhere does the same id say something else."""
    said: dict[str, str] = {}
    for name, pattern in patterns():
        assert said.setdefault(name, pattern) == pattern, name


def test_a_sentence_is_its_english_words_with_an_id_beside_them() -> None:
    """The words are those of the pattern; the arguments are JSON's, whatever they were."""
    told = Sentence(
        "trip.far", "{place!a} is {far_m:.1f} m away: {why}", place="bar", far_m=2.06, why=OSError("no")
    )
    assert told == "'bar' is 2.1 m away: no"
    assert sentence_data(told) == {
        "id": "trip.far",
        "arguments": {"place": "bar", "far_m": 2.06, "why": "no"},
    }
    assert sentence_data("as it is") == {}


def test_a_sentence_keeps_its_id_on_its_way_between_processes() -> None:
    """Pickled, and as JSON beside its words."""
    told = Sentence("trip.far", "{place} is far away", place="bar")
    data = json.loads(json.dumps(sentence_data(told)))
    for arrived in (pickle.loads(pickle.dumps(told)), sentence_of(str(told), data)):
        assert arrived == told
        assert sentence_data(arrived) == sentence_data(told)


def test_a_refusal_says_its_id_and_its_arguments_beside_what_it_says_already() -> None:
    """As ``id`` and ``arguments``; one whose words have no id has its details alone."""
    refused = Refused(
        RefusalKind.STOPPED, Sentence("trip.held", "{who} holds it", who="Ann"), {"holder": "Ann"}
    )
    assert refused.data == {"id": "trip.held", "arguments": {"who": "Ann"}, "holder": "Ann"}
    assert str(refused) == "Ann holds it"
    assert Refused(RefusalKind.STOPPED, "no").data == {}


def test_what_the_socket_refuses_has_its_id_beside_its_details() -> None:
    """As a refusal of the robot has: who drives is in both."""
    unserved = Unserved(
        ErrorKind.LEASE_HELD, Sentence("trip.held", "{who} holds it", who="Ann"), {"holder": "Ann"}
    )
    assert unserved.data == {"id": "trip.held", "arguments": {"who": "Ann"}, "holder": "Ann"}


def test_a_sentence_may_say_why_by_another() -> None:
    """The other one is an argument with its own id, also where it comes as a refusal."""
    inner = Sentence("trip.held", "{who} holds it", who="Ann")
    nested = {"message": "Ann holds it", "id": "trip.held", "arguments": {"who": "Ann"}}
    for why in (inner, Refused(RefusalKind.STOPPED, inner)):
        told = Sentence("trip.not", "not now: {why}", why=why)
        assert told == "not now: Ann holds it"
        assert sentence_data(told)["arguments"] == {"why": nested}


def test_a_robot_that_may_not_move_says_why_by_an_id() -> None:
    """The reason is an argument, so that a page can say the rest in its language."""
    assert not_armed("estopped", "smoke").data == {"id": "driving.estopped", "arguments": {"reason": "smoke"}}
    assert str(not_armed("estopped", "smoke")) == "the emergency stop is on (smoke); arm the robot first"


class Place(Record, frozen=True):
    """A part of a topic's data."""

    name: str
    note: str = ""


class Trip(Record, frozen=True):
    """A topic's data with two texts that may be sentences, and more of them within."""

    reason: str
    far_m: float
    places: tuple[Place, ...] = ()
    words: tuple[str, ...] = ()


FAR = Sentence("trip.far", "{place} is far away", place="bar")
FAR_SAID = {"id": "trip.far", "arguments": {"place": "bar"}}


def test_what_is_sent_of_a_sentence_is_its_words_and_beside_them_its_id() -> None:
    """In the member ``said`` of the object that has the text; a text without an id is sent as it always was."""
    trip = Trip(FAR, float("nan"), (Place("bar", FAR), Place("hall")), (FAR,))
    assert json.loads(encode(trip)) == {
        "reason": "bar is far away",
        "far_m": None,
        "places": [
            {"name": "bar", "note": "bar is far away", "said": {"note": FAR_SAID}},
            {"name": "hall", "note": ""},
        ],
        "words": ["bar is far away"],
        "said": {"reason": FAR_SAID, "words": [FAR_SAID]},
    }
    assert encode(Trip("off", 1.0)) == b'{"reason":"off","far_m":1.0,"places":[],"words":[]}'


def test_a_client_of_an_earlier_version_reads_what_it_knows() -> None:
    """The text is where it always was, and is text."""
    assert msgspec.json.decode(encode(Trip(FAR, 1.0)), type=Trip) == Trip("bar is far away", 1.0)


def test_an_event_is_recorded_with_its_english_words_alone() -> None:
    """Byte by byte as it was without an id: an old recording and a new one are compared as they are."""
    assert encode_event(Trip(FAR, 1.0)) == encode_event(Trip("bar is far away", 1.0))
    assert encode_state(Trip(FAR, 1.0)) == encode_state(Trip("bar is far away", 1.0))


def test_several_words_are_joined_by_an_and_that_has_an_id() -> None:
    """One alone is as it is."""
    assert join_words(["bar"]) == "bar"
    joined = join_words(["bar", "hall", "door"])
    assert joined == "bar and hall and door"
    assert sentence_data(joined)["id"] == "driving.and"


def test_the_log_says_a_state_and_its_reason_apart() -> None:
    """Where the reason has an id; else the line is the text that it was."""
    line = state_line("trip", "waiting", FAR)
    assert line.text == "waiting: bar is far away"
    assert sentence_data(line.text)["arguments"] == {
        "state": "waiting",
        "reason": {"message": "bar is far away", **FAR_SAID},
    }
    assert sentence_data(state_line("trip", "waiting", "Ann").text) == {}


def test_each_encoder_knows_sentences() -> None:
    """Without a hook msgspec takes no class of text but its own, and an event with a reason would not be encoded."""
    without: set[str] = set()
    for path, module in modules():
        for node in ast.walk(module):
            if not (isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("Encoder", "encode")):
                continue
            called = ast.unparse(node.func)
            hooks = {keyword.arg for keyword in node.keywords}
            makes = called.endswith(("json.Encoder", "msgpack.Encoder")) and "enc_hook" not in hooks
            if makes or called.endswith(("json.encode", "msgpack.encode")):
                without.add(path.relative_to(ROOT).as_posix())
    assert without == NO_EVENTS


def mode_words(event: SafetyChanged) -> str:
    """The line of the log of a gate's event."""
    return event.log_line().text


def test_the_log_of_the_gate_keeps_the_reason_where_a_fault_and_a_limit_are_told_with_it() -> None:
    """As sentences around it."""
    event = SafetyChanged(1.0, "disarmed", FAR, None, fault="link_lost", limited_by="no_echo")
    text = mode_words(event)
    assert text == "disarmed: bar is far away (limited by no_echo) [link_lost]"
    limited = sentence_data(text)["arguments"]["text"]
    assert limited["arguments"]["text"]["arguments"]["reason"] == {"message": FAR, **FAR_SAID}


def test_each_reason_and_each_refusal_has_an_id() -> None:
    """None is put together in English alone, which would stay English within another language's sentence."""
    assert set(unnamed_reasons()) == OF_FILES


def test_of_a_list_of_sentences_each_has_its_id() -> None:
    """On the way to a client and back; what is none has null there."""
    sent = json.loads(encode(Trip("off", 1.0, words=("hall", FAR))))
    assert sent["said"] == {"words": [None, FAR_SAID]}
    hall, far = with_sentences(sent)["words"]
    assert (hall, far) == ("hall", FAR)
    assert (sentence_data(hall), sentence_data(far)) == ({}, FAR_SAID)
    assert "said" not in with_sentences(sent)


def test_sentences_are_joined_as_far_as_there_are_any() -> None:
    """Empty ones do not count, and one alone is itself."""
    assert join_sentences(("", "")) == ""
    assert join_sentences(("", FAR, "")) is FAR
    assert join_sentences((FAR, "", "off")) == "bar is far away; off"

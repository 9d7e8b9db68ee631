"""What the daemon refuses can be said in another language: each sentence has an id and arguments beside its words."""

import ast
import json
import pickle
import re
from collections.abc import Iterator
from pathlib import Path

import chefbotd
from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.sentence import Sentence, sentence_data, sentence_of
from chefbotd.rpc.jsonrpc import ErrorKind
from chefbotd.rpc.method import Unserved
from chefbotd.safety.gate import not_armed

ROOT = Path(chefbotd.__file__).parent
REFERENCE = ROOT.parent / "docs" / "reference" / "refusals.md"


def patterns() -> Iterator[tuple[str, str]]:
    """The id and the pattern of every sentence in the code."""
    for path in sorted(ROOT.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Sentence":
                yield ast.literal_eval(node.args[0]), ast.literal_eval(node.args[1])


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

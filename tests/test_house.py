"""The figures of a small package, counted by hand."""

from pathlib import Path

import pytest

from tests.house import ROOT, House, main

MOST_SMALL_FILES = 25

FILES = {
    "shop/__init__.py": '"""A shop."""\n',
    "shop/core/__init__.py": '"""What is shared."""\n\nLIMIT = 1\n',
    "shop/core/record.py": """\
from msgspec import Struct
class Record(Struct, frozen=True): ...
class Parameters(BaseModel): ...
""",
    "shop/core/models.py": """\
import pydantic
class Params(pydantic.BaseModel): ...
class Result(pydantic.BaseModel): ...
class Options(TypedDict): ...
""",
    "shop/orders.py": """\
from dataclasses import dataclass
from typing import NamedTuple, Protocol
from shop.core.models import Params, Result
from shop.core.record import Parameters, Record
from .prices import price
class Event(Record): ...
class Ordered(Event): ...
class Limits(Parameters): ...
class OrderParams(Params): ...
class Order(Result): ...
@dataclass(frozen=True)
class Line: ...
class Sum(NamedTuple): ...
class Till(Protocol): ...
class OrderError(ValueError): ...
class ClosedError(OrderError): ...
class Shop:
    def open(self):
        def inner():
            return price()
        return inner
""",
    "shop/prices.py": """\
import enum
class Event(enum.StrEnum): ...
async def price():

    return 1
""",
    "shop/stock.py": """\
def count():
    from shop.core import LIMIT, record
    number = LIMIT, record

    return number
""",
}


@pytest.fixture
def house(tmp_path: Path) -> House:
    """The package ``shop``."""
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return House(tmp_path, ("shop",))


def test_a_class_has_the_kind_of_the_base_that_it_leads_back_to(house: House) -> None:
    """Whichever file declares that base; a class of the same name elsewhere makes no difference."""
    assert house.kinds() == {
        "msgspec records and messages": 3,  # Record, Event and Ordered of orders.py
        "pydantic parameters": 2,  # Limits, and the base class itself
        "pydantic socket parameters": 2,  # OrderParams, and the base class itself
        "other pydantic models": 2,  # Result and Order
        "keyword arguments": 1,  # Options
        "dataclass": 1,
        "NamedTuple": 1,
        "Protocol": 1,
        "exception": 2,
        "enum": 1,  # Event of prices.py
        "plain": 1,
    }


def test_values_of_the_wires_package_are_a_kind_of_their_own(tmp_path: Path) -> None:
    """It may import the standard library only, so its dataclasses and tuples cannot be records."""
    (tmp_path / "firmware_protocol").mkdir()
    text = "@dataclass\nclass Reset: ...\nclass State(NamedTuple): ...\nclass Reason(StrEnum): ...\n"
    (tmp_path / "firmware_protocol" / "messages.py").write_text(text, encoding="utf-8")
    assert House(tmp_path, ("firmware_protocol",)).kinds() == {"values of the wire's package": 2, "enum": 1}


def test_names_that_are_declared_twice_are_counted(house: House) -> None:
    """Two modules have an ``Event``."""
    assert house.names_declared_more_than_once() == {"Event": 2}


def test_every_importer_of_a_module_is_known(house: House) -> None:
    """Relative imports, a module that is imported from its package, and an import inside a function count."""
    importers = house.importers()
    assert importers["shop.prices"] == {"shop.orders"}
    assert importers["shop.core.record"] == {"shop.orders", "shop.stock"}
    assert importers["shop.core"] == {"shop.stock"}
    assert importers["shop.orders"] == set()


def test_a_small_file_of_one_is_no_package_and_has_one_importer(house: House) -> None:
    """``core/__init__.py`` has one importer, too, and ``record.py`` has two."""
    assert house.small_files_of_one() == {
        "shop.prices": "shop.orders",
        "shop.core.models": "shop.orders",
    }


def test_a_file_of_sixty_lines_is_not_small(tmp_path: Path) -> None:
    """Fewer than sixty are."""
    (tmp_path / "shop").mkdir()
    (tmp_path / "shop" / "main.py").write_text("import shop.long\nimport shop.short\n", encoding="utf-8")
    (tmp_path / "shop" / "long.py").write_text("A = 1\n" * 60, encoding="utf-8")
    (tmp_path / "shop" / "short.py").write_text("A = 1\n" * 59, encoding="utf-8")
    assert House(tmp_path, ("shop",)).small_files_of_one() == {"shop.short": "shop.main"}


def test_a_function_ends_at_its_last_line(house: House) -> None:
    """From ``def`` on; one inside another counts for both."""
    assert [(name.split()[-1], lines) for name, lines in house.function_lines().items()] == [
        ("count", 5),
        ("open", 4),
        ("price", 3),
        ("inner", 2),
    ]


def test_the_report_has_every_figure(house: House) -> None:
    """A line each; the sums by hand."""
    rows = {line[:47].strip(): line[47:].split()[0] for line in house.report()}
    assert rows["files"] == "7"
    assert rows["lines"] == str(sum(text.count("\n") for text in FILES.values()))
    assert (rows["classes"], rows["values"], rows["Protocol classes"]) == ("17", "11", "1")
    assert rows["files under 60 lines that one other imports"] == "2"
    assert rows["empty __init__ files"] == "1"
    assert rows["longest function"] == "5"


def test_the_command_prints_the_report_and_the_small_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For the packages of chefbotd below the folder that is named."""
    (tmp_path / "chefbotd").mkdir()
    (tmp_path / "chefbotd" / "main.py").write_text("from chefbotd import part\n\n\ndef run(): ...\n")
    (tmp_path / "chefbotd" / "part.py").write_text("A = 1\n")
    assert main([str(tmp_path), "--small"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["files", "2", "median", "2", "lines"]
    assert lines[-1].split() == ["1", "chefbotd.part", "<-", "chefbotd.main"]


def test_no_more_small_files_than_there_are() -> None:
    """A file of under 60 lines that one other imports belongs into it, unless it is loaded later."""
    small = House(ROOT).small_files_of_one()
    assert len(small) <= MOST_SMALL_FILES, small

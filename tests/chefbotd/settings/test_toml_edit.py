"""Gains saved into files of every form that TOML allows: what these say then, and what stays."""

import re
import tempfile
from itertools import takewhile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chefbotd.components.tuning.gains_file import save
from chefbotd.motion.pid import PidParameters
from chefbotd.settings import load
from chefbotd.settings.toml_edit import Editor
from tests.budget import examples, sample
from tests.robot_files import full

SAID = {"kp": 400, "ki_duty_per_m": 100.0, "output_limit": 255, "integral_limit_duty": 300.0, "ks": 85}
"""Gains in short and long names, of which one may be off."""

WHEELS = {
    "chefbot": ("left_wheel", "right_wheel"),
    "khan": ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel"),
}


def lines(of: str, prefix: str = "") -> list[str]:
    """The gains with a comment each, between them a comment and a blank line, the first key in quotes."""
    first, *rest = (f"{prefix}{key} = {value}   # {of} {key}\n" for key, value in SAID.items())
    return [first.replace("kp =", '"kp" =', 1), f"  # {of} middle\n", *rest[:-1], "\n", rest[-1]]


def keys(of: str, prefix: str = "") -> str:
    """The same as one text."""
    return "".join(lines(of, prefix))


def inline(**more: float) -> str:
    """The gains as an inline table."""
    return "{ " + ", ".join(f"{key}={value}" for key, value in {**SAID, **more}.items()) + "}"


def pid_forms() -> dict[str, tuple[str, str]]:
    """``[pid]``, before any section and among them."""
    return {
        "section": ("", f"# above pid\n[pid]   # pid\n{keys('pid')}# below pid\n\n# of limits\n"),
        "crowded": ("", f'# above pid\n[ "pid" ]\n{keys("pid")}# of limits\n'),
        "dotted": (f"# above pid\n{keys('pid', 'pid.')}\n", ""),
        "inline": (f"pid = {inline()} # pid\n# below pid\n", ""),
    }


def wheel_forms(one: str, two: str) -> dict[str, tuple[str, str, str]]:
    """Sections of two wheels: before any section, among them, and at the end."""
    first = f"# above one\n[wheel_pid.{one}]  # one\n\n{keys('one')}# below one\n\n"
    second = f"# above two\n\t[ wheel_pid . '{two}' ]\n{keys('two')}"
    dotted = f"# above all\n[wheel_pid]  # all\n{keys('one', one + '.')}# between\n"
    mingled = "".join(
        map("".join, zip(lines("one", f"wheel_pid.{one}."), lines("two", f"wheel_pid.{two}."), strict=True))
    )
    of_dotted = ", ".join(f"{one}.{key}={value}" for key, value in SAID.items())
    return {
        "none": ("", "", ""),
        "in the middle": ("", first + second, "# the end\n"),
        "at the end": ("", "", first + second),
        "apart": ("", first, second + "# the end\n"),
        "one": ("", "", second),
        "dotted": ("", f"{dotted}{two} = {inline(kd=1)}  # two\n", ""),
        "dotted and a section": ("", dotted + second, ""),
        "dotted on top": (keys("one", f"wheel_pid.{one}."), second, ""),
        "mingled on top": (mingled, "", ""),
        "inline": (f"wheel_pid = {{{one} = {inline(kp=7)}}}# all\n", "", ""),
        "inline and dotted": (f"wheel_pid = {{{of_dotted}, {two} = {inline()}}}\n# below all\n", "", ""),
    }


def file(robot: str, pid: tuple[str, str], wheels: tuple[str, str, str]) -> str:
    """The robot's packaged configuration with its gains in other forms."""
    pid_on_top, pid_section = pid
    on_top, among, at_end = wheels
    rest = re.sub(r"(?ms)^\[pid\].*?^(?=\[limits\])", lambda _: among + pid_section, full(robot).read_text())
    return pid_on_top + on_top + rest + at_end


@st.composite
def files(draw: st.DrawFn) -> tuple[str, bytes]:
    """A robot and a configuration for it: as packaged, or with gains in any forms, line ends and end."""
    robot = draw(st.sampled_from(list(WHEELS)))
    one, two = draw(st.permutations(WHEELS[robot]))[:2]
    text = draw(st.sampled_from(list(pid_forms().values())).flatmap(
        lambda pid: st.sampled_from(list(wheel_forms(one, two).values())).map(lambda form: file(robot, pid, form))
    ) | st.just(full(robot).read_text()))  # fmt: skip
    text = draw(st.sampled_from([text, text.rstrip("\n"), text + "\n\n# the very end"]))
    return robot, text.replace("\n", draw(st.sampled_from(["\n", "\r\n"]))).encode()


AS_SAID = PidParameters.model_validate(SAID)
SOME_GAINS = st.builds(
    PidParameters.model_construct,
    kp=st.floats(0, 1e6),
    ki=st.floats(0, 1e6),
    kd=st.sampled_from([0.0, 5e-324, 1e-7]),
    output_limit=st.sampled_from([255.0, 212.1]),
    integral_limit=st.none() | st.floats(0, 1e6),
    back_calculation_s=st.none() | st.floats(0.001, 100),
    conditional_integration=st.booleans(),
)


@st.composite
def savings(draw: st.DrawFn, robot: str) -> list[dict[str, PidParameters]]:
    """Gains to save one after another, with wheels that are alike more often than not."""
    pool = [
        AS_SAID,
        AS_SAID.model_copy(update={"integral_limit": None}),
        *draw(st.lists(SOME_GAINS, max_size=2)),
    ]
    wheels = st.fixed_dictionaries({wheel: st.sampled_from(pool) for wheel in WHEELS[robot]})
    return draw(st.lists(wheels, min_size=1, max_size=3))


def comments(text: str) -> list[str]:
    """Every comment, in the file's order: none of these files has a '#' in a string."""
    return [line.rstrip() for line in re.findall(r"#.*", text)]


def owned(text: str) -> dict[str, list[str]]:
    """The comment block directly above each section's header."""
    rows = [line.strip() for line in text.splitlines()]
    headers = [at for at, row in enumerate(rows) if row.startswith("[") and not row.startswith("[[")]
    return {rows[at]: list(takewhile(lambda row: row.startswith("#"), reversed(rows[:at]))) for at in headers}


@pytest.mark.slow
@settings(max_examples=examples(40), deadline=None)
@given(st.data())
def test_whatever_the_form(data: st.DataObject) -> None:
    """The file then says the gains asked for, and has every comment where it was; saved again, not a byte changes."""
    robot, before = data.draw(files())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "robot.toml")
        path.write_bytes(before)
        for gains in data.draw(savings(robot)):
            save(path, gains)
            saved = path.read_bytes()
            assert load(path).gains() == gains
            assert comments(saved.decode()) == comments(before.decode())
            above = owned(before.decode())
            assert all(block == above.get(header, []) for header, block in owned(saved.decode()).items())
            assert saved.count(b"\r\n") in (0, saved.count(b"\n"))
            assert saved.endswith(b"\n") == before.endswith(b"\n")
            save(path, gains)
            assert path.read_bytes() == saved


@pytest.mark.parametrize("pid", sample(list(pid_forms()), fast=2))
@pytest.mark.parametrize("form", wheel_forms("a", "b"))
@pytest.mark.parametrize("robot", sample(list(WHEELS)))
def test_what_it_says_already(robot: str, pid: str, form: str, tmp_path: Path) -> None:
    """Saving the gains that a file has leaves it as it is, whatever its form."""
    path = tmp_path / "robot.toml"
    path.write_text(text := file(robot, pid_forms()[pid], wheel_forms(*WHEELS[robot][:2])[form]))
    save(path, load(path).gains())
    assert path.read_text() == text


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("[a]\nx = 1\n\n[b]\ny = 1\n\n[c]\n", "[a]\nx = 1\n\n[c]\n"),
        ("[a]\nx = 1\n[b]\ny = 1\n[c]\n", "[a]\nx = 1\n\n[c]\n"),
        ("[b]\ny = 1\n\n[c]\n", "[c]\n"),
        ("[a]\n\n[b]\ny = 1\n", "[a]\n"),
        ("# of b\n[b]\ny = 1\n\n[c]\n", "# of b\n\n[c]\n"),
        ("# of b\n[b]\n# of c\n[c]\n", "# of b\n\n# of c\n[c]\n"),
        ("[a]\n\n[b] # b\n# y\ny = 1 # 1\n# below\n\n# of c\n[c]\n", "[a]\n\n# b\n# y\n# 1\n# below\n\n# of c\n[c]\n"),
        ("b.y = 1 # y\n[c]\n", "# y\n\n[c]\n"),
        ("b = {y = 1} # y\nx = 1\n", "# y\nx = 1\n"),
        ("[a]\n", "[a]\n"),
    ],
)  # fmt: skip
def test_a_section_is_dropped(before: str, after: str) -> None:
    """Its lines go, its comments stay, and nobody else's section gets them."""
    editor = Editor(before)
    editor.drop(("b",))
    assert editor.text() == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("[a.b]\nx = 1 # x\ny = 2 # y\n", "[a.b]\n# x\ny = 3 # y\nz = 4\n"),
        ("a.b.x = 1 # x\na.b.y = 2 # y\n", "# x\na.b.y = 3 # y\na.b.z = 4\n"),
        ("a.b = {x = 1, y = 2} # b\n", "a.b = {y = 3, z = 4} # b\n"),
        ("[a]\nb = {x = 1, y = 2} # b\n", "[a]\nb = {y = 3, z = 4} # b\n"),
        ("a = {b = {x = 1, y = 2}, c = 5} # a\n", "a = {b = {y = 3, z = 4}, c = 5} # a\n"),
        ("a = {c = 5} # a", "a = {c = 5, b = {y = 3, z = 4}} # a"),
        ("[c] # c", "[c] # c\n\n[a.b]\ny = 3\nz = 4"),
    ],
)
def test_a_section_is_changed(before: str, after: str) -> None:
    """A key is set in the form that the section has, and one that goes leaves its comment."""
    editor = Editor(before)
    editor.change(("a", "b"), {"x": None, "y": 3, "z": 4})
    assert editor.text() == after


def test_an_inline_section_is_dropped() -> None:
    """It goes from the table that it is in."""
    editor = Editor("a = {b = {x = 1}, c.d = 2} # a\n")
    editor.drop(("a", "b"))
    assert editor.text() == "a = {c = {d = 2}} # a\n"


def test_neighbours_that_go_leave_one_gap() -> None:
    """Sections dropped one below the other leave no pile of blank lines."""
    editor = Editor("[a]\n\n[w.one]\nx = 1\n\n[w.two]\nx = 1\n\n[b]\n")
    editor.drop(("w", "one"))
    editor.drop(("w", "two"))
    assert editor.text() == "[a]\n\n[b]\n"

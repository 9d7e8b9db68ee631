"""The edits of a map in the file ``edits.json`` beside it: read, changed, taken back, written. Loads no numpy.

An edit is an operation in metres of the map, so it holds for every version. The map's own files are never changed:
without its edits a map is what it was, to the byte. The file remembers the last states too, so that a change can be
taken back and made again.
"""

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field, ValidationError, model_validator

from chefbotd.components.maps.outlines import WALL_WIDTH_M, Point
from chefbotd.core.parameters import Parameters

EDITS: Final = "edits.json"
"""The file beside a map."""

MOST_EDITS: Final = 300
MOST_POINTS: Final = 200
MOST_STATES: Final = 50
"""So many states are remembered, the present one included."""

LARGEST_BYTES: Final = 200_000
"""Of the file, so that a change takes some 30 ms, in a thread."""

MOST_ANGLE_RAD: Final = 3.1416
MOST_PROBLEMS: Final = 5

Corners = Annotated[tuple[Point, ...], Field(min_length=3, max_length=MOST_POINTS)]


class Erase(Parameters):
    """What is inside these corners is free, or unknown: it is gone, also for localization."""

    kind: Literal["erase"] = "erase"
    to: Literal["free", "unknown"]
    points_m: Corners


class DrawWall(Parameters):
    """A wall along these points; only paths are planned by it."""

    kind: Literal["wall"] = "wall"
    points_m: tuple[Point, ...] = Field(min_length=2, max_length=MOST_POINTS)
    width_m: float = Field(default=WALL_WIDTH_M, gt=0, le=5)


class Crop(Parameters):
    """What is outside these corners is not shown, and not driven on."""

    kind: Literal["crop"] = "crop"
    points_m: Corners


MapEdit: TypeAlias = Annotated[Erase | DrawWall | Crop, Field(discriminator="kind")]


class EditState(Parameters):
    """The edits that count, in the order in which they are drawn; and by how much the view is turned, CCW positive."""

    edits: tuple[str, ...] = ()
    view_angle_rad: float = Field(0.0, ge=-MOST_ANGLE_RAD, le=MOST_ANGLE_RAD)


class MapEdits(Parameters):
    """Every edit that is remembered, by its id; the states that there were, the oldest first; and which one counts."""

    format: Literal[1] = 1
    drawn: dict[str, MapEdit] = {}
    states: tuple[EditState, ...] = Field((EditState(),), min_length=1, max_length=MOST_STATES)
    now: int = Field(0, ge=0)

    @model_validator(mode="after")
    def _states_fit(self) -> "MapEdits":
        if self.now >= len(self.states):
            raise ValueError(
                f"now: expected one of {len(self.states)} states, counted from 0, got {self.now}"
            )
        named = {own for state in self.states for own in state.edits}
        if most := next((state for state in self.states if len(state.edits) > MOST_EDITS), None):
            raise ValueError(f"states: expected at most {MOST_EDITS} edits, got {len(most.edits)}")
        if missing := sorted(named - self.drawn.keys()):
            raise ValueError(f"states: no edit with the id {missing[0]!r} is drawn")
        return self

    @property
    def state(self) -> EditState:
        """The one that counts."""
        return self.states[self.now]

    def edits(self) -> tuple[tuple[str, MapEdit], ...]:
        """The edits that count with their ids, in the order in which they are drawn."""
        return tuple((own, self.drawn[own]) for own in self.state.edits)

    @property
    def can_undo(self) -> bool:
        """Whether a change can be taken back."""
        return self.now > 0

    @property
    def can_redo(self) -> bool:
        """Whether one that was taken back can be made again."""
        return self.now + 1 < len(self.states)


NO_EDITS: Final = MapEdits()


def parse_edits(content: bytes | None) -> MapEdits:
    """The content of the file; none where there is no file.

    Raises:
        ValueError: it holds no edits; its text names the file and what was expected.
    """
    if content is None:
        return NO_EDITS
    try:
        return MapEdits.model_validate_json(content)
    except ValidationError as error:
        problems = [": ".join(filter(None, (".".join(map(str, e["loc"])), e["msg"]))) for e in error.errors()]
        raise ValueError(f"{EDITS}: {'; '.join(problems[:MOST_PROBLEMS])}") from error


def write_edits(edits: MapEdits) -> bytes:
    """The file's content, which people can read."""
    return edits.model_dump_json().encode() + b"\n"


def with_edit(edits: MapEdits, own: str, edit: MapEdit) -> MapEdits:
    """These edits and one more, drawn last.

    Raises:
        ValueError: they are too many.
    """
    ids = edits.state.edits
    if len(ids) >= MOST_EDITS:
        raise ValueError(f"a map has at most {MOST_EDITS} edits: delete some of them")
    state = edits.state.model_copy(update={"edits": (*ids, own)})
    return _in_state(edits.model_copy(update={"drawn": {**edits.drawn, own: edit}}), state)


def without_edit(edits: MapEdits, own: str) -> MapEdits:
    """These edits but one."""
    ids = tuple(other for other in edits.state.edits if other != own)
    return _in_state(edits, edits.state.model_copy(update={"edits": ids}))


def with_view_angle(edits: MapEdits, angle_rad: float) -> MapEdits:
    """These edits, and the view turned by this."""
    return _in_state(edits, edits.state.model_copy(update={"view_angle_rad": angle_rad}))


def step_back(edits: MapEdits) -> MapEdits:
    """As they were before the last change; there must have been one."""
    return edits.model_copy(update={"now": edits.now - 1})


def step_forward(edits: MapEdits) -> MapEdits:
    """As they were before that was taken back; something must have been."""
    return edits.model_copy(update={"now": edits.now + 1})


def _in_state(edits: MapEdits, state: EditState) -> MapEdits:
    """In this state, which follows on the present one; what was taken back before is given up.

    The oldest states are forgotten where there are too many, or where they take too much room.

    Raises:
        ValueError: the edits that count take too much room by themselves.
    """
    states = (*edits.states[: edits.now + 1], state)[-MOST_STATES:]
    while True:
        named = {own for one in states for own in one.edits}
        drawn = {own: edit for own, edit in edits.drawn.items() if own in named}
        changed = MapEdits(drawn=drawn, states=states, now=len(states) - 1)
        if len(write_edits(changed)) <= LARGEST_BYTES:
            return changed
        if len(states) == 1:
            raise ValueError("the edits of the map have too many points: delete some of them")
        states = states[len(states) // 2 :]

"""The gate: modes, arbitration and the dead-man."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from chefbotd.core.commands import RefusalKind, Refused
from chefbotd.core.geometry import STANDING, Twist2D, WheelVelocities
from chefbotd.safety.faults import RECOVERABLE, FaultKind
from chefbotd.safety.gate import (
    CALIBRATION,
    COME_TO_REST,
    DEAD_MAN,
    HALT,
    NEXT,
    Command,
    Decision,
    GateState,
    Mode,
    SafetyParameters,
    SourceParameters,
    Trigger,
    accept,
    change_mode,
    decide,
    release,
    stop,
)
from chefbotd.settings import load, packaged

PARAMETERS = SafetyParameters()
SLOW = Twist2D(0.1, 0.0)
FAST = Twist2D(0.3, 0.0)
TURN = Twist2D(0.0, 1.0)

EXPECTED_NEXT = {
    Mode.ARMED: {"arm": "armed", "estop": "estopped", "fault": "disarmed", "recovery": "armed"},
    Mode.DISARMED: {"arm": "armed", "estop": "estopped", "fault": "disarmed", "recovery": "armed"},
    Mode.ESTOPPED: {"arm": "armed", "estop": "estopped", "fault": "estopped", "recovery": "estopped"},
}


def test_only_the_calibration_drives_by_duties():
    """Any other source with a duty is an error of the program; no client may name the calibration."""
    by_duty = WheelVelocities((1.0, 1.0), SLOW, duty=(50, 50))
    accepted = accept(PARAMETERS, GateState(), Command(CALIBRATION, by_duty, 0.0))
    assert decide(PARAMETERS, accepted, 0.1).motion == by_duty
    with pytest.raises(ValueError, match="only the source 'calibration' may drive by duties, got 'teleop'"):
        accept(PARAMETERS, GateState(), Command("teleop", by_duty, 0.0))
    assert CALIBRATION not in PARAMETERS.offered
    with pytest.raises(ValidationError, match="default_source must be one of safety, teleop, navigation"):
        SafetyParameters(default_source=CALIBRATION)


def test_of_duties_a_guard_leaves_all_or_nothing():
    """Half a duty would be another measurement."""
    by_duty = WheelVelocities((1.0, 1.0), SLOW, duty=(50, 50))
    assert by_duty.slowed(1.0) == by_duty
    assert by_duty.slowed(0.9) == WheelVelocities((0.0, 0.0), STANDING, duty=(0, 0))


def given_commands(*commands: Command) -> GateState:
    """A gate that has accepted these."""
    state = GateState()
    for command in commands:
        state = accept(PARAMETERS, state, command)
    return state


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("trigger", Trigger)
def test_every_mode_answers_every_trigger(mode: Mode, trigger: Trigger):
    """The table is complete: an e-stop is only left by arm, a fault by arm or recovery."""
    expected = EXPECTED_NEXT[mode][trigger]
    assert NEXT[mode, trigger] == expected
    before = GateState(mode, "before", fault=FaultKind.LINK_LOST)
    assert change_mode(before, trigger, "after").mode == expected


@pytest.mark.parametrize("trigger", [Trigger.ESTOP, Trigger.FAULT])
def test_leaving_armed_forgets_every_command(trigger: Trigger):
    """After an e-stop or a fault nothing is left that could move the robot once it is armed again."""
    state = change_mode(given_commands(Command("teleop", FAST, 0.0)), trigger, "why")
    assert (state.commands, state.reason) == ((), "why")
    assert decide(PARAMETERS, state, 0.0) == HALT
    armed = change_mode(state, Trigger.ARM, "armed")
    assert decide(PARAMETERS, armed, 0.0) == COME_TO_REST


def test_arming_what_is_armed_disturbs_no_command():
    """A second arm while driving changes nothing."""
    state = given_commands(Command("teleop", FAST, 0.0))
    assert change_mode(state, Trigger.ARM, "again") is state


def test_a_later_fault_does_not_hide_the_estop():
    """A lost link during an e-stop leaves mode and reason of the e-stop in place."""
    stopped = change_mode(GateState(), Trigger.ESTOP, "button")
    assert change_mode(stopped, Trigger.FAULT, "link") == stopped


@pytest.mark.parametrize("kind", FaultKind)
def test_only_a_fault_that_passes_by_itself_recovers(kind: FaultKind):
    """When the board is back, a lost link and a restarted board are over; a stalled wheel still waits for a person."""
    faulted = change_mode(GateState(), Trigger.FAULT, "first", kind)
    assert (faulted.mode, faulted.fault) == (Mode.DISARMED, kind)
    recovered = change_mode(faulted, Trigger.RECOVERY, "back")
    assert recovered.mode is (Mode.ARMED if kind in RECOVERABLE else Mode.DISARMED)
    assert change_mode(faulted, Trigger.ARM, "armed") == GateState(Mode.ARMED, "armed")


def test_the_first_of_two_faults_is_the_one_that_is_told():
    """What follows from a fault does not hide it."""
    stalled = change_mode(GateState(), Trigger.FAULT, "wheel", FaultKind.WHEEL_STALLED)
    assert change_mode(stalled, Trigger.FAULT, "link", FaultKind.LINK_LOST) is stalled


@pytest.mark.parametrize(
    ("mode", "kind"), [(Mode.DISARMED, RefusalKind.DISARMED), (Mode.ESTOPPED, RefusalKind.ESTOPPED)]
)
def test_commands_are_refused_unless_armed(mode: Mode, kind: RefusalKind):
    """The refusal names the mode, the reason and the way out."""
    with pytest.raises(Refused, match=r"\(why\); arm the robot first") as refusal:
        accept(PARAMETERS, GateState(mode, "why"), Command("teleop", FAST, 0.0))
    assert refusal.value.kind is kind


def test_an_unknown_source_is_refused_by_name():
    """The refusal names the source that was given and those there are."""
    with pytest.raises(Refused, match=r"'joystick'.*navigation, safety, teleop") as refusal:
        accept(PARAMETERS, GateState(), Command("joystick", FAST, 0.0))
    assert refusal.value.kind is RefusalKind.UNKNOWN_SOURCE


def test_the_highest_live_source_wins():
    """Safety 10 beats teleop 7 beats navigation 5, in whatever order they spoke."""
    commands = [
        Command("safety", STANDING, 0.0),
        Command("navigation", FAST, 0.0),
        Command("teleop", SLOW, 0.0),
    ]
    assert decide(PARAMETERS, given_commands(*commands), 0.1).source == "safety"
    assert decide(PARAMETERS, given_commands(*commands[1:]), 0.1).motion == SLOW


def test_a_source_that_falls_silent_gives_way():
    """Safety's command lasts 0.2 s; after it teleop's, still alive, is in force."""
    state = given_commands(Command("teleop", FAST, 0.0), Command("safety", SLOW, 0.0))
    assert decide(PARAMETERS, state, 0.2).source == "safety"
    assert decide(PARAMETERS, state, 0.201).source == "teleop"


def test_a_default_source_is_one_of_the_sources():
    """A robot without teleop has to say whose a command is that does not; both are named."""
    joystick = {"joystick": SourceParameters(priority=10, timeout_s=0.5)}
    with pytest.raises(ValidationError, match="default_source must be one of joystick, got 'teleop'"):
        SafetyParameters(sources=joystick)
    assert SafetyParameters(sources=joystick, default_source="joystick").default_source == "joystick"


def test_of_two_equals_the_newer_wins():
    """With the same priority, whoever spoke last is followed."""
    equal = SourceParameters(priority=3, timeout_s=1.0)
    parameters = SafetyParameters(sources={"a": equal, "b": equal}, default_source="a")
    state = GateState(commands=(Command("b", FAST, 0.2), Command("a", SLOW, 0.1)))
    assert decide(parameters, state, 0.3).source == "b"


def test_no_command_moves_the_robot_past_the_dead_man():
    """Teleop's own timeout is 1.0 s, but the dead-man ends its motion after 0.5 s, measured from the command."""
    state = given_commands(Command("teleop", FAST, 10.0))
    assert decide(PARAMETERS, state, 10.5) == Decision(FAST, "teleop", halted=False)
    assert decide(PARAMETERS, state, 10.501) == Decision(
        STANDING, "teleop", halted=False, limited_by=DEAD_MAN
    )
    assert decide(PARAMETERS, state, 11.001) == COME_TO_REST


def test_a_source_keeps_lower_ones_out_until_its_own_timeout():
    """Teleop has said nothing for 0.5 s: the robot comes to rest. After 1.0 s navigation, which went on, is followed."""
    state = given_commands(Command("teleop", FAST, 0.0))
    for now_s, source, motion in [
        (0.5, "teleop", FAST),
        (0.501, "teleop", STANDING),
        (1.0, "teleop", STANDING),
        (1.001, "navigation", SLOW),
    ]:
        state = accept(PARAMETERS, state, Command("navigation", SLOW, now_s))
        decision = decide(PARAMETERS, state, now_s)
        assert (decision.source, decision.motion) == (source, motion), now_s


SHORT, LONG = 0.2, 0.5
GONE = (None, STANDING, None)
HIGH, LOW = ("high", FAST, None), ("low", SLOW, None)
HIGH_BRAKES, LOW_BRAKES = ("high", STANDING, DEAD_MAN), ("low", STANDING, DEAD_MAN)


@pytest.mark.parametrize(
    ("dead_man_s", "timeout_s", "high_age_s", "low_age_s", "expected"),
    [
        # The dead-man is the shorter time: the robot brakes from 0.2 s, and the lower source waits for 0.5 s.
        (SHORT, LONG, 0.2, None, HIGH),
        (SHORT, LONG, 0.2, 0.0, HIGH),
        (SHORT, LONG, 0.21, None, HIGH_BRAKES),
        (SHORT, LONG, 0.5, 0.0, HIGH_BRAKES),
        (SHORT, LONG, 0.51, None, GONE),
        (SHORT, LONG, 0.51, 0.0, LOW),
        (SHORT, LONG, 0.51, 0.21, LOW_BRAKES),
        (SHORT, LONG, 0.51, 0.51, GONE),
        # The source's time-out is the shorter: who is still live takes over at once; without one it is the dead-man.
        (LONG, SHORT, 0.2, None, HIGH),
        (LONG, SHORT, 0.2, 0.0, HIGH),
        (LONG, SHORT, 0.21, None, HIGH_BRAKES),
        (LONG, SHORT, 0.21, 0.0, LOW),
        (LONG, SHORT, 0.21, 0.2, LOW),
        (LONG, SHORT, 0.21, 0.21, HIGH_BRAKES),
        (LONG, SHORT, 0.5, None, HIGH_BRAKES),
        (LONG, SHORT, 0.5, 0.0, LOW),
        (LONG, SHORT, 0.51, 0.21, LOW_BRAKES),
        (LONG, SHORT, 0.51, None, GONE),
        (LONG, SHORT, 0.51, 0.0, LOW),
        (LONG, SHORT, 0.51, 0.51, GONE),
        # Both are the same: there is nothing between them.
        (SHORT, SHORT, 0.2, None, HIGH),
        (SHORT, SHORT, 0.2, 0.0, HIGH),
        (SHORT, SHORT, 0.21, None, GONE),
        (SHORT, SHORT, 0.21, 0.0, LOW),
    ],
)
def test_who_drives_before_and_after_each_time(
    dead_man_s: float,
    timeout_s: float,
    high_age_s: float,
    low_age_s: float | None,
    expected: tuple[str | None, Twist2D, str | None],
):
    """By the age of the last word of each source (None: it never spoke): who drives, how, and limited by what."""
    sources = {
        name: SourceParameters(priority=priority, timeout_s=timeout_s)
        for name, priority in (("high", 2), ("low", 1))
    }
    parameters = SafetyParameters(sources=sources, default_source="low", command_timeout_s=dead_man_s)
    commands = [Command("high", FAST, 1.0 - high_age_s)]
    if low_age_s is not None:
        commands.append(Command("low", SLOW, 1.0 - low_age_s))
    decision = decide(parameters, GateState(commands=tuple(commands)), 1.0 - 1e-9)
    assert (decision.source, decision.motion, decision.limited_by) == expected
    assert not decision.halted


def test_a_source_that_is_out_sooner_than_the_dead_man_stops_the_robot_and_says_why():
    """command_timeout_s 2.0 and teleop's 1.0 s: it brakes after 1.0 s, as dead_man until 2.0 s are over."""
    parameters = SafetyParameters(command_timeout_s=2.0)
    state = GateState(commands=(Command("teleop", FAST, 0.0),))
    for now_s in (1.001, 2.0):
        assert decide(parameters, state, now_s) == Decision(
            STANDING, "teleop", halted=False, limited_by=DEAD_MAN
        )
    assert decide(parameters, state, 2.001) == COME_TO_REST


def test_each_of_khans_sources_keeps_the_lower_ones_out_for_half_a_second():
    """Joystick 10, marker 8, move_base 2, external 1: each moves it for 0.25 s, and holds it for 0.5 s."""
    parameters = load(packaged("khan")).safety
    order = sorted(parameters.offered, key=lambda name: -parameters.sources[name].priority)
    assert order == ["joystick", "marker", "move_base", "external"]
    for higher, lower in pairwise(order):
        state = GateState(commands=(Command(higher, FAST, 0.0),))
        for now_s, followed in [
            (0.25, (higher, FAST)),
            (0.26, (higher, STANDING)),
            (0.5, (higher, STANDING)),
        ]:
            state = accept(parameters, state, Command(lower, SLOW, now_s))
            decision = decide(parameters, state, now_s)
            assert (decision.source, decision.motion) == followed, (higher, now_s)
        assert decide(parameters, state, 0.51).source == lower


def test_a_newer_command_replaces_its_sources_older_one():
    """A source has one command, its newest."""
    state = given_commands(Command("teleop", FAST, 0.0), Command("teleop", TURN, 0.1))
    assert state.commands == (Command("teleop", TURN, 0.1),)


def test_releasing_a_source_lets_lower_ones_go_on_at_once():
    """Its command is forgotten, the others' are not; releasing a source that has none changes nothing."""
    state = given_commands(Command("teleop", FAST, 0.0), Command("navigation", SLOW, 0.0))
    freed = release(state, "teleop")
    decision = decide(PARAMETERS, freed, 0.01)
    assert (decision.motion, decision.source) == (SLOW, "navigation")
    assert release(freed, "teleop") == freed


def test_stop_forgets_every_source_and_latches_nothing():
    """After stop the robot comes to rest; the next command moves it again."""
    state = stop(given_commands(Command("teleop", FAST, 0.0), Command("navigation", FAST, 0.0)))
    assert decide(PARAMETERS, state, 0.0) == COME_TO_REST
    again = accept(PARAMETERS, state, Command("teleop", SLOW, 0.1))
    assert decide(PARAMETERS, again, 0.1).motion == SLOW


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        ({"command_timeout_s": 0.05}, "greater than or equal to 0.1"),
        ({"command_timeout_s": 2.5}, "less than or equal to 2"),
        ({"sources": {}}, "at least 1 item"),
        ({"sources": {"a": {"priority": 256, "timeout_s": 1}}}, "less than or equal to 255"),
        ({"rearm": "sometimes"}, "'manual' or 'auto'"),
    ],
)
def test_parameters_out_of_range_are_refused(bad: dict[str, object], told: str):
    """The dead-man is 0.1 to 2 s, priorities 0 to 255, and there is at least one source."""
    with pytest.raises(ValidationError, match=told):
        SafetyParameters.model_validate(bad)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.sampled_from(list(Trigger))),
            st.tuples(st.sampled_from(["safety", "teleop", "navigation"]), st.floats(0.0, 0.3)),
            st.tuples(st.none(), st.none()),
        ),
        max_size=30,
    )
)
def test_the_robot_is_never_driven_unless_armed(story: list[tuple[object, ...]]):
    """Whatever happens in whatever order: only ARMED decides a twist, and only one that was accepted."""
    state, now_s, asked = GateState(), 0.0, set()
    for step in story:
        now_s += 0.1
        if len(step) == 1:
            state = change_mode(state, step[0], "story")
        elif step[0] is None:
            state = stop(state)
        else:
            twist = Twist2D(step[1], 0.0)
            try:
                state = accept(PARAMETERS, state, Command(step[0], twist, now_s))
                asked.add(twist)
            except Refused:
                assert state.mode is not Mode.ARMED
        decision = decide(PARAMETERS, state, now_s)
        assert decision.halted == (state.mode is not Mode.ARMED)
        if decision.motion != STANDING:
            assert decision.motion in asked
            assert not decision.halted


def test_a_fault_that_needs_a_person_does_not_hide_behind_one_that_passes():
    """The link is lost, then a service fails, then the link is back: the robot stays disarmed, and says why."""
    state = change_mode(GateState(), Trigger.FAULT, "unplugged", FaultKind.LINK_LOST)
    state = change_mode(state, Trigger.FAULT, "broken", FaultKind.SERVICE_FAILED)
    assert (state.fault, state.reason) == (FaultKind.SERVICE_FAILED, "broken")
    assert change_mode(state, Trigger.RECOVERY, "back").mode is Mode.DISARMED

"""Every step of the dialogue."""

import itertools

import pytest
from chefbot_speech.commands import Action, Command
from chefbot_speech.dialogue import (
    PATIENCE_S,
    Dialogue,
    Effect,
    Phase,
    answer,
    hear,
    look,
    press,
    release,
    touch,
)

GO = Command(Action.GO, "table 3")
THINKING = Dialogue(Phase.THINKING)
PROPOSED = hear(THINKING, GO, 100.0, None).dialogue
COUNTING = hear(THINKING, GO, 100.0, 5.0).dialogue


@pytest.mark.parametrize("dialogue", [Dialogue(), THINKING, PROPOSED, COUNTING, Dialogue(Phase.LISTENING)])
def test_pressing_brakes_whatever_there_was(dialogue: Dialogue) -> None:
    """And ends every countdown."""
    step = press(dialogue)
    assert step.effect is Effect.STOP
    assert step.dialogue.phase is Phase.LISTENING
    assert step.dialogue.start_s is None


def test_a_goal_begins_only_after_it_was_proposed_and_confirmed() -> None:
    """Heard it is a question; a yes makes it a goal, once."""
    proposed = hear(THINKING, GO, 100.0, None)
    assert (proposed.effect, proposed.text) == (None, "Go to table 3? Say or touch yes.")
    confirmed = answer(proposed.dialogue, Action.YES, 101.0)
    assert (confirmed.effect, confirmed.place) == (Effect.GO, "table 3")
    assert answer(confirmed.dialogue, Action.YES, 101.0).effect is None


def test_a_spoken_yes_confirms_what_was_proposed_before_the_press() -> None:
    """Press, say yes, release."""
    listening = press(PROPOSED).dialogue
    step = hear(release(listening).dialogue, Command(Action.YES), 110.0, None)
    assert (step.effect, step.place) == (Effect.GO, "table 3")


@pytest.mark.parametrize("after_s", [PATIENCE_S, 101.0])
@pytest.mark.parametrize("is_held", [False, True])
def test_a_yes_that_comes_too_late_begins_nothing(after_s: float, *, is_held: bool) -> None:
    """Touched; or spoken, after a press that the time has passed in; and what was not understood is not asked again."""
    now_s = 100.0 + after_s
    thinking = release(press(PROPOSED).dialogue).dialogue
    yes = Command(Action.YES)
    step = hear(thinking, yes, now_s, None) if is_held else answer(PROPOSED, Action.YES, now_s)
    assert (step.effect, step.dialogue.proposal, step.text) == (None, "", "I have asked nothing.")
    assert hear(thinking, None, now_s, None).text == "I did not understand. I stay here."


def test_a_countdown_that_is_longer_than_the_patience_begins_its_goal() -> None:
    """Of 60 s, also where the timer comes a little late; not where it comes after a long standstill of the program."""
    counting = hear(THINKING, GO, 100.0, 60.0).dialogue
    assert look(counting, 100.0 + PATIENCE_S).dialogue == counting
    assert look(counting, 160.5).effect is Effect.GO
    assert look(counting, 160.0 + PATIENCE_S).effect is None


@pytest.mark.parametrize("action", [Action.NO, Action.CANCEL, Action.STOP])
def test_no_cancel_and_stop_forget_the_proposal(action: Action) -> None:
    """A yes after it confirms nothing."""
    step = answer(PROPOSED, action, 101.0)
    assert step.effect is not Effect.GO
    assert answer(step.dialogue, Action.YES, 101.0).effect is None


def test_what_is_not_understood_leaves_the_robot_standing() -> None:
    """Without and with a proposal, which is then asked again and counts down no more."""
    assert hear(THINKING, None, 100.0, 5.0).effect is None
    listening = press(COUNTING).dialogue
    step = hear(release(listening).dialogue, None, 101.0, 5.0)
    assert (step.effect, step.dialogue.start_s) == (None, None)
    assert "Shall I go to table 3?" in step.text
    assert look(step.dialogue, 120.0).effect is None


def test_a_countdown_begins_the_goal_unless_somebody_touches_the_page() -> None:
    """5 s after it was heard, and not before."""
    assert look(COUNTING, 104.9).effect is None
    assert (look(COUNTING, 105.0).effect, look(COUNTING, 105.0).place) == (Effect.GO, "table 3")
    assert look(touch(COUNTING).dialogue, 105.0).effect is None


def test_without_a_countdown_no_time_begins_a_goal() -> None:
    """After a while it is forgotten."""
    step = look(PROPOSED, 100.0 + PATIENCE_S)
    assert (step.effect, step.dialogue) == (None, Dialogue())
    assert answer(step.dialogue, Action.YES, 101.0).effect is None


@pytest.mark.parametrize("phase", [Phase.LISTENING, Phase.THINKING])
def test_nothing_begins_while_somebody_talks(phase: Phase) -> None:
    """Neither by a touched yes nor by a countdown."""
    dialogue = Dialogue(phase, "table 3", forget_s=200.0, start_s=105.0)
    assert answer(dialogue, Action.YES, 101.0).effect is None
    assert look(dialogue, 106.0).effect is None


@pytest.mark.parametrize("phase", [Phase.READY, Phase.LISTENING])
def test_what_is_heard_too_late_counts_for_nothing(phase: Phase) -> None:
    """Somebody has pressed again meanwhile."""
    dialogue = Dialogue(phase)
    assert hear(dialogue, GO, 100.0, 5.0).dialogue == dialogue


def test_no_single_step_from_rest_moves_the_robot() -> None:
    """Every command in every phase, without a proposal."""
    for phase, action in itertools.product(Phase, Action):
        dialogue = Dialogue(phase)
        steps = (
            press(dialogue),
            release(dialogue),
            touch(dialogue),
            look(dialogue, 1e6),
            answer(dialogue, action, 101.0),
        )
        heard = hear(dialogue, Command(action, "table 3"), 0.0, 5.0)
        assert all(step.effect is not Effect.GO for step in (*steps, heard)), (phase, action)

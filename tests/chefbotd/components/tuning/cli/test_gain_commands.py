"""What changed gains read as, so that they can be set again."""

from chefbotd.cli.common.arguments import gain
from chefbotd.components.tuning.cli.gain_steps import restore_commands
from chefbotd.motion.pid import PidParameters

SAVED = PidParameters(kp=400.0, ki=100.0, output_limit=1023.0, back_calculation_s=0.5)
CHANGES = {
    "kp": 441.5,
    "conditional_integration": not SAVED.conditional_integration,
    "back_calculation_s": None,
}


def test_a_change_of_all_wheels_is_one_command() -> None:
    """Whoever types it asks for exactly the gains that were in force, and for no other."""
    changed = SAVED.model_copy(update=CHANGES)
    (command,) = restore_commands({"left": SAVED, "right": SAVED}, {"left": changed, "right": changed})
    words = command.split()
    assert words[:4] == ["chefbotctl", "pid", "set", "all"]
    assert dict(map(gain, words[4:])) == CHANGES


def test_a_change_of_one_wheel_names_it() -> None:
    """A wheel that was left alone is not spoken of."""
    changed = {"left": SAVED, "right": SAVED.model_copy(update={"ki": 90.0})}
    assert restore_commands({"left": SAVED, "right": SAVED}, changed) == ["chefbotctl pid set right ki=90.0"]


def test_nothing_changed_needs_no_command() -> None:
    """There is nothing to bring back."""
    assert restore_commands({"left": SAVED, "right": SAVED}, {"left": SAVED, "right": SAVED}) == []

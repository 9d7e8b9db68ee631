"""What the process sees to once the daemon is built."""

import gc

from chefbotd.process import run as process


def test_what_has_been_built_is_passed_over_by_the_garbage_collector():
    """Every object that is in use is frozen, so a full collection in mid-drive looks at new ones only."""
    gc.unfreeze()  # what the tests have frozen
    built = len(gc.get_objects())
    process.freeze_gc()  # it stays frozen: so do all tests leave it that come after
    assert gc.get_freeze_count() >= 0.9 * built

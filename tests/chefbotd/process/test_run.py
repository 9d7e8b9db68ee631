"""What the process sees to once the daemon is built."""

import gc

from chefbotd.process import run as process


def test_what_has_been_built_is_passed_over_by_the_garbage_collector():
    """Every object that is in use is frozen, so a full collection in mid-drive looks at new ones only."""
    gc.collect()
    built = len(gc.get_objects())
    try:
        process.freeze_gc()
        assert gc.get_freeze_count() >= 0.9 * built
    finally:
        gc.unfreeze()

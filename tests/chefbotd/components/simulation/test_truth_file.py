"""The simulated robot's truth, from process to process."""

import struct
from pathlib import Path

import numpy as np
import pytest

from chefbotd.components.simulation import truth_file
from chefbotd.components.simulation.truth_file import Truth, TruthReader, TruthWriter
from chefbotd.core.geometry import Pose2D


class _Killed(struct.Struct):
    """The counter of a writer that is killed when all but the counter is written."""

    def pack_into(self, *_: object) -> None:
        raise KeyboardInterrupt


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """The newest of each write; nothing before the first; no more discs than there is room for."""
    writer = TruthWriter(tmp_path / "truth")
    reader = TruthReader(tmp_path / "truth")
    assert reader.read() is None
    for number, discs in enumerate((np.zeros((0, 3)), np.array([[1.0, 2.0, 0.25], [3.0, 4.0, 0.5]]))):
        writer.write(Truth(12.5 + number, Pose2D(0.1, -0.2, 0.3), discs))
        read = reader.read()
        assert read is not None
        assert (read.stamp_s, read.world_from_base) == (12.5 + number, Pose2D(0.1, -0.2, 0.3))
        assert (read.discs == discs).all()
    writer.write(Truth(20.0, Pose2D(), np.ones((500, 3))))
    crowded = reader.read()
    assert crowded is not None
    assert len(crowded.discs) == 128
    writer.close()
    reader.close()


@pytest.mark.parametrize("writes", [1, 2])
def test_a_writer_killed_while_it_writes_leaves_the_truth_before(
    tmp_path: Path, writes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The counter has not moved yet: that is read, and the next writer goes on from there."""
    path = tmp_path / "truth"
    writer = TruthWriter(path)
    for number in range(writes):
        writer.write(Truth(float(number), Pose2D(0.1, 0.2, 0.3), np.zeros((0, 3))))
    with monkeypatch.context() as patch:
        patch.setattr(truth_file, "COUNTER", _Killed("<Q"))
        with pytest.raises(KeyboardInterrupt):
            writer.write(Truth(99.0, Pose2D(9.0, 9.0, 0.9), np.ones((2, 3))))
    writer.close()
    reader = TruthReader(path)
    left = reader.read()
    assert left is not None
    assert (left.stamp_s, left.world_from_base) == (writes - 1.0, Pose2D(0.1, 0.2, 0.3))
    again = TruthWriter(path)
    again.write(Truth(100.0, Pose2D(), np.zeros((0, 3))))
    after = reader.read()
    assert after is not None
    assert after.stamp_s == 100.0
    again.close()
    reader.close()

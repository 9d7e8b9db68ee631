"""The simulated robot's truth, from process to process."""

import struct
from pathlib import Path

import numpy as np

from chefbotd.core.geometry import Pose2D
from chefbotd.sim.truth_file import Truth, TruthReader, TruthWriter


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


def test_what_is_being_written_is_not_read(tmp_path: Path) -> None:
    """An odd counter at the head."""
    writer = TruthWriter(tmp_path / "truth")
    writer.write(Truth(1.0, Pose2D(), np.zeros((0, 3))))
    reader = TruthReader(tmp_path / "truth")
    with (tmp_path / "truth").open("r+b") as file:
        file.write(struct.pack("<Q", 3))
    assert reader.read() is None
    writer.close()
    reader.close()

"""Localization on recordings of real buildings, and in a simulated flat, against the truth.

Of every recording in the folder, whatever its name, every other scan is mapped by our SLAM; on that map the scans in
between are localized, from a start that is not told, and held against SLAM over all scans. There, in the simulator's
office and in a mirrored corridor, wrong poses are set. A scan's cost is processor time of this process; compiling is
done before.
"""

from pathlib import Path

from benchmarks import localization_flat, localization_lies, localization_recordings
from benchmarks.carmen import recordings
from benchmarks.figures import Outcome
from benchmarks.slam import FOLDER

QUICK_SCANS = 400


def run(*, quick: bool = False, folder: Path = FOLDER, out: Path | None = None) -> Outcome:
    """The flat, and every recording (their beginnings, when quick); without recordings it says so."""
    figures, remarks = localization_flat.figures(quick=quick)
    for building in (localization_lies.office(), localization_lies.mirrored_corridor()):
        figures += localization_lies.figures(building, quick=quick)
    found = list(recordings(folder))
    for recording in found:
        scans = min(QUICK_SCANS, len(recording.rows)) if quick else len(recording.rows)
        done = localization_recordings.localized(recording, scans)
        figures += localization_recordings.figures(recording, done)
        remarks.append(localization_recordings.told(recording, done))
        building = localization_lies.of_recording(recording.name, done.within, done.truth, done.points)
        figures += localization_lies.figures(building, quick=quick)
        if out is not None:
            localization_recordings.write(out / f"{recording.name}.csv", recording, done)
    if not found:
        remarks.append(f"skipped the recordings: none in {folder}")
    return Outcome(tuple(figures), remarks=tuple(remarks))

"""Localization on recordings of real buildings, and in a simulated flat, against the truth.

Of every recording in the folder, whatever its name, every other scan is mapped by our SLAM; on that map the scans in between
are localized, from a start that is not told. They are held against SLAM over all scans; the two maps are laid on each other
by the scans that both have. In the flat, the truth is known. A scan's cost is processor time of this process.
"""

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.carmen import Recording, recordings
from benchmarks.figures import Figure, Outcome
from benchmarks.slam import FOLDER, points_of, slam_poses
from chefbotd.localization.localizer import (
    Localization,
    LocalizationMap,
    LocalizationParameters,
    Odometry,
    Report,
    localization_map,
    step,
)
from chefbotd.localization.states import State
from chefbotd.mapping.occupancy import occupancy
from chefbotd.mapping.poses import Floats, between, compose, transform
from chefbotd.mapping.state import Scan
from chefbotd.mapping.surfaces import Singles, normals
from chefbotd.sim.rooms import X

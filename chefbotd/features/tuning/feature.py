"""The feature: tuning."""

from chefbotd.features.feature import Feature
from chefbotd.features.tuning.methods import TuningMethods
from chefbotd.features.tuning.tuning import Tuning
from chefbotd.rpc.method import methods_of


def tuning(gains: Tuning) -> Feature:
    """Gains changed while the robot runs."""
    return Feature("tuning", methods=methods_of(TuningMethods(gains)), parts=(gains,))

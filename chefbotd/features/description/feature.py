"""The feature: the robot's description."""

from collections.abc import Callable

from chefbotd.features.description.methods import DescriptionMethods
from chefbotd.features.feature import Feature
from chefbotd.rpc.method import methods_of


def description(urdf: Callable[[], str | None]) -> Feature:
    """``urdf`` gives the URDF document as it stands."""
    return Feature("description", methods=methods_of(DescriptionMethods(urdf)))

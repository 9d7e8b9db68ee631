"""The feature: the robot's description."""

from chefbotd.features.description.methods import DescriptionMethods
from chefbotd.features.feature import Feature
from chefbotd.rpc.method import methods_of


def description(urdf: str | None) -> Feature:
    """The URDF document, as it stands."""
    return Feature("description", methods=methods_of(DescriptionMethods(urdf)))

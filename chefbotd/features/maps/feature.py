"""The feature: maps."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.maps.methods import MapsMethods
from chefbotd.features.maps.service import MapsService
from chefbotd.rpc.method import methods_of


def maps(service: MapsService) -> Feature:
    """Stored maps and their places, over the service that keeps them."""
    return Feature("maps", services=(Service("maps", service.run),), methods=methods_of(MapsMethods(service)))

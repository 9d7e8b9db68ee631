"""The feature: making a map."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.mapping.methods import TOPICS, MappingMethods
from chefbotd.features.mapping.service import MappingService
from chefbotd.rpc.method import methods_of


def mapping(service: MappingService) -> Feature:
    """SLAM in the worker, over the service that asks it."""
    return Feature(
        "mapping",
        services=(Service("mapping", service.run, in_steps=True),),
        methods=methods_of(MappingMethods(service)),
        topics=TOPICS,
        parts=(service,),
    )

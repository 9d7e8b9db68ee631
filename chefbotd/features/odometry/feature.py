"""The feature: odometry."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.odometry.methods import TOPICS, OdometryMethods
from chefbotd.features.odometry.service import OdometryService
from chefbotd.rpc.method import methods_of


def odometry(service: OdometryService) -> Feature:
    """Dead reckoning, over the service that does it."""
    return Feature(
        "odometry",
        services=(Service("odometry", service.run),),
        methods=methods_of(OdometryMethods(service)),
        topics=TOPICS,
        parts=(service,),
    )

"""The feature: localization."""

from chefbotd.features.feature import Feature, Service
from chefbotd.features.localization.methods import TOPICS, LocalizationMethods
from chefbotd.features.localization.service import LocalizationService
from chefbotd.rpc.method import methods_of


def localization(service: LocalizationService) -> Feature:
    """Localization in the worker, over the service that asks it."""
    return Feature(
        "localization",
        services=(Service("localization", service.run, in_steps=True),),
        methods=methods_of(LocalizationMethods(service)),
        topics=TOPICS,
        parts=(service,),
        waiting=service.waiting,
    )

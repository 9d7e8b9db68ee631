"""What a subscription to each topic yields, for type checkers and editors. Written by ``make topics``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

from chefbotd.client.subscription import SubscribeOptions, Subscription

if TYPE_CHECKING:
    from chefbotd.client import models as t
    from chefbotd.client.sync_subscription import SyncSubscription


class Topics(ABC):
    """``subscribe``, typed by the name of the topic."""

    @overload
    def subscribe(
        self, topics: Literal["odometry"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.OdometryData]: ...
    @overload
    def subscribe(
        self, topics: Literal["wheels"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.WheelsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["imu"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.ImuData]: ...
    @overload
    def subscribe(
        self, topics: Literal["ranges"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.RangesData]: ...
    @overload
    def subscribe(
        self, topics: Literal["battery"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.BatteryData]: ...
    @overload
    def subscribe(
        self, topics: Literal["link"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.LinkData]: ...
    @overload
    def subscribe(
        self, topics: Literal["safety"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.SafetyData]: ...
    @overload
    def subscribe(
        self, topics: Literal["reset"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.ResetData]: ...
    @overload
    def subscribe(
        self, topics: Literal["text"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.TextData]: ...
    @overload
    def subscribe(
        self, topics: Literal["raw"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.RawData]: ...
    @overload
    def subscribe(
        self, topics: Literal["stats"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.StatsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["sim"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.SimData]: ...
    @overload
    def subscribe(
        self, topics: Literal["scan"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.ScanData]: ...
    @overload
    def subscribe(
        self, topics: Literal["lidars"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.LidarsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["depth_cameras"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.DepthCamerasData]: ...
    @overload
    def subscribe(
        self, topics: Literal["worker"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.WorkerData]: ...
    @overload
    def subscribe(
        self, topics: Literal["localization"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.LocalizationData]: ...
    @overload
    def subscribe(
        self, topics: Literal["mapping"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.MappingData]: ...
    @overload
    def subscribe(
        self, topics: Literal["map"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.MapData]: ...
    @overload
    def subscribe(
        self, topics: Literal["map_pose"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.MapPoseData]: ...
    @overload
    def subscribe(
        self, topics: Literal["navigation"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.NavigationData]: ...
    @overload
    def subscribe(
        self, topics: Literal["path"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.PathData]: ...
    @overload
    def subscribe(
        self, topics: Literal["costmap"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.CostmapData]: ...
    @overload
    def subscribe(
        self, topics: Literal["obstacles"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.ObstaclesData]: ...
    @overload
    def subscribe(
        self, topics: Literal["recording"], **options: Unpack[SubscribeOptions]
    ) -> Subscription[t.RecordingData]: ...
    @overload
    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> Subscription[Any]: ...

    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> Subscription[Any]:
        """Events of one or several topics, first the latest value of each; see ``Subscription``.

        Subscriptions of one client to the same topic share it, and have the same rate and policy.

        Raises:
            SubscriptionConflict: on starting, when the topic is subscribed with another rate or policy.
        """
        return self._subscription(topics, **options)

    @abstractmethod
    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> Subscription[Any]: ...


class SyncTopics(ABC):
    """``subscribe``, typed by the name of the topic."""

    @overload
    def subscribe(
        self, topics: Literal["odometry"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.OdometryData]: ...
    @overload
    def subscribe(
        self, topics: Literal["wheels"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.WheelsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["imu"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.ImuData]: ...
    @overload
    def subscribe(
        self, topics: Literal["ranges"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.RangesData]: ...
    @overload
    def subscribe(
        self, topics: Literal["battery"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.BatteryData]: ...
    @overload
    def subscribe(
        self, topics: Literal["link"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.LinkData]: ...
    @overload
    def subscribe(
        self, topics: Literal["safety"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.SafetyData]: ...
    @overload
    def subscribe(
        self, topics: Literal["reset"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.ResetData]: ...
    @overload
    def subscribe(
        self, topics: Literal["text"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.TextData]: ...
    @overload
    def subscribe(
        self, topics: Literal["raw"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.RawData]: ...
    @overload
    def subscribe(
        self, topics: Literal["stats"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.StatsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["sim"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.SimData]: ...
    @overload
    def subscribe(
        self, topics: Literal["scan"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.ScanData]: ...
    @overload
    def subscribe(
        self, topics: Literal["lidars"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.LidarsData]: ...
    @overload
    def subscribe(
        self, topics: Literal["depth_cameras"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.DepthCamerasData]: ...
    @overload
    def subscribe(
        self, topics: Literal["worker"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.WorkerData]: ...
    @overload
    def subscribe(
        self, topics: Literal["localization"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.LocalizationData]: ...
    @overload
    def subscribe(
        self, topics: Literal["mapping"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.MappingData]: ...
    @overload
    def subscribe(
        self, topics: Literal["map"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.MapData]: ...
    @overload
    def subscribe(
        self, topics: Literal["map_pose"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.MapPoseData]: ...
    @overload
    def subscribe(
        self, topics: Literal["navigation"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.NavigationData]: ...
    @overload
    def subscribe(
        self, topics: Literal["path"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.PathData]: ...
    @overload
    def subscribe(
        self, topics: Literal["costmap"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.CostmapData]: ...
    @overload
    def subscribe(
        self, topics: Literal["obstacles"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.ObstaclesData]: ...
    @overload
    def subscribe(
        self, topics: Literal["recording"], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[t.RecordingData]: ...
    @overload
    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[Any]: ...

    def subscribe(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[Any]:
        """Events of one or several topics, first the latest value of each; see ``SyncSubscription``.

        Subscriptions of one client to the same topic share it, and have the same rate and policy.

        Raises:
            SubscriptionConflict: on starting, when the topic is subscribed with another rate or policy.
        """
        return self._subscription(topics, **options)

    @abstractmethod
    def _subscription(
        self, topics: str | Iterable[str], **options: Unpack[SubscribeOptions]
    ) -> SyncSubscription[Any]: ...

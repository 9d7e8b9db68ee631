"""Finds the classes of events by name, the core's and those of components, for readers of a recording."""

from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from typing import Any

import msgspec

from chefbotd.component_list import components_with_commands
from chefbotd.core import events as events_package
from chefbotd.core.geometry import ORIGIN, Pose2D
from chefbotd.core.sentence import plain_words


@cache
def event_names() -> frozenset[str]:
    """The name of every class of events."""
    return frozenset().union(*(_classes_in(module) for module in _modules()))


@cache
def class_of(name: str) -> type[Any] | None:
    """The class with this name; None where this version has none."""
    for module in _modules():
        event_class = _classes_in(module).get(name)
        if event_class is not None:
            return event_class
    return None


def _modules() -> Iterator[str]:
    """Those of the driving core's events, and the module ``events`` of each component that has one."""
    for module in iter_modules(events_package.__path__):
        yield f"{events_package.__name__}.{module.name}"
    for component in components_with_commands():
        events = f"chefbotd.components.{component.name}.events"
        if find_spec(events) is not None:
            yield events


def _classes_in(module_name: str) -> dict[str, type[Any]]:
    module = import_module(module_name)
    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type)
        and value.__module__ == module.__name__
        and "stamp_s" in getattr(value, "__struct_fields__", ())
    }


def decode(event_class: type[Any], data: bytes) -> Any:
    """An event from its JSON; raises ``ValueError`` for what is none."""
    if event_class.__name__ == "ScanMeasured":
        return _decode_scan(event_class, data)
    return msgspec.json.decode(data, type=event_class)


class _ScanData(msgspec.Struct):
    stamp_s: float
    bearing_rad: list[float | None]
    range_m: list[float | None]
    after_s: list[float | None]


class _ScanEvent(msgspec.Struct):
    stamp_s: float
    lidar: str
    base_from_lidar: Pose2D
    scan: _ScanData


def _decode_scan(event_class: type[Any], data: bytes) -> Any:
    import numpy as np

    from chefbotd.core.scan import LaserScan

    event = msgspec.json.decode(data, type=_ScanEvent)
    scan = event.scan
    arrays = [np.array(values, dtype=np.float64) for values in (scan.bearing_rad, scan.range_m, scan.after_s)]
    return event_class(event.stamp_s, event.lidar, event.base_from_lidar, LaserScan(scan.stamp_s, *arrays))


def encode(event: Any) -> bytes:
    """An event as JSON."""
    return encode_scan(event) if type(event).__name__ == "ScanMeasured" else encode_words(event)


encode_words = msgspec.json.Encoder(enc_hook=plain_words).encode
"""A record without arrays as JSON; of a sentence its English words alone, which is what a recording has."""


def encode_scan(event: Any) -> bytes:
    """A ``ScanMeasured`` as JSON: its arrays are numpy's."""
    scan, mount = event.scan, event.base_from_lidar
    return encode_words(
        {
            "stamp_s": event.stamp_s,
            "lidar": event.lidar,
            "base_from_lidar": ORIGIN if mount is None else mount,
            "scan": {
                "stamp_s": scan.stamp_s,
                "bearing_rad": scan.bearing_rad.tolist(),
                "range_m": scan.range_m.tolist(),
                "after_s": scan.after_s.tolist(),
            },
        }
    )

# SPDX-License-Identifier: Apache-2.0
"""Message classes and QoS profiles of the interface's topics and services, and a limit on the size of requests.

rclpy converts a whole request to Python objects before it calls the service. This blocks all other callbacks: for 12 s
with 200000 parameters. Therefore a request's class gets another conversion function here. It first asks the type
support of Fast DDS for the size of the received C structure, and returns an empty request if this is too large.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from gdfe_ros.node.interface import Delivery, TopicSpec
from gdfe_ros.recording.bag_info import Qos, TopicInfo


def qos_profile(delivery: Delivery) -> QoSProfile:
    """Return rclpy's QoS profile for a kind of delivery."""
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE if delivery.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if delivery.local else DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=delivery.depth,
    )


def interface_class(type_name: str) -> type[Any]:
    """Import a message or service class by its ROS name, ``package/msg/Name``."""
    package, kind, name = type_name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def subscribe(node: Node, spec: TopicSpec, callback: Callable[[Any], None], name: str = "", **options: Any) -> Any:
    """Subscribe to a topic with the type and quality of service in ``spec``; ``name``, if given, replaces its name."""
    profile = qos_profile(spec.delivery)
    return node.create_subscription(interface_class(spec.type), name or spec.name, callback, profile, **options)


def topic_info(spec: TopicSpec, name: str, role: str) -> TopicInfo:
    """Return the description of a topic for a bag: full name, type, quality of service, and name within the node."""
    return TopicInfo(name=name, type=spec.type, qos=Qos.from_rclpy(qos_profile(spec.delivery)), role=role)


def available(type_name: str) -> bool:
    """Return whether a ROS type, ``package/srv/Name``, is installed; a package's older versions may lack it."""
    package, kind, name = type_name.split("/")
    return is_installed(type_name) and hasattr(import_module(f"{package}.{kind}"), name)


def is_installed(type_name: str) -> bool:
    """Return whether the package of a ROS type, ``package/msg/Name``, is installed.

    A folder of that name, e.g. the package's sources in the working directory, does not count, although Python can
    import it.
    """
    package, kind, _ = type_name.split("/")
    try:
        spec = find_spec(f"{package}.{kind}")
    except ModuleNotFoundError:
        return False
    return spec is not None and spec.origin is not None


LARGEST = 2_000_000
"""Largest size of a request [bytes, serialised]; rclpy needs up to two seconds to read one of this size."""
_PYTHON = ctypes.pythonapi
_PYTHON.PyCapsule_New.restype = ctypes.py_object
_PYTHON.PyCapsule_New.argtypes = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
_PYTHON.PyCapsule_GetPointer.restype = ctypes.c_void_p
_PYTHON.PyCapsule_GetPointer.argtypes = ctypes.py_object, ctypes.c_char_p
_PYTHON.PyCapsule_GetName.restype = ctypes.c_char_p
_PYTHON.PyCapsule_GetName.argtypes = (ctypes.py_object,)
_CONVERSION = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)


@cache
def bound_request(kind: type) -> type:
    """Return a class for rclpy in place of the request class ``kind``; it limits the size of requests (see the module).

    Requests within the limit are instances of ``kind``. A request that was too large is an empty instance of a
    subclass; its attribute ``unread`` is the request's size [bytes].

    Raises:
        OSError, AttributeError, ValueError: the type support of Fast DDS is not installed for this package.
    """
    package, folder, _ = kind.__module__.split(".")
    library = ctypes.CDLL(f"lib{package}__rosidl_typesupport_fastrtps_c.so")
    size = library[f"get_serialized_size_{package}__{folder}__{kind.__name__}"]
    size.restype, size.argtypes = ctypes.c_size_t, (ctypes.c_void_p, ctypes.c_size_t)
    capsule = type(kind)._CONVERT_TO_PY
    convert = _CONVERSION(_PYTHON.PyCapsule_GetPointer(capsule, _PYTHON.PyCapsule_GetName(capsule)))
    unread = type("Unread", (kind,), {"__doc__": "A request that was too large, without its content."})

    def read(address: int) -> Any:
        if (count := size(address, 0)) <= LARGEST:
            return convert(address)
        request = unread()
        request.unread = count
        return request

    callback = _CONVERSION(read)
    address = ctypes.cast(callback, ctypes.c_void_p)
    # rclpy finds the conversion in the class of the class; the callback must exist as long as it.
    meta = type("Meta", (type(kind),), {"_CONVERT_TO_PY": _PYTHON.PyCapsule_New(address, None, None), "kept": callback})
    return meta("Bounded", (kind,), {})


def bound_service(kind: type, warn: Callable[[str], object]) -> Any:
    """Return the type ``kind`` of a service with a bounded request, for the attribute ``srv_type`` of a service.

    The service must exist already, because its creation loads the type support. Without the type support of Fast DDS,
    return ``kind``, and call ``warn`` with the reason.
    """
    try:
        return SimpleNamespace(Request=bound_request(kind.Request), Response=kind.Response)
    except (OSError, AttributeError, ValueError) as error:
        warn(f"requests of {kind.__name__} of any size are read: {error}")
        return kind


def bound_action(kind: type, warn: Callable[[str], object]) -> type:
    """Return the type ``kind`` of an action with bounded goals, as `bound_service` does."""
    services = type("Impl", (kind.Impl,), {"SendGoalService": bound_service(kind.Impl.SendGoalService, warn)})
    return type("Bounded", (kind,), {"Impl": services})


def unread_size(request: Any) -> int:
    """Return the size [bytes] of a request that was too large; 0 for any other."""
    return getattr(request, "unread", 0)

# SPDX-License-Identifier: BSD-3-Clause
"""Types of ROS 2 for Cyclone DDS, made of the definitions that rosbags has."""

from __future__ import annotations

import dataclasses
import types
from functools import lru_cache
from typing import Any

from cyclonedds import idl
from cyclonedds.idl import types as dds

from orbslam2py.ros.types import dds_name, type_store

_PLAIN: dict[str, Any] = {
    "bool": bool,
    "string": str,
    "byte": dds.uint8,
    "octet": dds.uint8,
    "char": dds.uint8,
    **{name: getattr(dds, name) for name in ("float32", "float64", "int8", "uint8", "int16")},
    **{name: getattr(dds, name) for name in ("uint16", "int32", "uint32", "int64", "uint64")},
}
#: What rmw_cyclonedds writes before each request and response: the client, and the number of its
#: request.
_REQUEST_HEAD: dict[str, Any] = {"client_guid": dds.uint64, "sequence_number": dds.int64}


@lru_cache(maxsize=64)
def struct_of(kind: str, *, is_request: bool = False) -> Any:
    """Make the type of a message for Cyclone DDS.

    Its content is never made or read through it, since numbers of an array would become a list of
    Python objects each: only its name and its definition go to other participants.

    Parameters
    ----------
    kind
        Type of the message, such as ``sensor_msgs/msg/Image``.
    is_request
        Whether it is a request or response, with the head that rmw_cyclonedds writes before it.
    """
    _, fields = type_store().fielddefs[kind]
    members = dict(_REQUEST_HEAD) if is_request else {}
    members.update((name, _member(described)) for name, described in fields)
    if not members:
        members["structure_needs_at_least_one_member"] = dds.uint8

    def fill(namespace: dict[str, Any]) -> None:
        namespace.update(__annotations__=members, __module__=__name__)

    made = types.new_class(
        kind.rpartition("/")[2] + "_",
        (idl.IdlStruct,),
        {"typename": dds_name(kind).replace("::", ".")},
        fill,
    )
    return dataclasses.dataclass(made)


def _member(described: Any) -> Any:
    """Make the type of a field of what rosbags says about it."""
    how, what = described
    if how.name == "BASE":
        return _PLAIN[what[0]]
    if how.name == "NAME":
        return struct_of(what)
    element, count = what
    if how.name == "ARRAY":
        return dds.array[_member(element), count]  # type: ignore[misc]
    of = _member(element)
    return dds.sequence[of, count] if count else dds.sequence[of]  # type: ignore[misc]

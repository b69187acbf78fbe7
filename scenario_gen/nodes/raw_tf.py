# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""tf2_msgs/msg/TFMessage where tf2_msgs is not installed: it is not among the Jazzy wheels.

Raw bytes are published and heard without any function of a type; what rcl and Fast DDS ask for is the type's name, its hash and
its description. They are put together here, of what the wheels have: geometry_msgs/msg/TransformStamped with one structure more.
So the topic is of the same type, with the same hash, as that of every other node. The structures are those of Jazzy's headers.
Messages of this class cannot be made or read: only raw publishers and subscriptions work.
"""

import ctypes
from functools import cache
from typing import Any, ClassVar

from geometry_msgs.msg import TransformStamped
from rclpy.utilities import get_rmw_implementation_identifier

from scenario_gen.bags.types import definition
from scenario_gen.errors import InputError

KIND = "tf2_msgs/msg/TFMessage"
PART = "geometry_msgs/msg/TransformStamped"
RMW = "rmw_fastrtps_cpp"
FAST, INTROSPECTION = b"rosidl_typesupport_fastrtps_c", b"rosidl_typesupport_introspection_c"  # Fast DDS asks for both
SEQUENCE = 145  # FieldType.FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE
MESSAGE = 18  # rosidl_typesupport_introspection_c__ROS_TYPE_MESSAGE

_Pointer, _Size = ctypes.c_void_p, ctypes.c_size_t


class _Text(ctypes.Structure):
    """`rosidl_runtime_c__String`."""

    _fields_ = (("data", ctypes.c_char_p), ("size", _Size), ("capacity", _Size))


class _Sequence(ctypes.Structure):
    """A sequence of anything."""

    _fields_ = (("data", _Pointer), ("size", _Size), ("capacity", _Size))


class _Field(ctypes.Structure):
    """`Field` of a type description, its `FieldType` written out."""

    _fields_ = (
        ("name", _Text),
        ("type_id", ctypes.c_uint8),
        ("type_capacity", ctypes.c_uint64),
        ("string_capacity", ctypes.c_uint64),
        ("nested_type_name", _Text),
        ("default_value", _Text),
    )


class _Own(ctypes.Structure):
    """`IndividualTypeDescription`."""

    _fields_ = (("type_name", _Text), ("fields", _Sequence))


class _Description(ctypes.Structure):
    """`TypeDescription`."""

    _fields_ = (("own", _Own), ("referenced", _Sequence))


class _Source(ctypes.Structure):
    """`TypeSource`."""

    _fields_ = (("type_name", _Text), ("encoding", _Text), ("contents", _Text))


class _Hash(ctypes.Structure):
    """`rosidl_type_hash_t`."""

    _fields_ = (("version", ctypes.c_uint8), ("value", ctypes.c_uint8 * 32))


class _Callbacks(ctypes.Structure):
    """`message_type_support_callbacks_t` of Fast DDS; the functions are another type's: only the greatest size is asked for."""

    _fields_ = (("namespace", ctypes.c_char_p), ("name", ctypes.c_char_p), ("functions", _Pointer * 5))


class _Member(ctypes.Structure):
    """`rosidl_typesupport_introspection_c__MessageMember`."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("type_id", ctypes.c_uint8),
        ("string_upper_bound", _Size),
        ("members", _Pointer),
        ("is_key", ctypes.c_bool),
        ("is_array", ctypes.c_bool),
        ("array_size", _Size),
        ("is_upper_bound", ctypes.c_bool),
        ("offset", ctypes.c_uint32),
        ("default_value", _Pointer),
        ("functions", _Pointer * 6),
    )


class _Members(ctypes.Structure):
    """`rosidl_typesupport_introspection_c__MessageMembers`."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("count", ctypes.c_uint32),
        ("size", _Size),
        ("has_key", ctypes.c_bool),
        ("members", ctypes.POINTER(_Member)),
        ("functions", _Pointer * 2),
    )


_Find = ctypes.CFUNCTYPE(_Pointer, _Pointer, ctypes.c_char_p)
_Get = ctypes.CFUNCTYPE(_Pointer, _Pointer)


class _Support(ctypes.Structure):
    """`rosidl_message_type_support_t`."""

    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", _Pointer),
        ("find", _Pointer),
        ("hash", _Pointer),
        ("description", _Pointer),
        ("sources", _Pointer),
    )


def _text(text: str) -> _Text:
    data = text.encode()
    return _Text(data, len(data), len(data) + 1)


def _sequence(kind: Any, items: list[Any], kept: list[Any]) -> _Sequence:
    kept.append((kind * len(items))(*items))
    return _Sequence(ctypes.addressof(kept[-1]), len(items), len(items))


def _donor() -> _Support:
    """The type support of TransformStamped."""
    TransformStamped.__class__.__import_type_support__()
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = _Pointer, (ctypes.py_object, ctypes.c_char_p)
    return _Support.from_address(pointer(TransformStamped.__class__._TYPE_SUPPORT, None))


def _description(donor: _Support, kept: list[Any]) -> _Description:
    part = _Description.from_address(_Get(donor.description)(ctypes.addressof(donor)))
    others = list((_Own * part.referenced.size).from_address(part.referenced.data))
    referenced = sorted([*others, part.own], key=lambda own: bytes(own.type_name.data))
    field = _Field(_text("transforms"), SEQUENCE, 0, 0, _text(PART), _text(""))
    own = _Own(_text(KIND), _sequence(_Field, [field], kept))
    return _Description(own, _sequence(_Own, referenced, kept))


def _sources(donor: _Support, kept: list[Any]) -> _Sequence:
    parts = _Sequence.from_address(_Get(donor.sources)(ctypes.addressof(donor)))
    others = list((_Source * parts.size).from_address(parts.data))
    text = definition(KIND)[0].partition("=" * 8)[0]
    return _sequence(_Source, [_Source(_text(KIND), _text("msg"), _text(text)), *others], kept)


def _getter(told: ctypes.Structure) -> Any:
    return _Get(lambda _: ctypes.addressof(told))


@cache
def raw_tf_message() -> type:
    """Return a class for raw publishers and subscriptions of /tf and /tf_static.

    Raises:
        InputError: the middleware is another than Fast DDS.
    """
    if (rmw := get_rmw_implementation_identifier()) != RMW:
        raise InputError(f"message type {KIND} is not installed, and {rmw} asks for it; source the workspace that has tf2_msgs")
    donor = _donor()
    for_fast, for_introspection = (_Find(donor.find)(ctypes.addressof(donor), name) for name in (FAST, INTROSPECTION))
    callbacks = _Callbacks(
        b"tf2_msgs::msg", b"TFMessage", _Callbacks.from_address(_Support.from_address(for_fast).data).functions
    )
    member = _Member(b"transforms", MESSAGE, members=for_introspection, is_array=True)
    members = _Members(b"tf2_msgs__msg", b"TFMessage", 1, ctypes.sizeof(_Sequence), members=ctypes.pointer(member))
    kept: list[Any] = [callbacks, member, members]  # all that C points to; it lives as long as the process
    digest = _Hash(1, (ctypes.c_uint8 * 32)(*bytes.fromhex(definition(KIND)[1].removeprefix("RIHS01_"))))
    told = (digest, _description(donor, kept), _sources(donor, kept))
    getters = [_getter(one) for one in told]
    addresses = [ctypes.cast(getter, _Pointer).value for getter in getters]
    supports: dict[bytes, _Support] = {}
    find = _Find(lambda _, name: ctypes.addressof(supports[name]) if name in supports else None)
    for name, data in ((FAST, callbacks), (INTROSPECTION, members)):
        supports[name] = _Support(name, ctypes.addressof(data), ctypes.cast(find, _Pointer), *addresses)
    kept += [told, getters, find, supports]
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, (_Pointer, ctypes.c_char_p, _Pointer)

    class Kind(type):
        """As rclpy asks a message class for its type support."""

        _CREATE_ROS_MESSAGE = _CONVERT_FROM_PY = _CONVERT_TO_PY = _DESTROY_ROS_MESSAGE = ()
        _TYPE_SUPPORT = new(ctypes.addressof(supports[FAST]), None, None)
        _KEPT: ClassVar[list[Any]] = kept

    class TFMessage(metaclass=Kind):
        """Stands for tf2_msgs.msg.TFMessage."""

    return TFMessage

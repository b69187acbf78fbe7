# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""tf2_msgs/msg/TFMessage where tf2_msgs is not installed: it is not among the Jazzy wheels.

Raw bytes are published and received without any function of a type; what rcl and Fast DDS ask for is the type's name, its hash
and its description. They are put together here, of what the wheels have: geometry_msgs/msg/TransformStamped with one structure
more. So the topic is of the same type, with the same hash, as that of every other node. The structures are those of Jazzy's
headers.
Messages of this class cannot be made or read: only raw publishers and subscriptions work.
"""

import ctypes
from functools import cache
from typing import Any, ClassVar

from scenario_gen.bags.storage.definitions import definition

KIND = "tf2_msgs/msg/TFMessage"
PART = "geometry_msgs/msg/TransformStamped"
FAST, INTROSPECTION = b"rosidl_typesupport_fastrtps_c", b"rosidl_typesupport_introspection_c"  # Fast DDS asks for both
SEQUENCE = 145  # FieldType.FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE
MESSAGE = 18  # rosidl_typesupport_introspection_c__ROS_TYPE_MESSAGE

_Pointer, _Size = ctypes.c_void_p, ctypes.c_size_t


def _structure(**fields: Any) -> Any:
    """Return the ctypes class of a C structure; its fields in order."""
    return type("Structure", (ctypes.Structure,), {"_fields_": tuple(fields.items())})


_Find = ctypes.CFUNCTYPE(_Pointer, _Pointer, ctypes.c_char_p)
_Get = ctypes.CFUNCTYPE(_Pointer, _Pointer)

_Text = _structure(data=ctypes.c_char_p, size=_Size, capacity=_Size)  # rosidl_runtime_c__String
_Sequence = _structure(data=_Pointer, size=_Size, capacity=_Size)  # of anything
_Field = _structure(  # Field of a type description, its FieldType written out
    name=_Text,
    type_id=ctypes.c_uint8,
    type_capacity=ctypes.c_uint64,
    string_capacity=ctypes.c_uint64,
    nested_type_name=_Text,
    default_value=_Text,
)
_Own = _structure(type_name=_Text, fields=_Sequence)  # IndividualTypeDescription
_Description = _structure(own=_Own, referenced=_Sequence)  # TypeDescription
_Source = _structure(type_name=_Text, encoding=_Text, contents=_Text)  # TypeSource
_Hash = _structure(version=ctypes.c_uint8, value=ctypes.c_uint8 * 32)  # rosidl_type_hash_t
# message_type_support_callbacks_t of Fast DDS; the functions are another type's: only the greatest size is asked for
_Callbacks = _structure(namespace=ctypes.c_char_p, name=ctypes.c_char_p, functions=_Pointer * 5)
_Member = _structure(  # rosidl_typesupport_introspection_c__MessageMember
    name=ctypes.c_char_p,
    type_id=ctypes.c_uint8,
    string_upper_bound=_Size,
    members=_Pointer,
    is_key=ctypes.c_bool,
    is_array=ctypes.c_bool,
    array_size=_Size,
    is_upper_bound=ctypes.c_bool,
    offset=ctypes.c_uint32,
    default_value=_Pointer,
    functions=_Pointer * 6,
)
_Members = _structure(  # rosidl_typesupport_introspection_c__MessageMembers
    namespace=ctypes.c_char_p,
    name=ctypes.c_char_p,
    count=ctypes.c_uint32,
    size=_Size,
    has_key=ctypes.c_bool,
    members=ctypes.POINTER(_Member),
    functions=_Pointer * 2,
)
_Support = _structure(  # rosidl_message_type_support_t
    identifier=ctypes.c_char_p, data=_Pointer, find=_Pointer, hash=_Pointer, description=_Pointer, sources=_Pointer
)


def _text(text: str) -> Any:
    data = text.encode()
    return _Text(data, len(data), len(data) + 1)


def _sequence(kind: Any, items: list[Any], kept: list[Any]) -> Any:
    kept.append((kind * len(items))(*items))
    return _Sequence(ctypes.addressof(kept[-1]), len(items), len(items))


def _type_support(message: Any) -> Any:
    """Return the type support of an installed message class."""
    message.__class__.__import_type_support__()
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = _Pointer, (ctypes.py_object, ctypes.c_char_p)
    return _Support.from_address(pointer(message.__class__._TYPE_SUPPORT, None))


def _description(donor: Any, kept: list[Any]) -> Any:
    part = _Description.from_address(_Get(donor.description)(ctypes.addressof(donor)))
    others = list((_Own * part.referenced.size).from_address(part.referenced.data))
    referenced = sorted([*others, part.own], key=lambda own: bytes(own.type_name.data))
    field = _Field(_text("transforms"), SEQUENCE, 0, 0, _text(PART), _text(""))
    own = _Own(_text(KIND), _sequence(_Field, [field], kept))
    return _Description(own, _sequence(_Own, referenced, kept))


def _sources(donor: Any, kept: list[Any]) -> Any:
    parts = _Sequence.from_address(_Get(donor.sources)(ctypes.addressof(donor)))
    others = list((_Source * parts.size).from_address(parts.data))
    text = definition(KIND)[0].partition("=" * 8)[0]
    return _sequence(_Source, [_Source(_text(KIND), _text("msg"), _text(text)), *others], kept)


def _getter(answer: ctypes.Structure) -> Any:
    return _Get(lambda _: ctypes.addressof(answer))


@cache
def raw_tf_message(transform: Any) -> type:
    """Return a class for raw publishers and subscriptions of /tf and /tf_static, with Fast DDS.

    Args:
        transform: the class geometry_msgs.msg.TransformStamped, whose type support lends its parts.
    """
    donor = _type_support(transform)
    for_fast, for_introspection = (_Find(donor.find)(ctypes.addressof(donor), name) for name in (FAST, INTROSPECTION))
    callbacks = _Callbacks(
        b"tf2_msgs::msg", b"TFMessage", _Callbacks.from_address(_Support.from_address(for_fast).data).functions
    )
    member = _Member(b"transforms", MESSAGE, members=for_introspection, is_array=True)
    members = _Members(b"tf2_msgs__msg", b"TFMessage", 1, ctypes.sizeof(_Sequence), members=ctypes.pointer(member))
    kept: list[Any] = [callbacks, member, members]  # all that C points to; it lives as long as the process
    digest = _Hash(1, (ctypes.c_uint8 * 32)(*bytes.fromhex(definition(KIND)[1].removeprefix("RIHS01_"))))
    answers = (digest, _description(donor, kept), _sources(donor, kept))
    getters = [_getter(answer) for answer in answers]
    addresses = [ctypes.cast(getter, _Pointer).value for getter in getters]
    supports: dict[bytes, Any] = {}
    find = _Find(lambda _, name: ctypes.addressof(supports[name]) if name in supports else None)
    for name, data in ((FAST, callbacks), (INTROSPECTION, members)):
        supports[name] = _Support(name, ctypes.addressof(data), ctypes.cast(find, _Pointer), *addresses)
    kept += [answers, getters, find, supports]
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

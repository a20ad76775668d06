"""Foxglove's own classes, and how ours compare with them."""

import importlib


def shape(descriptor, seen):
    """A message's fields and those of what it holds, without the files in which they stand."""
    if descriptor.full_name in seen:
        return
    seen[descriptor.full_name] = [
        (
            field.number, field.name, field.type, field.is_repeated,
            field.message_type.full_name if field.message_type else None,
            [(value.name, value.number) for value in field.enum_type.values] if field.enum_type else None,
        )
        for field in descriptor.fields
    ]
    for field in descriptor.fields:
        if field.message_type:
            shape(field.message_type, seen)


def own(name):
    """Foxglove's own class."""
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)


def differs(content, theirs):
    """Whether two messages are described differently, field by field, with all that they hold."""
    mine, right = {}, {}
    shape(content.DESCRIPTOR, mine)
    shape(theirs.DESCRIPTOR, right)
    return mine != right

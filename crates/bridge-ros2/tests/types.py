"""Compares the bridge's types with those of the wheels: RIHS01 of each definition, and the CDR of a message of each.

    python types.py FILE      JSON: [{"name", "definition", "value", "cdr"}]
"""

import hashlib
import importlib
import json
import sys
from pathlib import Path

from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore

# The second witness, for a type that is built from a file of these tests.
BAGS = get_typestore(Stores.ROS2_JAZZY)
BUILT_HERE = {"tf2_msgs/msg/TFMessage"}


def rihs01(definition):
    """REP-2011, as rosidl_generator_type_description computes it: the order of the keys counts."""

    def ordered(one):
        kinds = ("type_id", "capacity", "string_capacity", "nested_type_name")
        fields = [
            {"name": field["name"], "type": {kind: field["type"][kind] for kind in kinds}} for field in one["fields"]]
        return {"type_name": one["type_name"], "fields": fields}

    definition = {
        "type_description": ordered(definition["type_description"]),
        "referenced_type_descriptions": [ordered(one) for one in definition["referenced_type_descriptions"]],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(definition, separators=(", ", ": ")).encode()).hexdigest()


def of_wheels(name):
    """The hash that the wheels' own description of a type says; nothing where they don't have it."""
    package, kind, base = name.split("/")
    base = base.removesuffix("_Request").removesuffix("_Response").split("_")[0]
    path = Path(sys.prefix) / "share" / package / kind / f"{base}.json"
    if not path.exists():
        return None
    hashes = {one["type_name"]: one["hash_string"] for one in json.loads(path.read_text())["type_hashes"]}
    return hashes[name]


def fill(message, value):
    """Sets a message's fields from plain values."""
    for field, kind in message.get_fields_and_field_types().items():
        given = value[field]
        now = getattr(message, field)
        if hasattr(now, "get_fields_and_field_types"):
            fill(now, given)
        elif kind == "octet":
            setattr(message, field, bytes([given]))
        elif kind.startswith("sequence<") and "/" in kind:
            package, base = kind[len("sequence<"):-1].split("/")
            items = [getattr(importlib.import_module(f"{package}.msg"), base)() for _ in given]
            for item, one in zip(items, given):
                fill(item, one)
            setattr(message, field, items)
        else:
            setattr(message, field, given)


def of_bags(name, value):
    """A message of rosbags' own, from plain values."""

    def of(kind, given):
        node, inner = kind
        if node.name == "NAME":
            return of_bags(inner, given)
        if node.name == "SEQUENCE" and inner[0][0].name == "NAME":
            return [of(inner[0], one) for one in given]
        return given

    return BAGS.types[name](*[of(kind, value[field]) for field, kind in BAGS.fielddefs[name][1]])


def main():
    compared, by_bags = 0, []
    for one in json.loads(Path(sys.argv[1]).read_text()):
        name = one["name"]
        expected = of_wheels(name)
        if name in BUILT_HERE:
            assert expected == BAGS.hash_rihs01(name), name
            cdr = bytes(BAGS.serialize_cdr(of_bags(name, one["value"]), name)).hex()
            assert cdr == one["cdr"], f"{name}:\n{one['cdr']}, expected\n{cdr}"
            by_bags.append(name)
        found = rihs01(one["definition"])
        assert found == expected, f"{name}: {found}, expected {expected}"
        package, kind, base = name.split("/")
        if kind == "srv":
            base, part = base.split("_")
            message = getattr(getattr(importlib.import_module(f"{package}.srv"), base), part)()
        else:
            message = getattr(importlib.import_module(f"{package}.{kind}"), base)()
        fields = message.get_fields_and_field_types()
        if fields:
            fill(message, one["value"])
        # As long as ROS 2's own, which may be filled up to four bytes, and read by it as the same message; what lies between
        # the fields is whatever was there.
        cdr = serialize_message(message)
        ours = bytes.fromhex(one["cdr"])
        assert len(cdr) in (len(ours), len(ours) + -len(ours) % 4), f"{name}:\n{ours.hex()}, expected\n{cdr.hex()}"
        assert deserialize_message(ours, type(message)) == message, f"{name}:\n{ours.hex()}, expected\n{cdr.hex()}"
        compared += 1
    print(json.dumps({"compared": compared, "by_bags": by_bags}))


if __name__ == "__main__":
    main()

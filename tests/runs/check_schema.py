"""check_schema.py SCHEMA FILE: whether a JSON file is what a schema says; exit code 1 names each place that is not.

What neupig's schemas use: type, properties, additionalProperties, required, items, enum.  A key that no property names is
a fault where objects are described, whatever the schema allows for later versions.
"""

import json
import sys

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float), "null": type(None)}


def faults(schema, value, path=""):
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if not any(isinstance(value, TYPES[kind]) and (kind == "boolean") == isinstance(value, bool) for kind in kinds):
        yield f"{path}: {type(value).__name__}, not {kinds}"
        return
    if "enum" in schema and value not in schema["enum"]:
        yield f"{path}: {value} is none of {schema['enum']}"
    if isinstance(value, dict):
        others = schema.get("additionalProperties")
        for key, item in value.items():
            inner = schema["properties"].get(key) or (others if isinstance(others, dict) else None)
            if inner:
                yield from faults(inner, item, f"{path}.{key}".lstrip("."))
            elif schema["properties"]:
                yield f"{path}.{key}: not in the schema".lstrip(".")
        yield from (f"{path}.{key}: missing".lstrip(".") for key in schema.get("required", []) if key not in value)
    for i, item in enumerate(value if isinstance(value, list) else []):
        yield from faults(schema["items"], item, f"{path}[{i}]")


found = list(faults(*(json.load(open(name)) for name in sys.argv[1:3])))
print("\n".join(found))
sys.exit(1 if found else 0)

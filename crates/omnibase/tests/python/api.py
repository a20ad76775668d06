"""A client made of the API's description alone: checks it, then drives the robot by it.

api.py ADDRESS TOKEN; prints one JSON object.
"""

import json
import sys
import time
import urllib.error
import urllib.request

import jsonschema
from openapi_spec_validator import validate

address, token = sys.argv[1:]


def ask(method, path, body=None):
    headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(f"http://{address}{path}", data, headers, method=method.upper())
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


_, description = ask("get", "/api/openapi.json")
validate(description)


def valid(schema, value):
    """Raises where a value isn't as described."""
    whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "components": description["components"]}
    jsonschema.Draft202012Validator(whole).validate(value)


def operation(path, method):
    return description["paths"][path][method]


def answered(path, method, status, value):
    valid(operation(path, method)["responses"][str(status)]["content"]["application/json"]["schema"], value)
    return value


def get(path):
    status, value = ask("get", path)
    return answered(path, "get", status, value)


def call(what, **arguments):
    body = {"do": what, "stamp": get("/api/now")["stamp"], **arguments}
    valid(operation("/api/call", "post")["requestBody"]["content"]["application/json"]["schema"], body)
    status, value = ask("post", "/api/call", body)
    return status, answered("/api/call", "post", status, value)


def until(what, condition):
    for _ in range(3000):
        now = get("/api/now")
        if condition(now):
            return now
        time.sleep(0.02)
    raise SystemExit(f"never: {what}: {now}")


# Everything that can be read is as described.
read = [path for path, methods in description["paths"].items() if "200" in methods.get("get", {}).get("responses", {})]
for path in read:
    get(path)

done = []
for what, arguments, then in [
    ("enable", {}, lambda now: now["phase"] == "holding"),
    ("load", {"reference": {"kind": "circle", "radius_m": 0.3, "duration_s": 6.0}}, lambda now: True),
    ("track", {}, lambda now: now["phase"] == "tracking" and now["values"]["state/pose_x_m"] > 0.05),
    ("stop", {"category": "category_1"}, lambda now: now["phase"] == "disabled"),
]:
    status, answer = call(what, **arguments)
    if status != 200 or not answer["done"]:
        raise SystemExit(f"{what}: {status} {answer}")
    until(what, then)
    done.append(what)

# What isn't described is refused, by the description and by the robot.
try:
    call("fly")
    raise SystemExit("the description allows anything")
except jsonschema.ValidationError:
    pass
status, answer = ask("post", "/api/call", {"do": "fly"})
answered("/api/call", "post", status, answer)

with urllib.request.urlopen(f"http://{address}/api", timeout=10) as answer:
    page = answer.read().decode()

calls = [one["properties"]["do"]["const"] for one in description["components"]["schemas"]["Call"]["oneOf"]]
print(json.dumps({"read": read, "done": done, "unknown": status, "calls": calls, "on_page": [one for one in calls if f'"{one}"' in page], "api": description["info"]["version"]}))

"""Looks with shapely at the plans that the example `plans` wrote: `python check_plans.py FILE` (pip install shapely)."""

import json
import math
import sys

from shapely import affinity
from shapely.geometry import Polygon, box
from shapely.ops import unary_union

plans = touched = looks = 0
for line in open(sys.argv[1]):
    plan = json.loads(line)
    room = box(0, 0, *plan["room"])
    blocked = unary_union([Polygon(block) for block in plan["blocks"]])
    outline = Polygon(plan["outline"])
    worst = 0.0
    for (x, y, heading), (x_to, y_to, heading_to) in zip(plan["poses"], plan["poses"][1:]):
        steps = max(1, math.ceil(max(math.hypot(x_to - x, y_to - y) / 0.01, abs(heading_to - heading) / 0.02)))
        for step in range(steps + 1):
            part = step / steps
            placed = affinity.rotate(outline, heading + part * (heading_to - heading), origin=(0, 0), use_radians=True)
            placed = affinity.translate(placed, x + part * (x_to - x), y + part * (y_to - y))
            worst = max(worst, placed.intersection(blocked).area, placed.difference(room).area)
            looks += 1
    plans += 1
    touched += worst > 1e-9
print(f"{plans} plans, {looks} looks, {touched} touch anything")

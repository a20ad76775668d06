"""Looks with shapely at the plans that the example `plans` wrote: `python check_plans.py FILE` (pip install numpy shapely).

Every plan is looked at in steps of 10 mm and 0.02 rad at most; the outline must neither touch a block nor leave the room.
"""

import json
import math
import sys

import numpy
import shapely


def placed(outline, poses):
    """The outline's corners at steps between poses: an array of looks, corners and two axes."""
    steps = [
        max(1, math.ceil(max(math.hypot(b[0] - a[0], b[1] - a[1]) / 0.01, abs(b[2] - a[2]) / 0.02)))
        for a, b in zip(poses, poses[1:])
    ]
    parts = [a + numpy.linspace(0, 1, count + 1)[:, None] * (b - a) for a, b, count in zip(poses, poses[1:], steps)]
    x, y, heading = numpy.concatenate(parts).T[:, :, None]
    sin, cos = numpy.sin(heading), numpy.cos(heading)
    return numpy.stack([x + cos * outline[:, 0] - sin * outline[:, 1], y + sin * outline[:, 0] + cos * outline[:, 1]], axis=2)


plans = touching = looks = 0
nearest_m = math.inf
for line in open(sys.argv[1]):
    scene = json.loads(line)
    blocked = shapely.union_all([shapely.Polygon(block) for block in scene["blocks"]])
    shapely.prepare(blocked)
    outline = numpy.array(scene["outline"])
    for poses in scene["plans"]:
        corners = placed(outline, numpy.array(poses))
        outlines = shapely.polygons(corners)
        is_outside = (corners < 0).any() or (corners > numpy.array(scene["room"])).any()
        touching += bool(is_outside or shapely.intersects(blocked, outlines).any())
        # How near it comes, of every hundredth: distances take longest.
        if plans % 100 == 0:
            nearest_m = min(nearest_m, shapely.distance(blocked, outlines).min())
        plans += 1
        looks += len(outlines)
print(f"{plans} plans, {looks} looks: {touching} touch anything; every hundredth keeps {1e3 * nearest_m:.1f} mm at least")

"""Compares distances in maps with scipy's. In the file a map is its width and height as u32, a byte a cell, then its distances as f64."""

import sys

import numpy as np
from scipy.ndimage import distance_transform_edt

data = open(sys.argv[1], "rb").read()
at = cells = differ = 0
while at < len(data):
    width, height = (int(side) for side in np.frombuffer(data, "<u4", 2, at))
    count, at = width * height, at + 8
    blocked = np.frombuffer(data, "u1", count, at).reshape(height, width)
    found = np.frombuffer(data, "<f8", count, at + count).reshape(height, width)
    at += 9 * count
    cells += count
    differ += int((distance_transform_edt(blocked == 0) != found).sum())
print(cells, differ)

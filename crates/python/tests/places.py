"""Where things are for these tests."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BMM = ROOT / "robots/bmm.toml"
MECANUM = ROOT / "robots/mecanum.toml"
PROGRAM = os.environ["OMNIBASE_PROGRAM"]
FOLDER = Path(os.environ["OMNIBASE_FOLDER"])
CIRCLE = {"kind": "circle", "radius_m": 0.3, "duration_s": 6.0}

"""The notebook runs from its first cell to its last."""

import json
import os
import unittest

import omnibase
from places import ROOT


class Notebook(unittest.TestCase):
    def test_every_cell_runs(self):
        file = ROOT / "crates/python/examples/robot.ipynb"
        cells = [cell for cell in json.loads(file.read_text())["cells"] if cell["cell_type"] == "code"]
        self.assertGreater(len(cells), 4)
        os.chdir(ROOT)
        names = {}
        for number, cell in enumerate(cells):
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)


class Types(unittest.TestCase):
    def test_the_stub_names_what_the_module_has(self):
        import ast
        from pathlib import Path

        from omnibase import _omnibase

        stub = ast.parse(Path(omnibase.__file__).with_name("_omnibase.pyi").read_text())
        told = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        there = {name for name in vars(_omnibase) if not name.startswith("__")}
        self.assertEqual(there, set(told))
        self.assertEqual(there, set(omnibase.__all__) - {"__version__"})
        for name in there:
            if isinstance(told[name], ast.FunctionDef) or issubclass(getattr(_omnibase, name), Exception):
                continue
            usual = {"__new__", "__init__", "__doc__", "__module__"}
            members = set(vars(getattr(_omnibase, name))) - usual
            self.assertEqual(members, {node.name for node in told[name].body if isinstance(node, ast.FunctionDef)} - usual, name)

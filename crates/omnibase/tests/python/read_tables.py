"""Reads the tables that `omnibase export` wrote with pandas, pyarrow and scipy, and compares their bits; prints JSON."""

import json
import os
import sys

import numpy
import pandas
import pyarrow.parquet
import scipy.io

csv_path, parquet_path, mat_path = sys.argv[1:]
csv = pandas.read_csv(csv_path, float_precision="round_trip")
parquet = pyarrow.parquet.read_table(parquet_path)
mat = scipy.io.loadmat(mat_path)


def bits(column):
    return numpy.ascontiguousarray(numpy.asarray(column, dtype="f8").ravel()).view("u8")


def differ(one, other):
    # A NaN in text has no bits of its own.
    one, other = numpy.asarray(one, dtype="f8").ravel(), numpy.asarray(other, dtype="f8").ravel()
    both_nan = numpy.isnan(one) & numpy.isnan(other)
    return len(one) != len(other) or bool(numpy.any((bits(one) != bits(other)) & ~both_nan))


names = list(csv.columns)
variables = [name for name in mat if not name.startswith("__")]
differing = [
    name
    for name in names
    if differ(csv[name], parquet.column(name)) or differ(csv[name], mat[name.replace(".", "_")])
]
print(
    json.dumps(
        {
            "rows": len(csv),
            "names": names,
            "parquet_names": parquet.column_names,
            "parquet_rows": parquet.num_rows,
            "variables": variables,
            "differing": differing,
            "pandas_parquet_rows": len(pandas.read_parquet(parquet_path)),
            "last_time_s": float(mat["time_s"][-1][0]),
            "x_m": float(csv["state.pose_x_m"].iloc[-1]),
        }
    )
)
# pyarrow aborts at times where the interpreter ends by itself (apache/arrow#34314).
sys.stdout.flush()
os._exit(0)

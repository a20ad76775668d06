"""What evo computes of the three files of `omnibase estimate --tum`: errors as JSON, by its own functions, as its programs call them."""

import json
import sys

from evo.core import metrics, sync
from evo.core.units import Unit
from evo.tools.file_interface import read_tum_trajectory_file


def rms(metric, *pair):
    metric.process_data(pair)
    return metric.get_statistic(metrics.StatisticsType.rmse)


def errors(folder, name):
    """As `evo_ape --align` and `evo_rpe --delta 1 --delta_unit m --all_pairs` do."""

    def pair():
        truth = read_tum_trajectory_file(f"{folder}/truth.tum")
        return sync.associate_trajectories(truth, read_tum_trajectory_file(f"{folder}/{name}.tum"), max_diff=0.01)

    truth, believed = pair()
    believed.align(truth)
    absolute_m = rms(metrics.APE(metrics.PoseRelation.translation_part), truth, believed)
    relative = [
        rms(metrics.RPE(relation, 1.0, Unit.meters, 0.1, True), *pair())
        for relation in (metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad)
    ]
    return {"poses": truth.num_poses, "absolute_m": absolute_m, "relative_m": relative[0], "relative_rad": relative[1]}


print(json.dumps({name: errors(sys.argv[1], name) for name in ("wheels", "fused")}))

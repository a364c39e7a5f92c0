"""All kinds of bad inputs."""

from support.bad import cityscapes, contracts, latencies, matrices, on_logs, own_models, predictions, yaml_files

KINDS = (
    *(yaml_files.YAML, matrices.MATRIX, matrices.ROW, matrices.STREAM, on_logs.KIND),
    *latencies.KINDS,
    *(own_models.MODEL, predictions.KIND, contracts.CONTRACT),
    *cityscapes.KINDS,
)

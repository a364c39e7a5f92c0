"""All kinds of bad inputs."""

from support.bad import (
    axes,
    bags,
    cityscapes,
    class_sets,
    commands,
    containers,
    contracts,
    drives,
    latencies,
    logs,
    matrices,
    networks,
    on_logs,
    own_models,
    predictions,
    results,
    surroundings,
    yaml_files,
)

KINDS = (
    *(yaml_files.YAML, matrices.MATRIX, matrices.ROW, axes.KIND, matrices.STREAM, class_sets.KIND),
    *on_logs.KINDS,
    *latencies.KINDS,
    *(own_models.MODEL, predictions.KIND, contracts.CONTRACT),
    *(*cityscapes.KINDS, *bags.KINDS, *drives.KINDS),
    *(logs.KIND, containers.KIND, networks.KIND, results.KIND, commands.KIND, surroundings.KIND),
)

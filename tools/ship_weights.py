"""Put the weights of a finished training into the package, in half precision: `ship_weights.py TRAINING [OUT]`.

TRAINING is a folder of a run's trainings, like `RUN/trainings/0123456789abcdef`.
"""

import sys
from pathlib import Path

import torch

import semgrid_eval
from semgrid_eval.models.checkpoint import WEIGHTS_FILE, load_weights, read_header
from semgrid_eval.models.checkpoint import save_weights as save
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import seeded_network
from semgrid_eval.models.residual import Residual
from semgrid_eval.models.shipped import WEIGHTS

LIMIT_BYTES = 2_500_000


def main() -> int:
    """Read, round and write the weights."""
    source = Path(sys.argv[1]) / WEIGHTS_FILE
    default = Path(semgrid_eval.__file__).parent / WEIGHTS
    target = Path(sys.argv[2]) if len(sys.argv) > 2 else default
    header = read_header(source)
    given = Given(**{**header["given"], "sensors": tuple(header["given"]["sensors"])})
    network = seeded_network(Residual, Residual.parse_settings(header["settings"]), given, seed=0)
    load_weights(network, source)
    save(network, target, dtype=torch.float16, training=Path(sys.argv[1]).name)
    size = target.stat().st_size
    sys.stdout.write(f"{target}: {size} bytes\n")
    return int(size > LIMIT_BYTES)


if __name__ == "__main__":
    sys.exit(main())

"""All kinds of bad inputs."""

from support.bad import matrices

KINDS = (matrices.MATRIX, matrices.ROW, matrices.STREAM)

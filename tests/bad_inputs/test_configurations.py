from support.bad import axes, class_sets, contracts, matrices, yaml_files
from support.bad.checked import cases, ends_in_its_line


@cases(matrices.MATRIX, matrices.ROW, matrices.STREAM, axes.KIND, class_sets.KIND, yaml_files.YAML, contracts.CONTRACT)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

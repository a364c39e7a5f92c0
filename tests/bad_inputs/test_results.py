from support.bad import results
from support.bad.checked import cases, ends_in_its_line


@cases(results.KIND)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

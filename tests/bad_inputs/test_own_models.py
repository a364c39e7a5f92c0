from support.bad import own_models
from support.bad.checked import cases, ends_in_its_line


@cases(own_models.MODEL)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

from support.bad import commands, surroundings
from support.bad.checked import cases, ends_in_its_line


@cases(commands.KIND, surroundings.KIND)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

from support.bad import bags, cityscapes, containers, drives, logs, networks
from support.bad.checked import cases, ends_in_its_line


@cases(*cityscapes.KINDS, *bags.KINDS, *drives.KINDS, logs.KIND, containers.KIND, networks.KIND)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

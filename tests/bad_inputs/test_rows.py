from support.bad import latencies, on_logs, predictions
from support.bad.checked import cases, ends_in_its_line


@cases(*on_logs.KINDS, *latencies.KINDS, predictions.KIND)
def test_a_bad_input_ends_in_its_line(kind, bad):
    ends_in_its_line(kind, bad)

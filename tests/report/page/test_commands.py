import shlex

import pytest

from semgrid_eval.report.page.provenance import play_command, row_command


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("semgrid-eval run paper --logs L --out R", "semgrid-eval run paper --logs L --out R --row ED-DC"),
        ("semgrid-eval run paper --row BL-DC --logs L --out R", "semgrid-eval run paper --logs L --out R --row ED-DC"),
        ("semgrid-eval run paper --row=a --row b --logs L", "semgrid-eval run paper --logs L --row ED-DC"),
        ("semgrid-eval run paper --row --row --logs L", "semgrid-eval run paper --logs L --row ED-DC"),
        ("semgrid-eval run 'my matrix.yaml' --logs L", "semgrid-eval run 'my matrix.yaml' --logs L --row ED-DC"),
        ("semgrid-eval demo", "semgrid-eval run matrix.yaml --logs LOGS --out RUN --row ED-DC"),
        ("semgrid-eval run 'unclosed", "semgrid-eval run matrix.yaml --logs LOGS --out RUN --row ED-DC"),
    ],
)
def test_a_rows_command_is_the_runs_own_narrowed_to_it(command, expected):
    assert row_command(command, "ED-DC", "matrix.yaml") == expected


def test_a_shell_reads_a_name_as_one_word():
    name = 'it\'s $HOME; rm -rf "x" `y`\n'
    assert shlex.split(row_command("semgrid-eval run paper --logs L", name, "matrix.yaml"))[-2:] == ["--row", name]


@pytest.mark.parametrize(
    ("command", "where"),
    [
        ("semgrid-eval run m --logs logs --out runs/first", ["runs/first", "logs"]),
        ("semgrid-eval run m --logs='my logs' --out 'a b' --row ED", ["a b", "my logs"]),
        ("semgrid-eval run m --logs town --validation-logs real --out run", ["run", "real"]),
        ("semgrid-eval demo --out demo", ["RUN", "LOGS"]),
        ("semgrid-eval run 'unfinished", ["RUN", "LOGS"]),
        ("", ["RUN", "LOGS"]),
    ],
)
def test_a_window_is_played_from_the_folders_of_the_runs_own_command(command, where):
    words = shlex.split(play_command(command, "own-DC", "it's $HOME #2"))
    expected = [where[0], "own-DC", "--logs", where[1], "--recording", "it's $HOME #2", "--out", "play.mcap"]
    assert words == ["semgrid-eval", "play", *expected]

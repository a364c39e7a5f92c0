"""What no YAML file may be, whatever it is for; and files that can be no file of ours at all."""

from support.bad.case import Kind, table
from support.bad.matrices import RUN, whole

BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n"
CONTENTS = {
    "an alias": b"a: &here 1\nb: *here\n",
    "aliases that multiply": BOMB.encode(),
    "a tag": b"seed: !!int '3'\n",
    "a tag that calls a function": b"a: !!python/object/apply:os.system [ls]\n",
    "a control character": b"ab \x07",
    "bytes that are not UTF-8": b"a: \xff\n",
    "a list that does not end": b"rows:\n- [a, b\n",
    "a mapping that does not end": b"rows: {a: 1\n",
    "a quote that does not end": b"title: 'a\n",
    "two values side by side": b"title: 'a' 'b'\n",
    "an indentation that fits nowhere": b"rows:\n  - name: a\n model: ed\n",
    "a tab as indentation": b"rows:\n\t- name: a\n",
    "3,000 lists in each other": b"[" * 3000,
    "a number of 5,000 digits": b"seed: " + b"9" * 5000 + b"\n",
    "a number with a leading 0": b"title: a\nseed: 010\n",
    "a key that is a number": b"2019: a\n",
    "a key that is null": b"null: a\n",
    "a key that is a list": b"? [a, b]\n: 3\n",
    "a key that is true": b"true: 3\n",
    "a key twice": b"seed: 1\ntitle: a\nseed: 2\n",
    "a key twice, in one line": b"a: {b: 1, b: 2}\n",
    "a key twice, once in quotes": b"a:\n  b: 1\n  'b': 2\n",
    "two documents": b"title: a\n---\ntitle: b\n",
    "nothing": b"",
    "more than 1 MiB": b"# " + b"x" * (1 << 20) + b"\n",
}
YAML = Kind("YAML", "What no YAML file may hold; here a matrix `bad.yaml`.", whole, table(RUN, "bad.yaml", CONTENTS))

import os
import time
from pathlib import Path

import pytest

from semgrid_eval.apart import Apart, ApartError
from semgrid_eval.workplace import Limits

MODULE = "support.answers"


@pytest.fixture
def guest():
    apart = Apart(MODULE, Limits(memory_bytes=1 << 30))
    yield apart
    apart.close()


def has_ended(pid):
    """Wait until a process is gone, or only its parent has not noticed."""
    for _ in range(3000):
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.01)
    return False


def test_questions_are_answered_one_after_the_other(guest):
    assert guest.ask(("echo", {"a": 1})) == ({"a": 1}, b"")
    content = os.urandom(5 << 20)
    assert guest.ask(("echo", content), limit_bytes=len(content)) == (len(content), content)
    assert guest.is_alive


def test_more_bytes_than_were_asked_for_end_it(guest):
    with pytest.raises(ApartError, match="sent what is not an answer"):
        guest.ask(("echo", bytes(17)), limit_bytes=16)
    assert not guest.is_alive


def test_what_is_not_an_answer_ends_it(guest):
    with pytest.raises(ApartError, match="sent what is not an answer"):
        guest.ask(("break_off", None))


def test_an_end_is_told_with_its_code(guest):
    with pytest.raises(ApartError, match="ended its process with exit code 9"):
        guest.ask(("leave", 9))
    assert not guest.is_alive


def test_what_gives_no_sign_is_ended():
    guest = Apart(MODULE, Limits(time_s=1))
    with pytest.raises(ApartError, match=r"gave no sign for 1 s and was ended \(--time-limit\)"):
        guest.ask(("wait", None))
    assert not guest.is_alive


def test_what_it_has_started_ends_with_it_though_it_holds_the_connection(guest, tmp_path):
    with pytest.raises(ApartError, match="ended its process with exit code 5"):
        guest.ask(("start_another", tmp_path / "pid"))
    assert has_ended(int((tmp_path / "pid").read_text()))


def test_memory_is_limited(guest):
    assert guest.ask(("swell", 1 << 20))[0] == 1 << 20
    assert guest.ask(("swell", 2 << 30))[0] == "no room"


def test_an_interrupted_question_ends_it(guest):
    def interrupt(_said):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        guest.ask(("wait", None), hear=interrupt)
    assert not guest.is_alive


def test_it_ends_with_the_process_that_asked(tmp_path):
    read, write = os.pipe()
    asking = os.fork()
    if asking == 0:
        guest = Apart(MODULE, Limits())
        os.write(write, str(guest._process.pid).encode())
        guest.ask(("wait", None), hear=lambda _said: os._exit(0))
    os.waitpid(asking, 0)
    assert has_ended(int(os.read(read, 16)))
    os.close(read)
    os.close(write)

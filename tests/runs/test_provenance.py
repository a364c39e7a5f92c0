import shutil
import subprocess

import pytest

from semgrid_eval.runs.record import commit_of, versions

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")


def git(folder, *arguments):
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
    done = subprocess.run(["git", "-C", folder, *identity, *arguments], check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "a")
    git(tmp_path, "tag", "-a", "v1", "-m", "v1")
    return tmp_path


def test_a_checkout_tells_its_commit(checkout):
    assert commit_of(checkout / "package") == git(checkout, "rev-parse", "HEAD")


def test_a_changed_checkout_says_so(checkout):
    (checkout / "package" / "__init__.py").write_text("x = 1")
    assert commit_of(checkout / "package") == git(checkout, "rev-parse", "HEAD") + "-dirty"


def test_a_package_that_another_checkout_does_not_track_has_no_commit(checkout, tmp_path_factory):
    installed = checkout / ".venv" / "package"
    installed.mkdir(parents=True)
    (installed / "__init__.py").write_text("")
    assert commit_of(installed) is None
    assert commit_of(tmp_path_factory.mktemp("elsewhere")) is None


def test_versions_name_what_numbers_depend_on():
    assert {"semgrid-eval", "python", "torch", "numpy", "numba"} <= set(versions())

"""What tests of runs share: small logs, and models of one's own that run in the test's own process."""

import pytest
from support.small_runs import write_logs

from semgrid_eval.models.registry import own_models


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return write_logs(tmp_path_factory.mktemp("logs"))


@pytest.fixture
def own_models_here():
    """Models run in this process, which is quicker; `test_own_models_apart` has what is different in another."""
    with own_models(None):
        yield

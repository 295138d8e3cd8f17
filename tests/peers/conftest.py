"""Comparisons with other programs give rows to the validation page, as the physics tests do."""

import pytest

from tests.physics.conftest import ROWS, keep_rows, validation

__all__ = ["validation"]


def pytest_configure(config):
    config.stash.setdefault(ROWS, [])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    keep_rows(item, report, "tests/peers")
    return report

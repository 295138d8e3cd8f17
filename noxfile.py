#!/usr/bin/env -S uv run --script
# /// script
# requires-python = ">=3.11"
# dependencies = ["nox>=2025.2.9"]
# ///
"""The checks of the Makefile for machines without make, such as Windows: ``pipx run nox -s lint`` and ``-s tests``.

Words after ``--`` go to pytest: ``pipx run nox -s tests -- tests/test_units.py``.
"""

import nox

nox.needs_version = ">=2025.2.9"
nox.options.default_venv_backend = "uv|virtualenv"
nox.options.reuse_existing_virtualenvs = True


def install(session: nox.Session) -> None:
    """Install the package and what tests it, at the versions and hashes in constraints.txt."""
    options = ["--constraint", "constraints.txt"]
    if (
        session.venv_backend != "uv"
    ):  # uv checks the hashes that there are; pip has to be told that the project has none
        session.run("python", "-m", "pip", "install", "--quiet", "--upgrade", "pip>=26.2")
        options.append("--no-require-hashes")
    session.install(*options, "-e", ".", "--group", "test")


@nox.session(default=True)
def lint(session: nox.Session) -> None:
    """Run the checks that need no tests, as `make lint` does."""
    install(session)
    session.run("ruff", "format", "--check", ".")
    session.run("ruff", "check", ".")
    session.run("lint-imports", "--no-logo")
    session.run("mypy")


@nox.session(default=True)
def tests(session: nox.Session) -> None:
    """Run the tests; the arguments choose some."""
    install(session)
    session.run("python", "-m", "pytest", "-q", *session.posargs)


if __name__ == "__main__":
    nox.main()

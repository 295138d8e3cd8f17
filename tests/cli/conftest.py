"""What tests of commands share: a small scenario as a file, and the command line run in this process."""

import shutil

import pytest
import typer
from typer.testing import CliRunner

import rso_lidar as rl
from rso_lidar.cli import main


@pytest.fixture
def bench(text, tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def recorded_once(text, tmp_path_factory):
    """Record the bench from nearby with the fast detector, once for all tests, and return the file."""
    path = tmp_path_factory.mktemp("recorded") / "bench.h5"
    near = text.replace("[1000, 0, 0]", "[200, 0, 0]") + '\n[lidar.detector]\ntype = "empirical"\n'
    rl.save(path, rl.simulate(rl.Scenario.loads(near)))
    return path


@pytest.fixture
def recorded(recorded_once, tmp_path):
    """Return a copy of that recording, which the test may change."""
    return shutil.copyfile(recorded_once, tmp_path / "bench.h5")


@pytest.fixture
def rso_lidar(capsys):
    """Return a function that runs the command line and gives status, standard output and the lines of standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        # Whichever test comes first in a new installation waits for numba, and is told so.
        errors = [line for line in printed.err.splitlines() if not line.startswith("compiling ")]
        return left.value.code or 0, printed.out, errors

    return run


@pytest.fixture
def refused(call, bench, tmp_path, monkeypatch):
    """Return a function that sees a module's `call` of `bench` refused: one line, status 2, and nothing written."""

    def see(arguments, said):
        monkeypatch.chdir(tmp_path)
        before = sorted(tmp_path.iterdir())
        status, printed, errors = call(bench, *arguments)
        assert (status, printed, len(errors)) == (2, "", 1)
        assert said in errors[0]
        assert sorted(tmp_path.iterdir()) == before

    return see


@pytest.fixture
def alone():
    """Return a function that makes a runner of one command's function, which gives its output or raises its error."""

    def runner(command):
        app = typer.Typer()
        app.command()(command)

        def run(*arguments):
            done = CliRunner().invoke(app, [str(argument) for argument in arguments])
            if done.exception is not None and not isinstance(done.exception, SystemExit):
                raise done.exception
            assert done.exit_code == 0, done.output
            return done.output

        return run

    return runner

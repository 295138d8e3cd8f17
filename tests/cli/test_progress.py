"""Progress says a rate once there is work to measure, without the first step, and the studio reads its lines."""

import pytest

from rso_lidar.cli import progress
from rso_lidar.studio import job_queue


class Clock:
    """A clock that a test sets."""

    now_s = 100.0

    def monotonic(self):
        return self.now_s


@pytest.fixture
def lines(monkeypatch):
    """Return a function that counts steps, each of given seconds, and returns the lines of progress."""
    clock, said = Clock(), []
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress, "echo", lambda line, err: said.append(line))
    monkeypatch.setattr(progress.sys, "stderr", None)

    def count(steps_s, total=None, done=0):
        said.clear()
        with progress.show_progress(total or len(steps_s), done, "trading", "run") as bar:
            for step_s in steps_s:
                clock.now_s += step_s
                bar.advance()
        return list(said)

    return count


def test_no_rate_is_said_of_less_than_a_second(lines):
    assert lines([3e-6] * 200) == ["run 200/200"]
    assert lines([30.0]) == ["run 1/1"]  # one step: compilation and work cannot be told apart
    assert lines([0.0] * 5) == ["run 5/5"]


def test_the_first_step_is_not_in_the_rate_and_the_last_line_has_no_time_left(lines):
    # 20 s of compilation, then 4 steps a second: by the first count over all time it would be 1.6 a second
    said = lines([20.0] + [0.25] * 48)
    assert said[0] == "run 5/49, 4 runs/s, 11 s left"
    assert said[-1] == "run 49/49, 4 runs/s"
    slow = ["run 15/20, 3.33 runs/s, 2 s left", "run 16/20, 0.694 runs/s, 6 s left"]  # 4 in 1.2 s, 5 in 7.2 s
    assert lines([20.0, 0.3, 0.3, 0.3, 0.3, 6.0], total=20, done=10) == slow


@pytest.mark.parametrize(
    ("rate", "text"), [(75500.2, "75500"), (681604.9, "682000"), (12.345, "12.3"), (4.0, "4"), (0.01234, "0.0123")]
)
def test_rates_have_three_digits_and_no_exponent(rate, text):
    assert progress.format_rate(rate) == text


def test_the_studio_reads_lines_with_and_without_a_rate(lines):
    with_rate = job_queue._STEPS.search(lines([20.0] + [0.25] * 48)[0])
    assert (with_rate[1], with_rate[2], with_rate[3]) == ("5", "49", "4")
    without = job_queue._STEPS.search(lines([3e-6] * 200)[0])
    assert (without[1], without[2], without[3]) == ("200", "200", None)
    assert not job_queue._STEPS.search("recorded    out/2024/11.h5 (3.0 MB)")

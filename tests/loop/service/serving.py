"""A server in a thread, for tests over the loopback."""

import threading
from contextlib import contextmanager
from pathlib import Path

import rso_lidar as rl
from tests.settings_for_tests import limit_pixels

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SMALL = (
    *limit_pixels(16, 1),
    "time.duration_s=4",
)


@contextmanager
def serving(scenario, *, session=None, **options):
    """Serve a scenario in a thread, and yield the server; it ends with the context."""
    session = session or rl.loop.Session(rl.Simulation(scenario, threads=1), serves_truth=True)
    ready, stop, made, failures = threading.Event(), threading.Event(), [], []

    def run():
        try:
            with rl.loop.Server(session, "tcp://127.0.0.1:*", **options) as server:
                made.append(server)
                ready.set()
                server.run(stop.is_set)
        except rl.RsoLidarError as error:
            failures.append(error)
        finally:
            ready.set()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert ready.wait(30.0)
        if failures:
            raise failures[0]
        made[0].failures = failures
        yield made[0]
    finally:
        stop.set()
        thread.join(30.0)
        assert not thread.is_alive()

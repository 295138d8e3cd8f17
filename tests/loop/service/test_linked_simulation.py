"""Delays and losses of the link: by seed and frame, the same however fast the machine is."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.service.linked_simulation import MOST_COMMANDS, LinkedSimulation

NS = 1_000_000_000
LINK = rl.DataLink(readout_s=0.02, latency_s=0.1, jitter_s=0.05, drop_probability=0.25, command_latency_s=0.03)


def linked(scenario, link=None, **changes):
    return LinkedSimulation(rl.Simulation(scenario.replace(link=link, **changes), threads=1))


def pan_rad(loop):
    """Return the true pan at the present time."""
    ahead = loop.simulation.truth.pose("follower", "ptu").rotation.as_matrix()[:, 0]
    return np.arctan2(ahead[1], ahead[0])


def test_delay_and_loss_have_the_stated_distribution_and_depend_on_seed_and_frame_only(scenario):
    drawn = np.array([LINK.draw(scenario.rng(k, 2)) for k in range(4000)])
    waits, lost = drawn[:, 0] - 0.12, drawn[:, 1]
    assert waits.min() > 0.0
    assert waits.mean() == pytest.approx(0.05, abs=4 * 0.05 / np.sqrt(4000))  # exponential: sigma is the mean
    assert waits.std() == pytest.approx(0.05, abs=4 * 0.05 * np.sqrt(8 / 4000) / 2)  # kurtosis 9
    assert lost.mean() == pytest.approx(0.25, abs=4 * np.sqrt(0.25 * 0.75 / 4000))
    assert LINK.draw(scenario.rng(7, 2)) == tuple(drawn[7])
    assert LINK.draw(scenario.with_seed(8).rng(7, 2)) != tuple(drawn[7])
    assert LINK.draw(scenario.rng(7, 0)) != tuple(drawn[7])


def test_a_run_over_a_bad_link_can_be_repeated(scenario):
    def fly():
        loop = linked(scenario, LINK)
        return [loop.step(rl.Command(pan_rad=0.7)) for _ in range(8)]

    one, two = fly(), fly()
    assert [(a.status, a.t_available_ns) for a in one] == [(b.status, b.t_available_ns) for b in two]
    assert {a.status for a in one} == {"delivered", "dropped"}
    for a in one:
        delay_s, is_lost = LINK.draw(scenario.rng(a.index, 2))
        assert (a.observation is None) == is_lost == (a.status == "dropped")
        assert is_lost or a.t_available_ns == a.t_emission_ns + round(delay_s * NS)
    for a, b in zip(one, two, strict=True):
        if a.observation is not None:
            np.testing.assert_array_equal(a.observation.reading.range_m, b.observation.reading.range_m)
    loop, arrived = linked(scenario, LINK), []
    begun = loop.save()
    while not loop.is_over:  # by time, where a loss returns nothing: the same readings, and the same count of losses
        if (delivery := loop.step(rl.Command(pan_rad=0.7), dt_ns=50_000_000)) is not None:
            arrived.append(delivery.index)
        sent = [a for a in one if a.t_emission_ns <= loop.time_ns]
        assert loop.dropped == sum(a.status == "dropped" for a in sent)
    assert sorted(arrived) == [a.index for a in one if a.status == "delivered"] and loop.dropped
    loop.restore(begun)
    assert loop.dropped == 0


def test_a_reading_arrives_with_the_step_in_which_it_is_available(scenario):
    loop = linked(scenario, rl.DataLink(readout_s=0.02, latency_s=0.1))
    got = {}
    while not loop.is_over:
        if (delivery := loop.step(dt_ns=10_000_000)) is not None:
            got[delivery.index] = loop.time_ns
            assert delivery.t_available_ns <= loop.time_ns or loop.simulation.is_over
    assert list(got) == list(range(8))
    assert got[3] == round(1.62 * NS)  # flash at 1.5 s


def test_a_command_acts_from_its_time_stamp_and_the_latency_on(scenario):
    scenario = scenario.replace(ptu=scenario.ptu.replace(errors=rl.PointingErrors(), response=rl.Ideal()))
    loop = linked(scenario, rl.DataLink(latency_s=0.2, command_latency_s=0.1))
    loop.step()  # the flash at t = 0, available at 0.2 s: a command without a time stamp acts from 0.3 s on
    loop.step(rl.Command(pan_rad=0.5), dt_ns=280_000_000)
    assert pan_rad(loop) == pytest.approx(np.deg2rad(45))
    loop.step(rl.Command(pan_rad=0.6), dt_ns=40_000_000)
    assert pan_rad(loop) == pytest.approx(0.5)
    loop.step(rl.Command(pan_rad=0.7), dt_ns=70_000_000, stamp_ns=0)  # at 0.32 s, stamped in the past: acts at once
    assert pan_rad(loop) == pytest.approx(0.6)  # from 0.38 s on the second one, in between

    direct = linked(scenario)  # without a link a command acts at once
    direct.step()
    direct.step(rl.Command(pan_rad=0.5), dt_ns=10_000_000)
    assert pan_rad(direct) == pytest.approx(0.5)


def test_a_state_holds_what_is_on_its_way(scenario):
    link = rl.DataLink(latency_s=0.3, command_latency_s=0.4)
    loop = linked(scenario, link)
    for pan in (0.7, 0.75, 0.8):
        loop.step(rl.Command(pan_rad=pan), dt_ns=250_000_000)
    state = loop.save()
    after = [loop.step(rl.Command(pan_rad=0.8), dt_ns=250_000_000) for _ in range(6)]
    loop.restore(state)
    again = [loop.step(rl.Command(pan_rad=0.8), dt_ns=250_000_000) for _ in range(6)]
    assert [one and one.index for one in after] == [one and one.index for one in again]
    for one, two in zip(after, again, strict=True):
        if one is not None:
            np.testing.assert_array_equal(one.observation.pan_tilt_rad, two.observation.pan_tilt_rad)


def test_what_cannot_be_done_changes_nothing(scenario):
    loop = linked(scenario, rl.DataLink(command_latency_s=0.1))
    loop.step()
    before = loop.time_ns
    with pytest.raises(rl.ScenarioError, match="contains two flashes"):
        loop.step(rl.Command(pan_rad=0.5), dt_ns=3 * NS)
    assert loop.time_ns == before
    assert len(loop.save().commands) == 1  # that of the first step
    for k in range(3):
        loop.step(rl.Command(), dt_ns=1_000_000, stamp_ns=(3000 + k) * NS)
    loop._commands *= MOST_COMMANDS
    with pytest.raises(rl.ScenarioError, match="commands wait for their time already"):
        loop.step()


def test_a_flash_that_is_skipped_leaves_the_others_as_they_are(scenario):
    loop, whole = linked(scenario), linked(scenario)
    skipped = [loop.step(skip=k in (1, 2)) for k in range(8)]
    made = [whole.step() for _ in range(8)]
    assert [one.status for one in skipped] == ["delivered", "skipped", "skipped", *["delivered"] * 5]
    assert [one.t_emission_ns for one in skipped] == [one.t_emission_ns for one in made]
    np.testing.assert_array_equal(skipped[4].observation.reading.range_m, made[4].observation.reading.range_m)
    np.testing.assert_array_equal(skipped[4].observation.pan_tilt_rad, made[4].observation.pan_tilt_rad)


def test_a_command_that_cannot_be_given_does_not_wait_for_its_time(scenario):
    """Otherwise it would be refused later, again at every step."""
    loop = linked(scenario, LINK)
    loop.step()
    for bad in (rl.Command(inputs={"nobody": [1.0]}), rl.Command(pan_rad=np.nan), rl.Command(energy_j=-1.0)):
        with pytest.raises(rl.ScenarioError, match="command"):
            loop.step(bad)
    assert [loop.step(rl.Command(pan_rad=0.1)).index for _ in range(3)] == [1, 2, 3]

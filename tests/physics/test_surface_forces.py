"""Bodies flown by sunlight and air on their facets, against closed forms."""

import datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion import Body, PrescribedAttitude, Rtn, Spin, Torqued, Tumble, truth
from rso_lidar.motion.attitudes import torqued
from rso_lidar.motion.attitudes.torqued import TorquedFlight
from rso_lidar.orbit import Drag, Epochs, FacetForces, FacetModel, Forces, Kepler, Numerical, RadiationPressure, State
from rso_lidar.records import FacetTable, grid_directions

START = datetime.datetime(2026, 3, 2, tzinfo=datetime.UTC)
LOW = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6778.137,
    eccentricity=0.0005,
    inclination_deg=51.6,
    raan_deg=40.0,
    argument_of_perigee_deg=15.0,
    true_anomaly_deg=30.0,
)


def table(light=1.0, air=1.0, torque=(0.0, 0.0, 0.0)):
    """Loads of a sphere, with a torque that no direction changes."""
    ways = grid_directions(12, 24)
    twist = np.broadcast_to(np.array(torque), ways.shape)
    return FacetTable(-light * ways, twist, -air * ways, np.zeros(ways.shape))


def test_a_sphere_of_facets_flies_as_the_cannonball():
    sphere = table(light=1.3 * 4.0, air=2.2 * 3.0)
    known = Numerical(initial=LOW, forces=Forces(facets=FacetForces(mass_kg=100.0))).with_table(
        lambda: sphere, PrescribedAttitude(Rtn(euler_zyx_deg=(20.0, 30.0, 40.0)))
    )
    ball = Forces(
        drag=Drag(area_m2=3.0, mass_kg=100.0), radiation_pressure=RadiationPressure(area_m2=4.0, mass_kg=100.0)
    )
    epochs = Epochs(START, np.array([1500.0]))
    there, expected = known.states(epochs), Numerical(initial=LOW, forces=ball).states(epochs)
    free = Numerical(initial=LOW).states(epochs)
    moved = np.linalg.norm(expected.position_m - free.position_m)
    assert np.linalg.norm(there.position_m - expected.position_m) < 1e-4 * moved


def test_air_on_facets_ends_below_100_km_as_on_a_sphere():
    """As drag does, for re-entry is stiff: 2991 s to the ground, of which half a minute of computing."""
    low = State(epoch_utc=START, position_m=(6.518137e6, 0.0, 0.0), velocity_m_s=(0.0, 7.81e3, 0.0))
    facets = Forces(facets=FacetForces(mass_kg=100.0))
    falling = Numerical(initial=low, forces=facets).with_table(lambda: table(air=22.0), PrescribedAttitude(Rtn()))
    with pytest.raises(PropagationError, match=r"falls below 100 km by \d+ s after the start"):
        falling.states(Epochs(START, np.array([2000.0])))


def test_a_torqued_flight_is_that_of_its_own_orbit(monkeypatch):
    """Two orbits of one start part at 600 s: what one has flown before is nothing to the other."""
    flights = []

    class KnownFlight:
        def __init__(self, start, loads, find_pressures):
            flights.append(find_pressures(np.array([3000.0]))[1][0])  # of the air, along its velocity

        def __call__(self, time_s):
            return Rotation.identity(len(time_s)), np.zeros((len(time_s), 3))

    monkeypatch.setattr(torqued, "TorquedFlight", KnownFlight)
    sphere = table()
    law = Torqued(inertia_kg_m2=(400.0, 500.0, 600.0), body_rate_deg_s=(0.0, 0.0, 0.02)).with_table(lambda: sphere)
    jump = {"type": "impulse", "at_s": 600.0, "delta_v_m_s": (0.0, 0.0, 500.0)}
    quiet, pushed = (Numerical(initial=LOW, maneuvers=maneuvers) for maneuvers in ((), (jump,)))
    for motion in (quiet, pushed, quiet, pushed):
        truth([Body(name="craft", motion=motion, attitude=law)], Epochs(START, np.array([0.0, 10.0])))
    assert len(flights) == 2
    assert not np.allclose(*flights, rtol=1e-3, atol=0.0)


def test_a_tumble_without_torque_is_the_closed_form():
    start = {"inertia_kg_m2": (10.0, 12.0, 15.0), "body_rate_deg_s": (0.1, 0.5, 0.2)}
    still = Torqued(**start, facets=FacetModel(sunlight=False, drag=False))
    flight = TorquedFlight(still, table(torque=(1.0, 1.0, 1.0)), lambda t: (np.ones((len(t), 3)), np.ones((len(t), 3))))
    times = np.linspace(0.0, 5000.0, 20)
    rotation, rates = flight(times)
    expected, expected_rates = Tumble(**start).orientation(times)
    assert (rotation.inv() * expected).magnitude().max() < 1e-9
    assert np.abs(rates - expected_rates).max() < 1e-9 * np.linalg.norm(expected_rates[0])


def test_a_constant_torque_spins_a_body_up_by_its_impulse():
    """Two days in the light of 1 AU, with a torque of 0.02 m3 about the spin axis: the rate grows by P T t / I."""
    body = Torqued(inertia_kg_m2=(80.0, 80.0, 100.0), body_rate_deg_s=(0.0, 0.0, 0.05))
    light = np.array([units.SOLAR_PRESSURE_N_M2, 0.0, 0.0])
    flight = TorquedFlight(
        body, table(torque=(0.0, 0.0, 0.02)), lambda t: (np.tile(light, (len(t), 1)), np.zeros((len(t), 3)))
    )
    days_s = 2 * 86_400.0
    _, rates = flight(np.array([days_s]))
    gained = units.SOLAR_PRESSURE_N_M2 * 0.02 * days_s / 100.0
    assert rates[0] == pytest.approx([0.0, 0.0, 0.05 * units.DEG + gained], abs=1e-6 * gained)


def test_a_propeller_of_four_mirrors_spins_up_at_its_averaged_rate():
    """Plates of area A, arm r, pitch b of 30 degrees, about the Sun line: T = 4 A r 2 cos^2(b) sin(b)."""
    pitch, ways = np.pi / 6, grid_directions(24, 48)
    torque = np.zeros(ways.shape)
    for turn in np.arange(4) * np.pi / 2:
        arm, along = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
        normal = np.array([0.0, 0.0, np.cos(pitch)]) + np.sin(pitch) * along
        cosine = ways @ normal
        torque += np.cross(arm, -2.0 * cosine[..., None] * np.abs(cosine)[..., None] * normal)
    sails = FacetTable(np.zeros(ways.shape), torque, np.zeros(ways.shape), np.zeros(ways.shape))
    body = Torqued(inertia_kg_m2=(50.0, 50.0, 90.0), body_rate_deg_s=(0.0, 0.0, -0.2))
    light = np.array([0.0, 0.0, units.SOLAR_PRESSURE_N_M2])
    flight = TorquedFlight(body, sails, lambda t: (np.tile(light, (len(t), 1)), np.zeros((len(t), 3))))
    _, rates = flight(np.array([14_400.0]))
    expected = -4 * 2.0 * np.cos(pitch) ** 2 * np.sin(pitch) * units.SOLAR_PRESSURE_N_M2 * 14_400.0 / 90.0
    assert rates[0, 2] + 0.2 * units.DEG == pytest.approx(expected, rel=5e-3)


def test_the_attitude_along_an_orbit_is_that_of_its_law():
    spin = Spin(axis=(0.0, 0.0, 1.0), rate_deg_s=1.0)
    state = (7e6, 0.0, 0.0), (0.0, 7500.0, 0.0)
    assert PrescribedAttitude(spin)(START, 90.0, *state)[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert PrescribedAttitude(Rtn())(START, 90.0, *state) == pytest.approx(np.eye(3), abs=1e-12)


def test_facets_without_a_mesh_are_an_error_with_its_cure():
    with pytest.raises(ScenarioError, match="needs a target with a mesh"):
        Numerical(initial=LOW, forces=Forces(facets=FacetForces(mass_kg=1.0))).states(Epochs(START, np.array([1.0])))
    with pytest.raises(ScenarioError, match="leave one out"):
        Forces(facets=FacetForces(mass_kg=1.0), drag=Drag(area_m2=1.0, mass_kg=1.0))

"""The inspection task of bsk_rl, observed by the frames of a flash lidar in place of true relative states.

bsk_rl (AVS Lab) flies an inspector about a target, points its instrument, and rewards points of the target that are
inspected while lit. Its published tasks observe the true relative position. Here the policy sees an image of ranges and the
eclipse, and a simple controller flies by them.

pip install rso-lidar bsk-rl
python inspection.py
"""

import argparse
import datetime

import numpy as np
from Basilisk.architecture import bskLogging
from bsk_rl import ConstellationTasking, act, data, obs, sats, scene
from bsk_rl.sim import dyn, fsw
from bsk_rl.utils.orbital import random_circular_orbit
from scipy.spatial.transform import Rotation

import rso_lidar as rl

TARGET, INSPECTOR = "RSO", "Inspector"
START_UTC = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
STEP_S = 120.0  # between two decisions, and two frames
STAND_OFF_M = 80.0  # where the controller keeps the inspector
MEAN_MOTION_RAD_S = 1.1068e-3  # of a circular orbit of 6878.137 km
PIXELS = 32


def make_scenario():
    """Return a 12U cubesat and an inspector; bsk_rl sets both states at each frame."""
    orbit = rl.Kepler(
        epoch_utc=START_UTC,
        semi_major_axis_km=6878.137,
        eccentricity=0.0,
        inclination_deg=30.0,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=0.0,
    )
    return rl.Scenario(
        version=1,
        name="Inspection of a 12U cubesat",
        seed=3,
        time=rl.Time(start_utc=START_UTC, duration_s=1.0, frame_rate_hz=1.0),
        target=[rl.Target(name="rso", model="cubesat_12u", size_m=2.0, motion=orbit)],
        follower=rl.Follower(motion=orbit, attitude=rl.Rtn()),
        lidar=rl.Lidar(
            laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=4.0),
            receiver=rl.Receiver(
                fov_deg=4.0, f_number=2.8, transmission=0.67, n_rows=PIXELS, n_cols=PIXELS, rays_per_pixel=4
            ),
            detector=rl.Empirical(armed_to_m=2000, false_alarms_per_s=10),
        ),
    )


class HandedState:
    """A motion and an attitude of rso_lidar that stay as they are: the state of a satellite of bsk_rl at one instant."""

    def __init__(self, dynamics):
        self.position_m, self.velocity_m_s = np.array(dynamics.r_BN_N), np.array(dynamics.v_BN_N)
        # [BN] takes N coordinates to B; its transpose is inertial_from_body, which from_mrp makes of sigma_BN.
        self.rotation, self.rate_rad_s = Rotation.from_mrp(dynamics.sigma_BN), np.array(dynamics.omega_BN_B)

    def states(self, epochs):
        return rl.records.BodyState(
            np.tile(self.position_m, (len(epochs), 1)), np.tile(self.velocity_m_s, (len(epochs), 1))
        )

    def orient(self, situation):
        count = len(situation.epochs.time_s)
        turned = Rotation.concatenate([self.rotation] * count)
        return rl.motion.Orientation(turned, np.tile(self.rate_rad_s, (count, 1)))


class LidarFrame(obs.Observation):
    """An observation of bsk_rl: range [km] of each pixel, 0 where nothing came back, and the mask of returns."""

    def __init__(self, scenario, name="lidar"):
        super().__init__(name=name)
        self.scenario, self.frame, self.count = scenario, None, 0

    def __deepcopy__(self, memo):
        return LidarFrame(self.scenario, self.name)

    def get_obs(self):
        satellites = {satellite.name: satellite for satellite in self.simulator.satellites}
        states = {name: HandedState(satellites[name].dynamics) for name in (TARGET, INSPECTOR)}
        target, follower = (
            part.replace(motion=states[name], attitude=states[name])
            for part, name in ((self.scenario.target[0], TARGET), (self.scenario.follower, INSPECTOR))
        )
        self.count += 1  # noise of its own for each frame
        flown = self.scenario.replace(target=(target,), follower=follower).with_seed(self.scenario.seed + self.count)
        self.frame = next(rl.simulate(flown, frames=[0], threads=1))
        return {
            "range_km": np.nan_to_num(self.frame.range_m, nan=0.0).astype(float) / 1e3,
            "valid": self.frame.valid.astype(float),
        }


class TargetSatellite(sats.Satellite):
    observation_spec = [obs.SatProperties({"prop": "one", "fn": lambda _: 1.0})]  # noqa: RUF012 (bsk_rl reads a list)
    action_spec = [act.Drift(duration=1e9)]  # noqa: RUF012
    dyn_type, fsw_type = dyn.RSODynModel, fsw.FSWModel


class InspectorFlightSoftware(fsw.MagicOrbitalManeuverFSWModel, fsw.RSOInspectorFSWModel):
    """Impulses, and an instrument that points at the target."""


class InspectorSatellite(sats.Satellite):
    observation_spec = [LidarFrame(make_scenario()), obs.Eclipse(norm=5700.0)]  # noqa: RUF012
    action_spec = [  # noqa: RUF012
        act.ImpulsiveThrustHill(
            chief_name=TARGET, max_dv=1.0, max_drift_duration=5700.0, fsw_action="action_inspect_rso"
        )
    ]
    dyn_type, fsw_type = dyn.RSOInspectorDynModel, InspectorFlightSoftware


def make_environment(time_limit_s=6000.0, true_anomaly_deg=0.001):
    """Return the environment: the target, and an inspector some 120 m ahead of it on the same orbit."""
    bskLogging.setDefaultLogLevel(bskLogging.BSK_ERROR)
    orbits = [random_circular_orbit(i=30, alt=500, Omega=0, f=f_deg) for f_deg in (0.0, true_anomaly_deg)]
    power = {"batteryStorageCapacity": 1e9, "storedCharge_Init": 1e9}
    instrument = {
        "imageAttErrorRequirement": 1.0,
        "imageRateErrorRequirement": None,
        "inst_pHat_B": [1.0, 0.0, 0.0],  # the boresight of the lidar is body +x
        "instrumentBaudRate": 1,
        "dataStorageCapacity": 1e6,
        "dv_available_init": 10.0,
        "u_max": 1.0,
    }
    return ConstellationTasking(
        satellites=[
            TargetSatellite(TARGET, sat_args={"oe": orbits[0]}),
            InspectorSatellite(INSPECTOR, sat_args=power | instrument | {"oe": orbits[1]}, obs_type=dict),
        ],
        scenario=scene.SphericalRSO(
            n_points=100,
            radius=1.0,
            theta_max=90.0 * rl.units.DEG,
            range_max=250,
            theta_solar_max=90.0 * rl.units.DEG,
        ),
        rewarder=(data.RSOInspectionReward(completion_bonus=1.0),),
        time_limit=time_limit_s,
        sim_rate=1.0,
        log_level="ERROR",
    )


class RadialHop:
    """A controller that goes along-track from the range in the first frame to the stand-off, in half an orbit.

    Two equal radial impulses of n (y - stand-off) / 4 move an inspector ahead of its target by the difference (Clohessy and
    Wiltshire). Only the frames tell the range. A learned policy takes the place of this class.
    """

    def __init__(self):
        self.impulse_m_s, self.left_s = None, None

    def __call__(self, observation):
        """Return the action for an observation: impulse in the target's Hill axes [m/s], and the drift [s]."""
        seen = observation["lidar"]["valid"] > 0
        radial_m_s = 0.0
        if self.impulse_m_s is None and seen.sum() >= 4:
            range_m = 1e3 * float(np.median(observation["lidar"]["range_km"][seen]))
            self.impulse_m_s = radial_m_s = 0.25 * MEAN_MOTION_RAD_S * (range_m - STAND_OFF_M)
            self.left_s = np.pi / MEAN_MOTION_RAD_S
        elif self.left_s is not None and self.left_s < 0.5 * STEP_S:
            radial_m_s, self.left_s = self.impulse_m_s, None
        drift_s = STEP_S if self.left_s is None else min(STEP_S, self.left_s)
        if self.left_s is not None:
            self.left_s -= drift_s
        return [radial_m_s, 0.0, 0.0, drift_s]


def fly(steps=30):
    """Fly by the frames; yield time [s], returns, median range, true range [m], and the reward so far."""
    environment = make_environment()
    observations, _ = environment.reset(seed=1)
    decide, total = RadialHop(), 0.0
    for _ in range(steps):
        action = decide(observations[INSPECTOR])
        observations, rewards, ended, truncated, _ = environment.step({TARGET: 0, INSPECTOR: action})
        total += rewards.get(INSPECTOR, 0.0)
        simulator = environment.unwrapped.simulator
        states = {satellite.name: np.array(satellite.dynamics.r_BN_N) for satellite in simulator.satellites}
        image = observations[INSPECTOR]["lidar"]
        seen = image["valid"] > 0
        median_m = 1e3 * float(np.median(image["range_km"][seen])) if seen.any() else np.nan
        true_m = float(np.linalg.norm(states[INSPECTOR] - states[TARGET]))
        yield simulator.sim_time, int(seen.sum()), median_m, true_m, total
        if any(ended.values()) or any(truncated.values()):
            return


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", type=int, default=30, help="decisions")
    for time_s, returns, median_m, true_m, total in fly(parser.parse_args().steps):
        print(
            f"{time_s:7.0f} s  {returns:4d} returns  median {median_m:7.2f} m  true {true_m:7.2f} m  reward {total:.2f}"
        )

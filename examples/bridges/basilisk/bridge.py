"""A Basilisk simulation whose spacecraft carries the flash lidar: reaction wheels point it by its own readings.

Basilisk flies a tumbling rocket stage and a servicer 60 m behind it, and passes their states on at each flash. The reading
goes back as an OpNavMsg, from which the guidance makes the errors that Basilisk's mrpFeedback drives to zero.

pip install rso-lidar bsk
python bridge.py
"""

import sys
from pathlib import Path

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.fswAlgorithms import mrpFeedback, rwMotorTorque
from Basilisk.simulation import reactionWheelStateEffector, simpleNav, spacecraft
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody, simIncludeRW
from scipy.spatial.transform import Rotation

import rso_lidar as rl

EXAMPLES = Path(__file__).resolve().parents[2]
FLASH_S, CONTROL_S = 0.5, 0.1
BODY_FROM_LIDAR = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # boresight +z is body +x
SERVICER_KG_M2 = np.diag([900.0, 800.0, 600.0])


class HandedState:
    """A motion and an attitude of rso_lidar: the latest state from Basilisk, extrapolated at constant rates."""

    def __init__(self):
        self.time_s, self.position_m, self.velocity_m_s = 0.0, np.array([7e6, 0.0, 0.0]), np.array([0.0, 7.5e3, 0.0])
        self.rotation, self.rate_rad_s = Rotation.identity(), np.zeros(3)

    def take(self, message, time_s):
        """Take the state of an SCStatesMsg: centre of mass in N axes, and sigma_BN, the MRP of the passive matrix [BN]."""
        self.time_s, self.position_m, self.velocity_m_s = time_s, np.array(message.r_CN_N), np.array(message.v_CN_N)
        # [BN] takes N coordinates to B, so its transpose is inertial_from_body, which from_mrp makes of sigma_BN.
        self.rotation, self.rate_rad_s = Rotation.from_mrp(message.sigma_BN), np.array(message.omega_BN_B)

    def states(self, epochs):
        after_s = (epochs.time_s - self.time_s)[:, None]
        velocity = np.tile(self.velocity_m_s, (len(epochs), 1))
        return rl.records.BodyState(self.position_m + after_s * velocity, velocity)

    def orient(self, situation):
        after_s = (situation.epochs.time_s - self.time_s)[:, None]
        turned = self.rotation * Rotation.from_rotvec(after_s * self.rate_rad_s)
        return rl.motion.Orientation(turned, np.tile(self.rate_rad_s, (len(after_s), 1)))


class FlashLidar(sysModel.SysModel):
    """A Basilisk module: one flash per call. Frame k depends on Basilisk's states, the seed and k only."""

    def __init__(self, scenario):
        super().__init__()
        self.servicerInMsg, self.stageInMsg = messaging.SCStatesMsgReader(), messaging.SCStatesMsgReader()
        self.opNavOutMsg = messaging.OpNavMsg()
        self.servicer, self.stage, self.frames = HandedState(), HandedState(), []
        follower = scenario.follower.replace(motion=self.servicer, attitude=self.servicer)
        target = scenario.target[0].replace(motion=self.stage, attitude=self.stage)
        self.scenario = scenario.replace(follower=follower, target=(target,))

    def UpdateState(self, CurrentSimNanos):  # noqa: N802 (Basilisk names it)
        time_s = CurrentSimNanos * macros.NANO2SEC
        self.servicer.take(self.servicerInMsg(), time_s)
        self.stage.take(self.stageInMsg(), time_s)
        (frame,) = rl.simulate(self.scenario, frames=[round(time_s / FLASH_S)])
        self.frames.append(frame)
        message = messaging.OpNavMsgPayload()
        message.timeTag = time_s
        if frame.valid.sum() >= 4:
            centroid_m = np.median(frame.points_m[frame.valid], axis=0)  # false triggers do not move a median
            message.r_BN_B, message.valid = (-BODY_FROM_LIDAR @ centroid_m).tolist(), 1  # the servicer from the stage
        self.opNavOutMsg.write(message, CurrentSimNanos, self.moduleID)


class PointAtTarget(sysModel.SysModel):
    """Guidance: attitude and rate errors of body +x from the line of sight, for mrpFeedback."""

    GAIN, LONGEST_STEP_RAD = 0.1, 0.02  # share of a new rate that is taken; of one flash

    def __init__(self):
        super().__init__()
        self.opNavInMsg, self.attNavInMsg = messaging.OpNavMsgReader(), messaging.NavAttMsgReader()
        self.attGuidOutMsg = messaging.AttGuidMsg()
        self.sight, self.rate_rad_s, self.seen_s = None, np.zeros(3), -1.0  # in N axes

    def UpdateState(self, CurrentSimNanos):  # noqa: N802 (Basilisk names it)
        reading, attitude = self.opNavInMsg(), self.attNavInMsg()
        inertial_from_body = Rotation.from_mrp(attitude.sigma_BN)
        if reading.valid and reading.timeTag > self.seen_s:
            sight = inertial_from_body.apply(-np.array(reading.r_BN_B))
            sight /= np.linalg.norm(sight)
            if self.sight is not None:
                step = np.cross(self.sight, sight)
                if np.linalg.norm(step) < self.LONGEST_STEP_RAD:
                    self.rate_rad_s += self.GAIN * (step / (reading.timeTag - self.seen_s) - self.rate_rad_s)
            self.sight, self.seen_s = sight, reading.timeTag
        error = messaging.AttGuidMsgPayload()
        error.omega_BR_B = attitude.omega_BN_B
        if self.sight is not None:
            after_s = CurrentSimNanos * macros.NANO2SEC - self.seen_s
            sight = inertial_from_body.inv().apply(self.sight + after_s * np.cross(self.rate_rad_s, self.sight))
            axis = np.cross([1.0, 0.0, 0.0], sight)
            angle, sine = np.arctan2(np.linalg.norm(axis), sight[0]), np.linalg.norm(axis)
            rate = inertial_from_body.inv().apply(self.rate_rad_s)
            # R is B turned by the angle about the axis; sigma_BR is that of B relative to R, hence the minus
            error.sigma_BR = (-np.tan(angle / 4.0) * axis / max(sine, 1e-12)).tolist()
            error.omega_RN_B, error.omega_BR_B = rate.tolist(), (np.array(attitude.omega_BN_B) - rate).tolist()
        self.attGuidOutMsg.write(error, CurrentSimNanos, self.moduleID)


def make_spacecraft(name, mass_kg, inertia_kg_m2, gravity):
    """Return a rigid Basilisk spacecraft under gravity."""
    made = spacecraft.Spacecraft()
    made.ModelTag, made.hub.mHub = name, mass_kg
    made.hub.IHubPntBc_B = inertia_kg_m2.tolist()
    gravity.addBodiesTo(made)
    return made


def fly(scenario, duration_s):
    """Fly both spacecraft in Basilisk, and return the frames, the recorders of their states, and that of the wheels."""
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("flight")
    for task, step_s, priority in (("dynamics", CONTROL_S, 3), ("lidar", FLASH_S, 2), ("software", CONTROL_S, 1)):
        process.addTask(simulation.CreateNewTask(task, macros.sec2nano(step_s)), priority)
    gravity = simIncludeGravBody.gravBodyFactory()
    earth = gravity.createEarth()
    earth.isCentralBody = True

    inertia = np.array(scenario.target[0].attitude.inertia_tensor_kg_m2)
    stage = make_spacecraft("stage", 4000.0, inertia, gravity)
    servicer = make_spacecraft("servicer", 750.0, SERVICER_KG_M2, gravity)
    radius_m, behind_rad = 6_928_137.0, 60.0 / 6_928_137.0
    speed_m_s = np.sqrt(earth.mu / radius_m)
    for body, angle in ((stage, 0.0), (servicer, -behind_rad)):
        body.hub.r_CN_NInit = (radius_m * np.array([np.cos(angle), np.sin(angle), 0.0])).tolist()
        body.hub.v_CN_NInit = (speed_m_s * np.array([-np.sin(angle), np.cos(angle), 0.0])).tolist()
    stage.hub.sigma_BNInit, stage.hub.omega_BN_BInit = [0.1, 0.2, -0.3], [0.010, 0.017, 0.007]
    # Body +x along-track, which is N's y, but for 2 deg: still in the field
    start = Rotation.from_euler("ZYX", [92.0, 1.0, 40.0], degrees=True)
    servicer.hub.sigma_BNInit, servicer.hub.omega_BN_BInit = start.as_mrp().tolist(), [0.0, 0.0, 0.0]

    wheels, effector = simIncludeRW.rwFactory(), reactionWheelStateEffector.ReactionWheelStateEffector()
    for axis in np.eye(3).tolist():
        wheels.create("Honeywell_HR16", axis, maxMomentum=50.0, RWModel=messaging.BalancedWheels)
    wheels.addToSpacecraft("wheels", effector, servicer)

    navigation = simpleNav.SimpleNav()
    navigation.scStateInMsg.subscribeTo(servicer.scStateOutMsg)
    lidar, guidance = FlashLidar(scenario), PointAtTarget()
    lidar.servicerInMsg.subscribeTo(servicer.scStateOutMsg)
    lidar.stageInMsg.subscribeTo(stage.scStateOutMsg)
    guidance.opNavInMsg.subscribeTo(lidar.opNavOutMsg)
    guidance.attNavInMsg.subscribeTo(navigation.attOutMsg)

    rigid = messaging.VehicleConfigMsg().write(
        messaging.VehicleConfigMsgPayload(ISCPntB_B=SERVICER_KG_M2.ravel().tolist())
    )
    rw_config = wheels.getConfigMessage()
    control = mrpFeedback.mrpFeedback()
    control.K, control.P, control.Ki, control.integralLimit = 60.0, 200.0, -1.0, 0.1  # Ki below 0: no integral
    control.guidInMsg.subscribeTo(guidance.attGuidOutMsg)
    control.vehConfigInMsg.subscribeTo(rigid)
    control.rwParamsInMsg.subscribeTo(rw_config)
    control.rwSpeedsInMsg.subscribeTo(effector.rwSpeedOutMsg)
    torque = rwMotorTorque.rwMotorTorque()
    torque.controlAxes_B = np.eye(3).ravel().tolist()
    torque.vehControlInMsg.subscribeTo(control.cmdTorqueOutMsg)
    torque.rwParamsInMsg.subscribeTo(rw_config)
    effector.rwMotorCmdInMsg.subscribeTo(torque.rwMotorTorqueOutMsg)

    recorders = [body.scStateOutMsg.recorder(macros.sec2nano(FLASH_S)) for body in (stage, servicer)]
    recorders.append(effector.rwSpeedOutMsg.recorder(macros.sec2nano(FLASH_S)))
    for task, models in (
        ("dynamics", (effector, stage, servicer, navigation, *recorders)),
        ("lidar", (lidar,)),
        ("software", (guidance, control, torque)),
    ):
        for model in models:
            simulation.AddModelToTask(task, model)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(duration_s - FLASH_S))
    simulation.ExecuteSimulation()
    return lidar.frames, recorders


def make_scenario(duration_s):
    """Return the instrument and the stage; both bodies are moved by whoever flies the scenario."""
    base = rl.Scenario.load(EXAMPLES / "tumbling_inspection.toml")
    receiver = base.lidar.receiver.replace(fov_deg=18.0, n_rows=64, n_cols=64, rays_per_pixel=4)
    laser = base.lidar.laser.replace(divergence_deg=18.0, energy_mj=5.0)
    lidar = base.lidar.replace(laser=laser, receiver=receiver)
    time = base.time.replace(duration_s=duration_s, frame_rate_hz=1.0 / FLASH_S)
    return base.replace(name="Rocket stage and servicer flown by Basilisk", time=time, lidar=lidar, ptu=None)


if __name__ == "__main__":
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    for frame in fly(make_scenario(duration_s), duration_s)[0]:
        if frame.index % 10 == 0:
            right, down, ahead = frame.truth.pose("lidar", "stage").translation
            off_deg = np.arctan2(np.hypot(right, down), ahead) / rl.units.DEG
            print(
                f"{frame.time_s:5.1f} s  {frame.valid.sum():5d} returns, stage's centre {off_deg:6.3f} deg off boresight"
            )

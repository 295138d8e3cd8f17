"""A colour camera beside the lidar: one approach, two sensors, and what each of them sees in the light of the moment."""

import datetime

import rso_lidar as rl
from rso_lidar import imaging, optics, rpo

scenario = rl.Scenario(
    version=1,
    name="Two eyes: a colour camera beside the lidar",
    seed=4002,
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), duration_s=6000, frame_rate_hz=0.004
    ),
    world=rl.World(earth_albedo=0.3),  # the Earth lights what the Sun does not
    target=[
        rl.Target(
            name="envisat",
            model="envisat",
            motion=rl.Tle(file="tle/envisat.tle"),
            attitude=rl.Spin(preset="envisat_2013"),
        )
    ],
    follower=rl.Follower(
        motion=rpo.Circumnavigation(relative_to="envisat", radial_m=60), attitude=rl.LookAt(at="envisat")
    ),
    lidar=rl.Lidar(preset="gsfl_1064", receiver={"fov_deg": 30, "f_number": 1.8}, laser={"divergence_deg": 30}),
    camera=[
        rl.Camera(  # for navigation: beside the lidar, in colour
            name="nav",
            mount=rl.Mount(position_m=(0, 0.3, 0)),
            bands="rgb",
            lens=imaging.CameraLens(fov_deg=24, f_number=4, psf=optics.GaussianPsf(sigma_um=3)),
            auto_exposure=imaging.AutoExposure(),
        ),
        rl.Camera(  # for stars, with a long exposure
            name="stars",
            mount=rl.Mount(euler_zyx_deg=(0, -90, 0)),  # its boresight is along the orbit normal
            lens=imaging.CameraLens(fov_deg=16, f_number=1.4, psf=optics.GaussianPsf(sigma_um=4)),
            exposure_ms=200,
        ),
    ],
)

if __name__ == "__main__":
    for frame in rl.simulate(scenario, frames=[2, 9, 16, 21]):
        image, labels = frame.camera["nav"], frame.camera_labels["nav"]
        on_target = labels.target >= 0
        lit = (labels.electrons.sum(axis=-1) > 100) & on_target
        print(
            f"{frame.time_s:6.0f} s  lidar {frame.valid.sum():5d} returns  camera {on_target.sum():6d} pixels on target, "
            f"{lit.sum():6d} lit, exposure {1e3 * float(image.exposure_s):8.3f} ms"
        )

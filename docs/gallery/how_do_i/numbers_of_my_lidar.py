"""
How do I simulate my own lidar?
===============================

Take the numbers of its data sheet. What you leave out has a default that is marked as sourced or assumed in
:doc:`/instrument`.
"""

import rso_lidar as rl
from rso_lidar import picture

lidar = rl.Lidar(
    laser=rl.Laser(wavelength_nm=905, energy_mj=2.0, pulse_fwhm_ns=5, divergence_deg=10),
    receiver=rl.Receiver(fov_deg=10, aperture_mm=40, n_rows=64, n_cols=64, pixel_pitch_um=50, transmission=0.6),
    detector=rl.Gsfl(quantum_efficiency=0.6, armed_from_m=5, armed_to_m=400),
)

# %%
# First the closed form: how far does a pixel report a surface of reflectance 0.3?
print(rl.budget(lidar, range_m=(10.0, 2000.0)).table())

# %%
# Then frames of a shipped scenario with this camera. A mission file does the same with its table `[lidar]`.
scenario = rl.Scenario.load("examples/tumbling_inspection.toml").replace(lidar=lidar)
picture.frame_figure(next(rl.simulate(scenario, frames=[417])))

# %%
# Every field with its unit, default and source: :doc:`/scenario`.

"""
How do I read a recording in MATLAB, C++ or xarray?
===================================================

A recording is one HDF5 file with units and meanings as attributes. Any HDF5 library reads it; nothing of this
package is needed.
"""

import tempfile
from pathlib import Path

import h5py

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
path = rl.save(folder / "stage.h5", rl.simulate(rl.Scenario.load("examples/tumbling_inspection.toml"), frames=range(3)))

# %%
# With h5py:
with h5py.File(path) as file:
    print("datasets:", [name for name in file if isinstance(file[name], h5py.Dataset)])
    print(file["range"].shape, dict(file["range"].attrs)["units"], "|", file["range"].attrs["long_name"])
    points_m = file["range"][0][..., None] * file["line_of_sight"][:]
    position_m = file["truth/stage/position"][:]
print(points_m.shape, position_m[0])

# %%
# With xarray: ``xr.open_dataset("stage.h5", engine="h5netcdf")``, or any netCDF tool if you save it as `.nc`.
#
# With MATLAB, whose dimensions run in reverse:
#
# .. code-block:: matlab
#
#    range_m = permute(h5read('stage.h5', '/range'), [3 2 1]);   % (time, row, col)
#    q = h5read('stage.h5', '/truth/stage/quaternion')';         % (time, 4), x y z w
#
# With C++ and HighFive:
#
# .. code-block:: cpp
#
#    HighFive::File file("stage.h5");
#    auto range_m = file.getDataSet("range").read<std::vector<std::vector<std::vector<float>>>>();
#
# The layout, dataset by dataset: :doc:`/records`.

# Read one frame of a recording (.h5) in Julia with HDF5.jl. Written from its documentation; not run by us.
#
#   julia> using Pkg; Pkg.add("HDF5")
#   julia> include("read_recording.jl")
#   julia> frame = read_recording("approach.h5", 3)    # frames count from 0, as in rso_lidar
#
# HDF5.jl turns the dimensions around, since Julia's arrays store the first one together: (col, row, time) in place of
# (time, row, col). permutedims puts them back.
using HDF5

"""
    read_recording(file, number; body = "tdrs")

Return range [m] and counts (row, col), points [m] (row, col, xyz) in lidar axes, NaN where nothing came back, and the pose of
a body in lidar axes: its position [m] and its quaternion x, y, z, w (Rotations.jl takes w first).
"""
function read_recording(file::AbstractString, number::Integer; body::AbstractString = "tdrs")
    h5open(file, "r") do f
        k = findfirst(==(number), read(f["frame_index"]))
        k === nothing && error("$file: holds no frame $number")
        range_m = permutedims(f["range"][:, :, k])                             # reads this frame alone
        counts = permutedims(f["intensity"][:, :, k])
        sight = permutedims(read(f["line_of_sight"]), (3, 2, 1))               # (row, col, xyz)
        pose = f["truth/$body"]
        return (
            time_s = f["time"][k],
            range_m = range_m,
            counts = counts,
            points_m = range_m .* sight,
            position_m = pose["position"][:, k],
            quaternion = pose["quaternion"][:, k],
        )
    end
end

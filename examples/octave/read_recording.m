function frame = read_recording(file, number)
% Read one frame of a recording (.h5) in GNU Octave, which needs no package for it.
%
%   frame = read_recording('approach.h5', 3);          % frames count from 0, as in rso_lidar
%   imagesc(frame.range_m); axis image; colorbar
%
% load turns the dimensions of HDF5 around, so that time is the last one; they are put back here. It reads the arrays that
% it names for all frames: 128 KiB a frame of 128 x 128 pixels and array. Where that is too much, ncread of the package
% netcdf reads single frames: ncread(file, 'range', [1 1 number + 1], [Inf Inf 1])'.
%
% frame.range_m and frame.counts are (row, col), and frame.points_m is (row, col, xyz) in lidar axes; NaN where nothing came
% back. frame.position_m (xyz) and frame.quaternion (x, y, z, w) of a body are its pose in lidar axes, by name.
s = load('-hdf5', file, 'frame_index', 'time', 'range', 'intensity', 'line_of_sight', 'truth');
k = find(s.frame_index == number);
if isempty(k)
  error('%s: holds no frame %d, but %d of them from %d on', file, number, numel(s.frame_index), s.frame_index(1));
end
frame.time_s = s.time(k);
frame.range_m = s.range(:, :, k)';
frame.counts = s.intensity(:, :, k)';
frame.points_m = frame.range_m .* permute(s.line_of_sight, [3 2 1]);
for name = fieldnames(s.truth)'                        % a dot in a name, as of tdrs.rtn, has become an underscore
  pose = s.truth.(name{1});
  if isstruct(pose) && isfield(pose, 'quaternion')
    frame.position_m.(name{1}) = pose.position(:, k)';
    frame.quaternion.(name{1}) = pose.quaternion(:, k)';
  end
end
end

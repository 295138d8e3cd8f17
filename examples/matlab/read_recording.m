% Read frame 3 of a recording as an organised cloud. Written from MATLAB's documentation; no test of ours runs it.
file = 'approach.h5';
k = 3 + 1;                                                                 % MATLAB counts from 1
range_m  = permute(h5read(file, '/range',     [1 1 k], [Inf Inf 1]), [2 1]);   % (row, col), NaN: nothing came back
counts   = permute(h5read(file, '/intensity', [1 1 k], [Inf Inf 1]), [2 1]);   % (row, col)
sight    = permute(h5read(file, '/line_of_sight'), [3 2 1]);               % (row, col, xyz), lidar axes
points_m = double(range_m) .* sight;                                       % (row, col, xyz)
q        = h5read(file, '/truth/tdrs/quaternion')';                        % (time, 4), x y z w; MATLAB's is w x y z
position = h5read(file, '/truth/tdrs/position')';                          % (time, 3) [m], lidar_from_tdrs
imagesc(range_m); axis image; colorbar; title(sprintf('range, %.0f m to the target', norm(position(k, :))));

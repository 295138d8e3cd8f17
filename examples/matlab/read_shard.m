function frames = read_shard(file, names)
% Read arrays of all frames of a shard of a dataset as a struct.
%
% HDF5 stores the frame first, and h5read returns the dimensions in reverse: images become (row, col, frame), vectors
% (frame, component), and numbers (frame, 1). NaN is no return; -1 is the sky in labels, and no target in class_id. A dot
% in a name becomes an underscore. Numbers of classes count from 0; their names are in the attribute "classes" of sensor.h5:
%
%   classes = jsondecode(h5readatt(fullfile(folder, 'sensor.h5'), '/', 'classes'));   % classes{class_id + 1}
frames = struct();
for k = 1:numel(names)
    place = ['/' names{k}];
    values = h5read(file, place);
    if numel(h5info(file, place).Dataspace.Size) > 1
        values = permute(values, [2 1 3]);
    else
        values = values(:);
    end
    frames.(strrep(names{k}, '.', '_')) = values;
end
end

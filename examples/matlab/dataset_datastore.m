function store = dataset_datastore(folder, split, names)
% Datastore of a split of a dataset; each read gives the frames of one shard, a struct of arrays.
%
%   store = dataset_datastore('seven_craft', 'train', {'range_m', 'intensity_counts', 'class_id'});
%   while hasdata(store)
%       frames = read(store);            % frames.range_m is (row, col, frame), frames.class_id is (frame, 1)
%   end
%   store = shuffle(store);              % the order of the shards; shuffle the frames of each after reading
%
% MATLAB reads the shards as they are: no export is needed. fileDatastore partitions them among parallel workers.
% Its part in this file is written from MATLAB's documentation, and no test of ours runs it.
store = fileDatastore(fullfile(folder, split), 'FileExtensions', '.h5', 'ReadFcn', @(file) read_shard(file, names));
end

% Flight software in MATLAB: the twin of pointing.c. NOT RUN by the tests: a text to start from.
% It needs jeromq on the Java class path: javaaddpath('jeromq-0.6.0.jar').
function pointing(endpoint)
    if nargin < 1, endpoint = 'tcp://127.0.0.1:5571'; end
    context = org.zeromq.ZContext();
    socket = context.createSocket(org.zeromq.SocketType.REQ);
    socket.setReceiveTimeOut(60000);
    socket.connect(endpoint);
    ask(socket, struct('request', 'hello', 'version', 1, 'client', 'pointing.m'));
    request = struct('request', 'step');
    sight = []; over = false;
    while ~over
        [header, arrays] = ask(socket, request);
        over = header.is_over;
        if isKey(arrays, 'line_of_sight'), sight = reshape(arrays('line_of_sight'), [], 3); end
        if ~isKey(arrays, 'reading/range_m'), continue, end   % lost on the link: the last command stays
        range_m = reshape(arrays('reading/range_m'), [], 1);
        seen = abs(range_m - median(range_m, 'omitnan')) <= 15;
        if nnz(seen) < 4, continue, end
        toward = sum(sight(seen, :), 1);                      % lidar axes: right, down, ahead
        measured = arrays('pan_tilt_rad');
        x = toward(3); y = -toward(1); z = -toward(2);        % PTU axes
        forward = x * cos(measured(2)) - z * sin(measured(2));
        up = x * sin(measured(2)) + z * cos(measured(2));
        request.command = struct('pan_rad', measured(1) + atan2(y, forward), 'tilt_rad', atan2(up, hypot(forward, y)));
    end
    ask(socket, struct('request', 'shutdown'));
    context.close();
end

function [header, arrays] = ask(socket, request)
    socket.send(jsonencode(request));
    header = jsondecode(native2unicode(typecast(socket.recv(), 'uint8')', 'UTF-8'));
    if ~header.ok, error('%s', header.error.message), end
    arrays = containers.Map();
    kinds = containers.Map({'<f4', '<f8', '<u2', '<i4', '|u1', '|b1'}, ...
                           {'single', 'double', 'uint16', 'int32', 'uint8', 'uint8'});
    for k = 1:numel(header.arrays)
        entry = header.arrays(k);
        values = typecast(typecast(socket.recv(), 'uint8'), kinds(entry.dtype));
        shape = reshape(entry.shape, 1, []);
        if numel(shape) > 1   % C order: the last index runs fastest
            values = permute(reshape(values, flip(shape)), numel(shape):-1:1);
        end
        arrays(entry.name) = double(values);
    end
end

% Write a table of inputs and results of MSS's guidance functions, with which the tests compare.
%
%   octave-cli --path MSS/GNC --path MSS/LIBRARY/kinematics table.m table.csv
%
% MSS: github.com/cybergalactic/MSS, commit 736a3d128ccd5ecb3736eba231bbf046de7bdafa.
% A row is a call: the function, the number of its run, its inputs, its results. Rows `waypoint`
% precede the runs that use them. Functions keep their progress from call to call of a run.

1;

function row(file, name, run, values)
  fprintf(file, '%s,%d', name, run);
  fprintf(file, ',%.17g', values);
  fprintf(file, '\n');
end

% A path of n waypoints, and places near it that pass them all, and go on beyond the last.
function [wpt, places] = walk(n, per_leg, dives)
  turns = cumsum([2 * pi * rand(); pi * (rand(n, 1) - 0.5) * 1.4]);
  lengths = 40 + 40 * rand(n + 1, 1);
  p = [cumsum(lengths .* cos(turns)), cumsum(lengths .* sin(turns))];
  p = [p, 20 + dives * cumsum(lengths .* (rand(n + 1, 1) - 0.5) * 0.6)];
  p(end, 3) = p(end - 1, 3);
  wpt.pos.x = p(1:n, 1);  wpt.pos.y = p(1:n, 2);  wpt.pos.z = p(1:n, 3);
  places = [];
  for k = 1:n
    share = (0:per_leg - 1)' / per_leg;
    places = [places; (1 - share) * p(k, :) + share * p(k + 1, :)];
  end
  places = places + [2, 2, dives] .* randn(size(places));
end

more off
rand('twister', 49);  randn('twister', 49);
file = fopen(argv(){end}, 'w');
n = 5;  per_leg = 14;

for run = 1:4
  dives = run > 2;
  [wpt, places] = walk(n, per_leg, dives);
  clear LOSchi ILOSpsi ALOSpsi ALOS3D
  for k = 1:n
    row(file, 'waypoint', run, [wpt.pos.x(k), wpt.pos.y(k), wpt.pos.z(k)]);
  end
  Delta_h = 5 + 15 * rand();  Delta_v = 5 + 15 * rand();  R = 3 + 4 * rand();
  kappa = 0.5 * rand();  gamma_h = 0.02 * rand();  gamma_v = 0.02 * rand();
  M_theta = 0.03;  h = 0.2 + rand();
  for i = 1:rows(places)
    x = places(i, 1);  y = places(i, 2);  z = places(i, 3);
    if dives
      [psi, theta, y_e, z_e, alpha, beta] = ...
        ALOS3D(x, y, z, Delta_h, Delta_v, gamma_h, gamma_v, M_theta, h, R, wpt);
      row(file, 'ALOS3D', run, [x, y, z, Delta_h, Delta_v, gamma_h, gamma_v, M_theta, h, R, ...
        psi, theta, y_e, z_e, alpha, beta]);
    else
      [chi, y_e] = LOSchi(x, y, Delta_h, R, wpt);
      row(file, 'LOSchi', run, [x, y, Delta_h, R, chi, y_e]);
      [psi, y_e] = ILOSpsi(x, y, Delta_h, kappa, h, R, wpt);
      row(file, 'ILOSpsi', run, [x, y, Delta_h, kappa, h, R, psi, y_e]);
      [psi, y_e, beta, k] = ALOSpsi(x, y, Delta_h, gamma_h, h, R, wpt);
      row(file, 'ALOSpsi', run, [x, y, Delta_h, gamma_h, h, R, psi, y_e, beta, k]);
    end
  end
end

% The observer follows commands that jump, also across +-pi.
for run = 1:3
  K_f = 0.2 + rand();  h = 0.02 + 0.2 * rand();  angle = 2 * pi * rand();  rate = 0;
  command = 2 * pi * rand();
  for i = 1:40
    if rand() < 0.15
      command = 4 * pi * (rand() - 0.5);
    end
    before = [angle, rate];
    [angle, rate] = LOSobserver(angle, rate, command, h, K_f);
    row(file, 'LOSobserver', run, [before, command, h, K_f, angle, rate]);
  end
end

for i = 1:20
  v = 50 * randn(1, 9);
  y_e = crosstrackWpt(v(1), v(2), v(3), v(4), v(5), v(6));
  row(file, 'crosstrackWpt', i, [v(1:6), y_e]);
  p_e = crosstrackWpt3D(v(1:3)', v(4:6)', v(7:9)');
  row(file, 'crosstrackWpt3D', i, [v, p_e']);
  row(file, 'ssa', i, [v(1), ssa(v(1))]);
end
fclose(file);

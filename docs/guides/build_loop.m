% Plant and controller FMU in closed loop, the paper's flight. Both .fmu files are in the current folder.
model = 'QuadrotorLoop';
step = '0.01';                                   % communication step, s
addpath(pwd);                                    % the block looks for FMUs on the MATLAB path
load_system('simulink_extras');
new_system(model);
open_system(model);
set_param(model, 'SolverType', 'Fixed-step', 'Solver', 'FixedStepDiscrete', 'FixedStep', step, 'StopTime', '30');

files = {'controller', 'UnifiedController.fmu'; 'plant', 'QuadrotorPlant.fmu'};
for i = 1:2
    block = [model '/' files{i, 1}];
    add_block('simulink_extras/FMU Import/FMU', block, 'FMUName', files{i, 2});
    set_param(block, 'FMUInputMapping', 'flat', 'FMUOutputMapping', 'flat');   % scalars instead of buses
end

% Ports are taken to be in the order of the model description. Look at the diagram once: the labels say.
plant = get_param([model '/plant'], 'PortHandles');
controller = get_param([model '/controller'], 'PortHandles');
for k = 1:13                                     % position, velocity, quaternion, angular_velocity
    add_line(model, plant.Outport(k), controller.Inport(k), 'autorouting', 'on');
end
for k = 1:4                                      % thrust, torque
    add_line(model, controller.Outport(k), plant.Inport(k), 'autorouting', 'on');
end
for k = 5:7                                      % external_force: none
    ground(model, plant.Inport(k), sprintf('force%d', k));
end
for k = 14:30                                    % reference.*, unused with the built-in trajectory
    ground(model, controller.Inport(k), sprintf('reference%d', k));
end
save_system(model);
out = sim(model);

function ground(model, port, name)
    block = add_block('simulink/Sources/Ground', [model '/' name]);
    from = get_param(block, 'PortHandles');
    add_line(model, from.Outport(1), port);
end

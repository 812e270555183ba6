"""The FMUs of this project."""

MODELS = {
    "UnifiedController": "controller_fmu.sliding_mode.slave:UnifiedController",
    "GeometricController": "controller_fmu.geometric.slave:GeometricController",
    "CascadedController": "controller_fmu.cascaded.slave:CascadedController",
    "QuadrotorPlant": "plant_fmu.slave:QuadrotorPlant",
}
"""FMUs of this project by name, and the slave that each is built from."""
WRAPPED = ".toml"
"""The ending of the file of a controller in C, of which an FMU is made"""
FMI3 = "fmi3"
"""The folder beside such a file where its FMU of FMI 3.0 goes; `fmi3/NAME.toml` stands for that FMU"""
PATHS = (".fmu", WRAPPED)
"""Endings by which the name of an FMU is a path"""
CONTROLLERS = tuple(name for name, slave in MODELS.items() if slave.startswith("controller_fmu."))
"""Those that control a vehicle"""

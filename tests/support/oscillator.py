"""An FMU in C from FMI's standard alone: a mass on a spring with a damper, by its force and its start."""

from benchmarks.foreign_parameters.c_fmu import CSystem, Quantity, build_c_fmu

OSCILLATOR = CSystem(
    inputs={"f": Quantity(0.0, "N")},
    states={"x": Quantity(0.0, "m"), "v": Quantity(0.0, "m/s")},
    parameters={
        "m": Quantity(2.0, "kg", 'min="0.1"'),
        "c": Quantity(10.0, "N/m", 'min="0" max="100"'),
        "d": Quantity(1.0, "N.s/m", 'min="0"'),
        "c3": Quantity(0.0, "N/m3"),
        "unused": Quantity(1.0, "1"),
    },
    equations="der_x = v; der_v = (f - c * x - c3 * x * x * x - d * v) / m;",
)


def build_oscillator(folder, name="oscillator", habit="", left_out=()):
    """Path of the compiled FMU; arguments as of ``build_c_fmu``, ``habit`` by names such as ``V_c``."""
    return build_c_fmu(folder, name, OSCILLATOR, habit, left_out)

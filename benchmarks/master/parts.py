"""Where the time of a step goes: the FMI calls alone, and the step functions alone."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

from .plan import Plan


def time_components(plan: Plan, out: Path) -> dict[str, float]:
    """The step functions inside the FMUs, called from Python in the same closed loop."""
    from fmus.declare import discover, flatten, packer, width
    from fmus.ship import ship

    known = {component.name: component for _, component in discover(ship())}
    values: dict[str, float] = {}
    loop = []
    for name in plan["order"]:
        component = known[plan["models"][name]]
        names = [f"{name}.{v.name}" for v in component.variables]
        values.update(zip(names, (v.start for v in component.variables), strict=True))
        values.update({n: v for n, v in plan["parameters"].items() if n in names})
        first = width(component.params)
        last = first + width(component.inputs)
        params = packer(component.params)([values[n] for n in names[:first]])
        sources = {target: source for source, target in plan["connections"]}
        inputs = [sources.get(n, n) for n in names[first:last]]
        loop.append(
            (component.advance, packer(component.inputs), inputs, params, names[last:], component)
        )
    states = [
        component.init(pack([values[n] for n in inputs]), params)
        for _, pack, inputs, params, _, component in loop
    ]
    ready = [component.prepared(params) for _, _, _, params, _, component in loop]
    spent = 0.0
    for _ in range(plan["steps"]):
        for k, (advance, pack, inputs, _, outputs, _) in enumerate(loop):
            packed = pack([values[n] for n in inputs])
            before = perf_counter()
            states[k], result = advance(states[k], packed, ready[k], plan["step"])
            spent += perf_counter() - before
            values.update(zip(outputs, flatten(result), strict=True))
    before = perf_counter()
    for _ in range(plan["steps"]):
        perf_counter()
    clock = len(loop) * (perf_counter() - before)
    return {"per_step": (spent - clock) / plan["steps"]}


def time_fmi(plan: Plan, out: Path) -> dict[str, float]:
    """The FMI calls of a step and next to nothing else: one copy moves all values at once."""
    import ctypes

    import numpy as np

    from cosim.fmu import FmuModel, LocalInstance

    pointer, size = ctypes.c_void_p.from_param, ctypes.c_size_t.from_param
    used = {*plan["signals"], *(source for source, _ in plan["connections"])}
    sources = {target: source for source, target in plan["connections"]}
    models = {name: FmuModel(Path(path)) for name, path in plan["fmus"].items()}
    got = [f"{n}.{v}" for n, m in models.items() for v in m.variables if f"{n}.{v}" in used - {*sources}]
    set_ = [f"{n}.{v}" for n, m in models.items() for v in m.variables if f"{n}.{v}" in sources]
    outputs, inputs = np.zeros(len(got)), np.zeros(len(set_))
    calls: list[tuple[Callable[..., int], list[Any]]] = []
    time = ctypes.c_double()
    kept: list[Any] = []

    def bind(instance: LocalInstance, function: str, names: list[str], table: np.ndarray) -> None:
        own = [n for n in names if n.startswith(f"{instance.name}.")]
        if own:
            numbers = [instance.model.variables[n.partition(".")[2]].reference for n in own]
            references = (ctypes.c_uint * len(own))(*numbers)
            kept.append(references)
            address = table.ctypes.data + 8 * names.index(own[0])
            arguments = (instance.component.pointer, ctypes.addressof(references), len(own), address)
            convert = (pointer, pointer, size, pointer)
            converted = [to_c(value) for to_c, value in zip(convert, arguments, strict=True)]
            calls.append((instance.component.function(function), converted))

    for name, model in models.items():
        instance = LocalInstance(name, model, lambda *message: None)
        kept.append(instance)
        instance.set_up(plan["steps"] * plan["step"])
        for parameter, value in plan["parameters"].items():
            if parameter.startswith(f"{name}."):
                instance.set_value(model.variables[parameter.partition(".")[2]], value)
        instance.enter_initialization()
        instance.exit_initialization()
        bind(instance, "fmi2SetReal", set_, inputs)
        length, flag = ctypes.c_double.from_param(plan["step"]), ctypes.c_int.from_param(1)
        component = pointer(instance.component.pointer)
        calls.append((instance.component.function("fmi2DoStep"), [component, time, length, flag]))
        bind(instance, "fmi2GetReal", got, outputs)
    order = np.array([got.index(sources[n]) for n in set_])
    before = perf_counter()
    for k in range(plan["steps"]):
        time.value = k * plan["step"]
        for function, arguments in calls:
            if function(*arguments) > 1:
                raise RuntimeError(f"an FMI call failed at step {k}")
        outputs.take(order, out=inputs)
    spent = perf_counter() - before
    for model in models.values():
        model.close()
    return {"per_step": spent / plan["steps"]}

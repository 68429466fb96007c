"""Other controllers and observers that fit into a scenario in place of one of its FMUs."""

from collections.abc import Iterator

from ..errors import InputError
from ..fmu.fmu_model import FmuModel
from ..system.own_fmus import builder_options, run_builder
from ..system.preparation import prepare
from ..system.start_values import Overrides
from ..system.system import System
from .snapshot import Part, packed, ports


def alternatives(system: System, slots: dict[str, int], overrides: Overrides) -> list[Part]:
    """The choices for each instance that has some.

    Args:
        system: prepared; all its FMUs are the project's own.
        slots: of its signals in the value table.
        overrides: parameter sets of the run.

    Returns:
        For each such instance ``fmu``, its place in the order, and ``options``, an FMU each.
    """
    options = builder_options(system.scenario, native=False)
    listed = [line.split()[0] for line in run_builder("--list", *options)]
    changed = {e.model for e in system.scenario.events}
    fed = {c.target.instance for c in system.connections}
    found = []
    for instance in (name for name in system.order if name in fed - changed):
        kind = system.models[instance].name.partition("_")[0]
        names = [n for n in listed if n.startswith(f"{kind}_") and n != system.models[instance].name]
        paths = run_builder(*options, "--", *names) if names else []
        fitting = [*_fitting(system, instance, paths, slots, overrides)]
        if fitting:
            found.append({"fmu": system.order.index(instance), "options": fitting})
    return found


def _fitting(
    system: System, instance: str, paths: list[str], slots: dict[str, int], overrides: Overrides
) -> Iterator[Part]:
    """The FMUs that are connected as the one in the scenario is, as far as others see it."""
    seen = _connections_elsewhere(system, instance)
    for path in paths:
        model = FmuModel(system.scenario.folder / path)
        entry = system.scenario.fmus[instance]
        known = {k: v for k, v in entry.parameters.items() if k in model.variables}
        chosen = entry.model_copy(update={"path": model.path.name, "parameters": known, "table": None})
        scenario = system.scenario.model_copy(
            update={"fmus": {**system.scenario.fmus, instance: chosen}}
        )
        try:
            other = prepare(scenario, overrides, models={**system.models, instance: model})
        except InputError:
            continue
        if _connections_elsewhere(other, instance) == seen:
            yield _option(other, instance, slots)


def _connections_elsewhere(system: System, instance: str) -> set[tuple[str, str]]:
    links = [c for c in system.connections if c.target.instance != instance]
    return {(c.source.name, c.target.name) for c in links}


def _option(other: System, instance: str, slots: dict[str, int]) -> Part:
    """An FMU with its start values and connections; its inputs beyond the table get slots behind it."""
    model, incoming = (
        other.models[instance],
        [c for c in other.connections if c.target.instance == instance],
    )
    known, given = dict(slots), {v.name: value for v, value in other.parameters[instance]}
    for c in incoming:
        known.setdefault(c.target.name, len(known))
    own = sorted(model.variables.values(), key=lambda v: v.reference)
    starts = [float(given.get(v.name, v.start or 0.0)) for v in own if v.causality != "output"]
    put = [c.target for c in incoming]
    got = [
        s for s in other.signals.values() if s.instance == instance and s.variable.causality == "output"
    ]
    return {
        "module": model.name,
        "values": packed(starts),
        "copies": [[known[c.target.name], known[c.source.name], 1] for c in incoming],
        **ports(known, put, [s for s in got if s.name in slots]),
    }

"""Stand-ins for parts of the diagnosis that are not there yet; importing this puts them in place."""

import json
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace

from cosim import InputError, ssv

HOME = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
EMPTY = (
    f'<ParameterSet xmlns="{HOME}" version="1.0" name="model"><Parameters>%s</Parameters></ParameterSet>'
)


def write_model(path, model):
    values = {
        f"{part}.{n}": x for part in ("vessel", "thrusters") for n, x in getattr(model, part).items()
    }
    rows = [f'<Parameter name="{n}"><Real value="{x!r}"/></Parameter>' for n, x in values.items()]
    Path(path).write_text(EMPTY % "".join(rows))


def read_model(path):
    from diagnosis.model import START, Model

    given = {part: {n: p.value for n, p in of.items()} for part, of in ssv.read_parameters(path).items()}
    for part, values in given.items():
        for name in values:
            if name not in START.get(part, {}):
                raise InputError(f"'{path}': no parameter {part}.{name}")
    return Model(given.get("vessel", {}), given.get("thrusters", {}))


def check(model, nominal, advance):
    bounded = model.vessel.get("delta_X_u", 0.0) < 10.0
    return SimpleNamespace(
        nominal_min_dissipation=0.1,
        learned_min_dissipation=0.2,
        bounded=bounded,
        region=None,
        mass_definite=True,
        notes=(),
        safe=bounded,
    )


def write_report(path, result, evidence, omega_std=None, shapes=None, advance=None):
    Path(path).write_text(f"<html><pre>{json.dumps(result)}</pre></html>")


for name, parts in {
    "parameter_set": (write_model, read_model),
    "stability": (check,),
    "report": (write_report,),
}.items():
    if find_spec(f"diagnosis.{name}") is None:
        module = ModuleType(f"diagnosis.{name}")
        vars(module).update({part.__name__: part for part in parts})
        sys.modules[module.__name__] = module

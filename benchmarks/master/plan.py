"""What all timed runs share: the FMUs, the system in the forms that tools read, what is logged."""

import json
import re
import shutil
import zipfile
from pathlib import Path
from typing import Any

import cosim
from cosim.export import export_fmu
from cosim.system import prepare

ROOT = Path(__file__).parent.parent.parent
SCENARIO = ROOT / "scenarios" / "ellipse.json"
# Logged are all outputs but these, and the disturbed measurements that reach the observer.
NOT_LOGGED = re.compile(
    r"vessel\.(\w+_m|omega_star_\w+)|controller\.(tau_lin_\w+|tau_nonlin_\w+|omega_hat_\w+)"
)
ALSO_LOGGED = ["observer.x_m", "observer.y_m", "observer.psi_m"]

Plan = dict[str, Any]


def make_plan(work: Path, steps: int, native: bool) -> Plan:
    """Everything that the processes need to know, so that no tool has to find it out in its own time."""
    system = prepare(cosim.load_scenario(json.loads(SCENARIO.read_text()) | {"native": native}))
    fmus = {name: work / "resources" / f"{name}.fmu" for name in system.models}
    (work / "resources").mkdir()
    for name, path in fmus.items():
        shutil.copyfile(system.models[name].path, path)
    outputs = [n for n, s in system.signals.items() if s.variable.causality == "output"]
    content = system.scenario.model_dump(mode="json", by_alias=True)
    # The FMUs are files from here on; the step loop is the usual one.
    content |= {"stop": steps * system.scenario.step, "metrics": {}, "native": "auto"}
    for name, path in fmus.items():
        content["fmus"][name]["path"] = str(path)
    plan = {
        "work": str(work),
        "steps": steps,
        "step": system.scenario.step,
        "scenario": content,
        "fmus": {name: str(path) for name, path in fmus.items()},
        "models": {name: model.name for name, model in system.models.items()},
        "order": system.order,
        "connections": [[c.source.name, c.target.name] for c in system.connections],
        "parameters": {
            f"{name}.{v.name}": value
            for name, values in system.parameters.items()
            for v, value in values
        },
        "signals": [*(n for n in outputs if not NOT_LOGGED.fullmatch(n)), *ALSO_LOGGED],
    }
    system.close()
    (work / "default_workers.ssd").write_text(_ssd(plan, ""))
    with zipfile.ZipFile(work / "system.ssp", "w") as archive:
        archive.write(work / "default_workers.ssd", "SystemStructure.ssd")
        for path in fmus.values():
            archive.write(path, f"resources/{path.name}")
    plan["no_container"] = _export_container(content, work / "system.fmu")
    (work / "0_workers.ssd").write_text(_ssd(plan, 'numWorkerThreads="0"'))
    (work / "LogConfig.xml").write_text(_log_config(plan))
    (work / "plan.json").write_text(json.dumps(plan))
    return plan


def _export_container(content: dict[str, Any], path: Path) -> str:
    """The whole system as one FMU, with values exchanged once a step; returns why there is none."""
    system = prepare(cosim.load_scenario(content | {"algorithm": "jacobi", "faults": []}))
    try:
        export_fmu(system, path)
    except cosim.InputError as error:
        return str(error)
    finally:
        system.close()
    return ""


def _ssd(plan: Plan, workers: str) -> str:
    """The system as an SSP system structure with libcosim's annotation for its algorithm."""
    components = []
    for name in plan["fmus"]:
        ends = {(target, "input") for _, target in plan["connections"]}
        ends |= {(name, "output") for name in [*(s for s, _ in plan["connections"]), *plan["signals"]]}
        ends -= {(target, "output") for _, target in plan["connections"]}
        connectors = "".join(
            f'<ssd:Connector name="{end.partition(".")[2]}" kind="{kind}"><ssc:Real/></ssd:Connector>'
            for end, kind in sorted(ends)
            if end.startswith(f"{name}.")
        )
        components.append(
            f'<ssd:Component name="{name}" source="resources/{name}.fmu">'
            f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
        )
    connections = []
    for source, target in plan["connections"]:
        (start, output), (end, input_) = source.split("."), target.split(".")
        connections.append(
            f'<ssd:Connection startElement="{start}" startConnector="{output}"'
            f' endElement="{end}" endConnector="{input_}"/>'
        )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription name="loop" version="1.0"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">
  <ssd:System name="loop">
    <ssd:Elements>{"".join(components)}</ssd:Elements>
    <ssd:Connections>{"".join(connections)}</ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0.0">
    <ssd:Annotations>
      <ssc:Annotation type="com.opensimulationplatform">
        <osp:Algorithm>
          <osp:FixedStepAlgorithm baseStepSize="{plan["step"]}" {workers}/>
        </osp:Algorithm>
      </ssc:Annotation>
    </ssd:Annotations>
  </ssd:DefaultExperiment>
</ssd:SystemStructureDescription>
"""


def _log_config(plan: Plan) -> str:
    """Which signals libcosim's file observer writes."""
    simulators = []
    for name in plan["fmus"]:
        own = [n.partition(".")[2] for n in plan["signals"] if n.startswith(f"{name}.")]
        variables = "".join(f'<variable name="{variable}"/>' for variable in own)
        simulators.append(f'<simulator name="{name}" decimationFactor="1">{variables}</simulator>')
    return f"<simulators>{''.join(simulators)}</simulators>"

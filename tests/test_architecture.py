"""Imports between the packages go one way, in the order stated here, and use public names only.

Imports are read from the source: also those inside functions, those for type checking only, and the names that
an ``__init__`` imports on demand, from the stub beside it (``lazy_names``).
"""

import ast
import re
from collections import Counter
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import import_module

import pytest
from support.project import ROOT
from support.syntax import nodes

# Each may import those before it, and nothing else of the project.
PACKAGES = ("fmus", "fmucheck", "cosim", "diagnosis", "cybership", "studies", "thesis", "benchmarks")

# The modules and packages directly in cosim, lowest first; each line may import the lines before it only.
COSIM_LAYERS = (
    ("lazy", "errors", "files", "process"),
    ("interrupts", "conversion"),
    ("command",),
    ("compiled",),
    ("fmu",),
    ("formats",),
    ("scenario",),
    ("system",),
    ("results",),
    ("trials",),
    ("master", "supervision"),
    ("dispatch",),
    ("export", "campaign", "live"),
    ("simulating", "run", "metrics", "plots", "interface"),  # Python, commands
)

# The same of diagnosis: the steps of the work, in their order.
DIAGNOSIS_LAYERS = (
    ("moved",),
    ("execution",),
    ("runs",),
    ("predictors",),
    ("search", "assessment"),
    ("verdict",),
    ("session",),
    ("report",),
    ("design",),
    ("acceptance",),
    ("fmu_parameters",),
    ("commands",),
    ("interactive",),
    (
        "compare",
        "criteria",
        "design_run",
        "join",
        "learn",
        "linearise",
        "measure_trial",
        "parameters",
        "propose_columns",
        "repair",
        "verify",
    ),  # commands
)
# And of fmus: what all components share, effects, components, the ship of them, their FMI face, the same in C,
# the tools.
FMUS_LAYERS = (
    ("ops", "declare", "base_units", "signals"),
    ("docstring", "interruption"),
    ("scale",),
    ("ship_description",),
    ("hull_functions",),
    ("frames", "hull", "sizing"),
    ("effects",),
    ("installed",),
    ("actuators",),
    ("controller", "guidance", "observer", "thrusters", "vessel"),
    ("watch",),
    ("ships",),
    ("ship", "addition"),
    ("fmi",),
    ("native",),
    ("build",),
    ("check",),
)
LAYERS = {"cosim": COSIM_LAYERS, "diagnosis": DIAGNOSIS_LAYERS, "fmus": FMUS_LAYERS}

# What other packages may import of cosim: these modules, with their ``__all__``.
PUBLIC = (
    "cosim",
    "cosim.campaign",
    "cosim.command",
    "cosim.dispatch",
    "cosim.errors",
    "cosim.export",
    "cosim.fmu",
    "cosim.master",
    "cosim.results",
    "cosim.scenario",
    "cosim.system",
)
# diagnosis reads logs and parameter sets, asks FMUs for their variables, plays a run to FMUs, and writes a
# foreign one together with what was found beside it.
PUBLIC_TO_DIAGNOSIS = (
    "cosim.campaign",  # of an ensemble: what is known of parameters
    "cosim",
    "cosim.command",
    "cosim.errors",
    "cosim.export",
    "cosim.fmu",
    "cosim.interrupts",
    "cosim.lazy",
    "cosim.process",
    "cosim.results",
    "cosim.scenario",  # shipped ones, for the stability of the closed loop
    "cosim.supervision",
    "cosim.system",
    "cosim.trials",
)
# The methods of the thesis are commands, and play runs to FMUs by the master.
PUBLIC_TO_THESIS = (*PUBLIC, "cosim.lazy", "cosim.process", "cosim.supervision")
# What studies, thesis and benchmarks may import of fmus, beside the modules of components: what is public to files of
# components and effects of a user's own. A module without ``__all__`` offers what it defines.
PUBLIC_OF_FMUS = (
    "fmus.actuators.response",
    "fmus.build",
    "fmus.declare",
    "fmus.effects",
    "fmus.effects.text",
    "fmus.effects.linear_map",
    "fmus.frames",
    "fmus.hull",
    "fmus.ops",
    "fmus.ship",
    "fmus.ships.ship_file",
    "fmus.signals",
    "fmus.actuators.law",
    "fmus.actuators.laws",
)
COMPONENTS = ("controller", "guidance", "observer", "thrusters", "vessel", "watch")
PUBLIC_OF_DIAGNOSIS = (
    "diagnosis",
    "diagnosis.assessment",
    "diagnosis.commands",
    "diagnosis.design",
    "diagnosis.execution",
    "diagnosis.execution.progress",
    "diagnosis.moved",
    "diagnosis.predictors",
    "diagnosis.report",
    "diagnosis.runs",
    "diagnosis.search",
)

# File names that Python demands in several packages.
SHARED_NAMES = ("__init__", "__main__")


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def sources(package):
    """Module -> path of each file of a package."""
    return {module_name(path): path for path in sorted((ROOT / package).rglob("*.py"))}


@cache
def known():
    return {name for package in PACKAGES for name in sources(package)}


def absolute(module, node, path):
    """The module that ``from ... import`` names."""
    if not node.level:
        return node.module or ""
    parts = module.split(".")
    base = parts[: len(parts) - node.level + (path.name == "__init__.py")]
    return ".".join([*base, *([node.module] if node.module else [])])


def on_demand(module, node):
    """Modules that a call ``import_module`` names."""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        return
    if node.func.id == "import_module" and isinstance(node.args[0], ast.Constant):
        name = node.args[0].value
        yield f"{module}{name}" if name.startswith(".") else name


def statements(path):
    """All nodes of a file, and of the stub that says what an ``__init__`` imports on demand."""
    for each in (path, path.with_suffix(".pyi")):
        if each.exists():
            yield from nodes(each)


@cache
def imports(module, path):
    """(imported module, imported name or "") of each import of a file, of this project only."""
    found = []
    for node in statements(path):
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = absolute(module, node, path)
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                found.append((inner, "") if inner in known() else (base, alias.name))
        else:
            found += [(name, "") for name in on_demand(module, node)]
    return [(name, what) for name, what in found if name in known()]


def graph(package):
    return {
        module: {name for name, _ in imports(module, path)} for module, path in sources(package).items()
    }


def layer_of(module):
    package, head = module.split(".")[:2]
    return next((k for k, names in enumerate(LAYERS[package]) if head in names), None)


@cache
def public_names(module):
    """The ``__all__`` of a module; without one what it defines, but for names that begin with an underscore."""
    path = sources(module.partition(".")[0])[module]
    stub = path.with_suffix(".pyi")
    if stub.exists():
        return [alias.asname for node in nodes(stub)[0].body for alias in getattr(node, "names", [])]
    defined = []
    for node in nodes(path)[0].body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and ast.unparse(targets[0]) == "__all__":
            assert node.value is not None
            return ast.literal_eval(node.value)
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            defined.append(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            defined += [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
    assert path.name != "__init__.py", f"{module} has no __all__"
    return [name for name in defined if not name.startswith("_")]


def module_aliases(module, path):
    """Local name -> module of this project that an import statement binds to it."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name in known() and (alias.asname or "." not in alias.name):
                    yield alias.asname or alias.name, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = absolute(module, node, path)
            for alias in node.names:
                if f"{base}.{alias.name}" in known():
                    yield alias.asname or alias.name, f"{base}.{alias.name}"


@cache
def attributes(module, path):
    """(module, attribute) of each ``module.attribute`` where the module is one of this project."""
    aliases = dict(module_aliases(module, path))
    return [
        (aliases[node.value.id], node.attr)
        for node in nodes(path)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in aliases
    ]


def foreign_uses(package, other, allowed):
    """What a package uses of another one besides public names of the allowed modules."""
    for module, path in sources(package).items():
        for name, what in [*imports(module, path), *attributes(module, path)]:
            if name.partition(".")[0] != other:
                continue
            if name not in allowed:
                yield f"{module} imports {name}"
            elif what and what not in public_names(name):
                yield f"{module} uses {name}.{what}"


@pytest.mark.parametrize("package", ["cosim", "fmus", "fmucheck", "diagnosis", "studies", "thesis"])
def test_no_import_circles(package):
    try:
        TopologicalSorter(graph(package)).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


@pytest.mark.parametrize("package", LAYERS)
def test_packages_import_one_way(package):
    wrong = []
    for module, targets in graph(package).items():
        if module == package or module.endswith(".__main__"):  # a command
            continue
        own = layer_of(module)
        assert own is not None, f"{module} is in no layer"
        for target in (t for t in targets if t.startswith(f"{package}.")):
            same = module.split(".")[1] == target.split(".")[1]
            # Modules that lie directly in a package may use others of their layer; circles have a test.
            beside = layer_of(target) == own and module.count(".") == target.count(".") == 1
            if not same and not beside and layer_of(target) >= own:
                wrong.append(f"{module} -> {target}")
        if package in targets:
            wrong.append(f"{module} -> {package}")
    assert not wrong


def test_modules_import_modules_inside_cosim():
    """A package's lazy ``__init__`` would hide which of its modules is meant, and so hide circles."""
    packages = {name for name, path in sources("cosim").items() if path.name == "__init__.py"}
    for module, targets in graph("cosim").items():
        assert not targets & packages, module


# What any command shares, whatever it is about.
SHARED = {
    f"cybership.{n}"
    for n in (
        "command_arguments",
        "message_text",
        "model_fault",
        "renamed",
        "scratch_folder",
        "standard_streams",
        "user_cache",
    )
}


@pytest.mark.parametrize("package", ["fmus", "cosim"])
def test_packages_below_import_nothing_of_others(package):
    for module, targets in graph(package).items():
        if module != "fmus.check":  # where the command of fmucheck is called
            assert {name.partition(".")[0] for name in targets - SHARED} <= {package}, module


def test_checks_know_the_build_and_nothing_of_the_ship():
    """Beside that only what any command shares: they hold anybody's FMUs against the standard."""
    shared = SHARED | {
        f"fmus.{n}" for n in ("base_units", "build", "declare", "docstring", "interruption")
    }
    for module, targets in graph("fmucheck").items():
        assert {name for name in targets if not name.startswith("fmucheck")} <= shared, module


@pytest.mark.parametrize(
    ("package", "allowed"),
    [
        ("diagnosis", PUBLIC_TO_DIAGNOSIS),
        ("studies", PUBLIC),
        ("thesis", PUBLIC_TO_THESIS),
        ("benchmarks", PUBLIC),
    ],
)
def test_other_packages_use_public_names_of_cosim(package, allowed):
    assert list(foreign_uses(package, "cosim", allowed)) == []


# Time, calibration and constants of single parts of the diagnosis.
MEASURE_PARTS = (
    "benchmarks.calibration",
    "benchmarks.error_budget",
    "benchmarks.fit_drivers",
    "benchmarks.foreign_parameters.coverage",
    "benchmarks.learning_time",
    "benchmarks.next_pool",
    "benchmarks.next_run",
    "benchmarks.sensitivity.on_evidence",
)


@pytest.mark.parametrize("package", ["studies", "thesis", "benchmarks"])
def test_studies_thesis_and_benchmarks_use_public_names(package):
    components = [
        name for name in sources("fmus") if name.split(".")[1:2] and name.split(".")[1] in COMPONENTS
    ]
    found = [
        *foreign_uses(package, "fmus", (*PUBLIC_OF_FMUS, *components)),
        *foreign_uses(package, "diagnosis", PUBLIC_OF_DIAGNOSIS),
    ]
    assert [use for use in found if use.partition(" ")[0] not in MEASURE_PARTS] == []


@pytest.mark.parametrize("package", [name for name in PACKAGES if name not in ("thesis", "benchmarks")])
def test_nothing_of_the_product_imports_the_thesis(package):
    """Its commands are found by entry points, its old names by :mod:`diagnosis.moved`."""
    for module, targets in graph(package).items():
        assert not [name for name in targets if name.partition(".")[0] == "thesis"], module


def test_what_tests_share_is_in_support():
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        used = re.findall(r"^\s*from\s+([\w.]+)\s+import\b", path.read_text("utf-8"), re.M)
        assert not [name for name in used if name.split(".")[-1].startswith("test_")], path.name


def test_the_thesis_takes_of_the_studies_what_they_share():
    used = {
        name for targets in graph("thesis").values() for name in targets if name.startswith("studies")
    }
    assert used == {"studies.measured.data_folder", "studies.study_command", "studies.study_report"}


@pytest.mark.parametrize("module", PUBLIC_OF_DIAGNOSIS)
def test_public_names_of_diagnosis_exist(module):
    names = public_names(module)
    found = __import__(module, fromlist=names)
    assert all(hasattr(found, name) for name in names)


@pytest.mark.parametrize(
    "module", [name for name, path in sources("cosim").items() if path.name == "__init__.py"]
)
def test_public_names_exist_and_are_told(module):
    names = public_names(module)
    found = import_module(module)
    assert all(hasattr(found, name) for name in names)
    assert getattr(found, "__all__", names) == sorted(names)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        found.nothing  # noqa: B018


@pytest.mark.parametrize("package", PACKAGES)
def test_file_names_are_unique(package):
    """Against every other package too: a name in a traceback or an editor's tab means one file."""
    own = [path.stem for path in sources(package).values()]
    others = [path.stem for other in PACKAGES if other != package for path in sources(other).values()]
    names = [name for name in own if name not in SHARED_NAMES]
    assert sorted(names) == sorted(set(names))
    assert not set(names) & set(others) - ALSO_ELSEWHERE


# A component has classes of these names, see CONTRIBUTING.md.
OF_COMPONENTS = {"Inputs", "Outputs", "Params", "State"}


def test_a_class_name_has_one_meaning():
    homes: dict[str, list[str]] = {}
    for package in ("fmus", "fmucheck", "cosim", "cybership", "diagnosis", "studies", "thesis"):
        for module, path in sources(package).items():
            for node in nodes(path):
                if isinstance(node, ast.ClassDef):
                    homes.setdefault(node.name, []).append(module)
    assert {n: m for n, m in homes.items() if len(m) > 1 and n not in OF_COMPONENTS} == {}


# cosim.command is a public path; thesis.allocation, benchmarks.constants and benchmarks.ellipse are commands,
# fmus and diagnosis have files of these names.
ALSO_ELSEWHERE = {"command", "allocation", "constants", "ellipse"}


@pytest.mark.parametrize(("package", "most"), [("cosim", 12), ("diagnosis", 16)])
def test_a_folder_is_a_table_of_contents(package: str, most: int):
    folders = Counter(path.parent for path in sources(package).values())
    assert {folder: n for folder, n in folders.items() if n > most} == {}


# Words for the parts of one ship, in names and texts of the code; docstrings may name it as the reference.
PARTS = re.compile(
    r"(?<![a-z])(vsp\d?|bow(?! to))(?![a-z])|^((matlab_)?five|otter|cse1|kvlcc2|gunnerus)$",
    re.IGNORECASE,
)
# The name of the default ship, whose parts are named in its file; and what the bow of any ship is called in
# other languages.
OF_ONE_SHIP = {"fmus.ships.naming", "diagnosis.runs.columns.name_words"}


def words(path):
    """Names and texts of a file's code, docstrings left out."""
    docs = {
        node.body[0].value
        for node in nodes(path)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node)
    }
    for node in nodes(path):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in docs:
            yield node.value
        for name in ("id", "attr", "arg", "name"):
            if isinstance(value := getattr(node, name, None), str):
                yield value


@pytest.mark.parametrize("package", ["fmus", "cosim", "diagnosis"])
def test_nothing_more_names_the_parts_of_one_ship(package):
    """What is exempt only gets less: another file that names a thruster or a ship is a step back."""
    found = {name for name, path in sources(package).items() if any(map(PARTS.search, words(path)))}
    assert found == {name for name in OF_ONE_SHIP if name.startswith(package)}

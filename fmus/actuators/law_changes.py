"""What the law of an actuator may have otherwise than described: an effect for each, by its law."""

from collections.abc import Sequence

from ..declare import Fields, Variable, variables
from ..effects.devices import parameter
from ..effects.effect import Effect, Search, Wording, effect
from ..effects.text import Found
from ..hull_functions import Change
from ..ops import Number
from .actuator import Actuator, twins


def additions(
    change: Change, known: Sequence[Variable], stem: str = "", of: str = ""
) -> tuple[Variable, ...]:
    """Parameters of an effect, one for each that may be otherwise than described: what is added to it.

    Args:
        change: which.
        known: the parameters of the law, or of the function of the hull.
        stem: of the names.
        of: what descriptions end with.
    """
    by_name = {v.name: v for v in known}
    found = [(f"delta_{stem}{name}", by_name[name]) for name in change.parameters]
    return tuple([parameter(d, v.unit, f"addition to {v.description}{of}") for d, v in found])


def differs(change: Change, parameters: Sequence[Variable], f: Found) -> str:
    """The end of a finding: how much is added to what is described."""
    stated = [f"{f[v.name]:+.3g} {v.unit}".removesuffix(" 1") for v in parameters]
    return f"{change.text} differs from the model by {', '.join(stated)}."


def changed(alike: Sequence[Actuator], change: Change) -> Effect:
    """Parameters of a law that are others than described, of some actuators by as much.

    Args:
        alike: actuators with the same law: those that share its commands, or twins.
        change: of that law.
    """
    a = alike[0]
    order = "_".join(dict.fromkeys([b.order for b in alike]))
    name, title = f"{change.stem}_{order}", " and ".join([b.part.title for b in alike])
    parameters = additions(change, variables(a.law.Parameters), f"{order}_", f": {title}")

    @effect(
        name,
        "actuator",
        "XYN",
        parameters=parameters,
        wording=Wording(lambda f: f"The {title}: {differs(change, parameters, f)}", a.devices.family),
        gives="parameters",
        adds_to={
            v.name: tuple([f"plant_{b.part.name}_{n}" for b in alike])
            for v, n in zip(parameters, change.parameters, strict=True)
        },
        formula=f"{', '.join(change.parameters)} + δ, in the law {a.law.name}",
        symbol="δ",
        sign="an addition to the described value",
        linear=False,
        search=Search(differentiable=True),
        description=f"{change.text}: {title}",
    )
    def function(plant: Fields, *additions: Number) -> Fields:
        for b in alike:
            own = plant[b.k]
            places = [b.law.Parameters._fields.index(p) for p in change.parameters]
            more = {own._fields[k]: own[k] + d for k, d in zip(places, additions, strict=True)}
            plant = plant._replace(**{b.part.name: own._replace(**more)})
        return plant

    return function


def changes(every: Sequence[Actuator]) -> list[Effect]:
    """What the laws of a ship's actuators may have otherwise than described, also of twins alike."""
    alike = [[b for b in every if (b.order, b.law) == (a.order, a.law)] for a in every if a.leads]
    return [changed(some, change) for some in [*alike, *twins(every)] for change in some[0].law.changes]

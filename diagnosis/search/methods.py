"""Methods of identification behind one interface, and the table of those that there are."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from cosim import InputError

from ..execution.progress import Advance
from ..execution.user_files import chosen

if TYPE_CHECKING:
    from ..predictors import Model, WeakWindows
    from .findings import Findings
    from .prior import Prior


@runtime_checkable
class Method(Protocol):
    """A way to find which effects a model lacks.

    A method is called once for a set of runs. It may take any time, and tells ``advance`` what it is
    doing; an interrupt passes through it. It guarantees that

    - it changes nothing that it was given but ``WeakWindows.memory``, a store of intermediate results;
    - the same arguments give the same findings, to the bit on one machine;
    - ids are those of effects in ``model.ship``, each once; values are additions to ``model``;
    - ``findings.model`` is ``model`` with all effects found, and ``model`` itself without any;
    - each finding's model is the model with it and all earlier ones;
    - confidence is a probability, or NaN where the method knows none.

    Attributes:
        name: of the method.
    """

    name: str

    def fit(
        self, runs: "Sequence[WeakWindows]", model: "Model", prior: "Prior", advance: Advance, seed: int
    ) -> "Findings":
        """The effects that a model lacks.

        Args:
            runs: windows of every training run, at least one.
            model: to start from.
            prior: relative standard deviation of every nominal coefficient, or of those named; 0: exact;
                None: as the ship declares it.
            advance: receives the name of each step, a few words each.
            seed: of everything random.

        Raises:
            InputError: the method cannot work on such data, or needs what is not installed.
        """
        ...


# Name -> module and class; imported when it is chosen, as some need further libraries.
METHODS = {
    "selection": ("forward_selection", "ForwardSelection"),
    "pls": ("peers", "PartialLeastSquares"),
    "sindy": ("peers", "SparseRegression"),
}
DEFAULT = "selection"


def method(name: str = DEFAULT) -> Method:
    """A method by its name.

    Args:
        name: one of :data:`METHODS`, or a user's Python file that ends with ``METHOD = ...``, an object
            with the interface of :class:`Method`.

    Raises:
        InputError: there is none of this name, it needs what is not installed, or the file fails.
    """
    try:
        found = chosen(name, METHODS, __package__, "method", "METHOD")
        found = found() if name in METHODS else found
    except ModuleNotFoundError as error:
        library = (error.name or "a library").partition(".")[0]
        raise InputError(f"method '{name}' needs {library}: pip install 'cybership[analysis]'") from None
    if not isinstance(found, Method) or isinstance(found, type):
        raise InputError(f"'{name}' has no METHOD = ..., an object with a name and a function fit")
    return found

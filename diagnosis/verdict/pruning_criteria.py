"""Criteria of pruning behind one interface, and the table of those that there are."""

from typing import TYPE_CHECKING, Protocol, cast

from cosim import InputError

from ..execution.user_files import chosen, takes

if TYPE_CHECKING:
    from ..search.significance import Losses


class Harm(Protocol):
    """Whether an effect does harm on the data that decide.

    A criterion is a pure function of the losses. It guarantees that a model does itself no harm: with
    the same losses twice and no further parameters the answer is empty.
    """

    def __call__(self, its: "Losses", others: "Losses", more: int) -> str:
        """In what a model with an effect is worse than one without.

        Args:
            its, others: losses of the models with and without the effect.
            more: number of parameters that the first has in addition.

        Returns:
            Part of a sentence, with ``{where}`` in place of the data; empty: in nothing.
        """
        ...


# Name -> module of the package and its function.
CRITERIA = {"paired": ("search.significance", "harm"), "bic": ("verdict.information_criterion", "harm")}
PAIRED = "paired"
PACKAGE = __name__.partition(".")[0]


def criterion(name: str = PAIRED) -> Harm:
    """A criterion of pruning by its name.

    Args:
        name: one of :data:`CRITERIA`, or a user's Python file with a function ``harm`` as in
        :class:`Harm`.

    Raises:
        InputError: there is none of this name, or the file fails.
    """
    found = chosen(name, CRITERIA, PACKAGE, "criterion of pruning", "harm")
    if not takes(found, 3):
        raise InputError(f"'{name}' has no function harm(its, others, more)")
    return cast(Harm, found)

"""Order of execution: sources before their followers at the same instant, loops reported by name."""

import itertools

from cosim.system.order import Link, execution_order

# The closed loop as its FMUs declare it: the vessel's pose follows no input at the same instant.
LINKS = [
    Link("vessel", "x_m", "observer", "x_m"),
    Link("observer", "x_hat", "controller", "x_hat"),
    Link("guidance", "x_t", "controller", "x_t"),
    Link("controller", "tau", "thrusters", "tau"),
    Link("thrusters", "tau_act", "vessel", "tau"),
]
FEEDTHROUGH = {
    "vessel": {"tau": ["u_dot"]},
    "observer": {"x_m": ["x_hat"]},
    "controller": {"x_hat": ["tau"], "x_t": ["tau"]},
    "guidance": {},
    "thrusters": {"tau": ["tau_act"]},
}


def test_every_listing_of_the_closed_loop_gives_no_delay():
    for names in itertools.permutations(FEEDTHROUGH):
        order, warnings = execution_order(names, LINKS, FEEDTHROUGH)
        assert warnings == []
        place = {name: k for k, name in enumerate(order)}
        assert place["vessel"] < place["observer"] < place["controller"] < place["thrusters"]
        assert place["guidance"] < place["controller"]


def test_scenario_decides_where_nothing_else_does():
    for names in itertools.permutations("abc"):
        assert execution_order(names, [], {n: {} for n in names})[0] == list(names)


def test_algebraic_loop_is_named_and_cut():
    links = [*LINKS, Link("vessel", "u_dot", "controller", "x_hat")]
    order, warnings = execution_order(list(FEEDTHROUGH), links, FEEDTHROUGH)
    assert len(order) == 5
    assert len(warnings) == 1
    assert "algebraic loop" in warnings[0]
    for name in ("vessel.u_dot", "controller.tau", "thrusters.tau_act"):
        assert name in warnings[0]


def test_fmu_without_dependencies_is_taken_to_follow_everything():
    everything = {"a": {"u": ["y"]}, "b": {"u": ["y"]}}
    links = [Link("a", "y", "b", "u"), Link("b", "y", "a", "u")]
    order, warnings = execution_order(["a", "b"], links, everything)
    assert order == ["a", "b"]
    assert "algebraic loop" in warnings[0]
    assert "b.y -> a.u" in warnings[0]


def test_order_that_cannot_be_had_is_no_algebraic_loop():
    """a passes u1 to y1 and u2 to y2; b sits between them."""
    feedthrough = {"a": {"u1": ["y1"], "u2": ["y2"]}, "b": {"u": ["y"]}, "c": {"u": ["y"]}}
    links = [
        Link("a", "y1", "b", "u"),
        Link("b", "y", "a", "u2"),
        Link("a", "y2", "c", "u"),
        Link("c", "y", "a", "u1"),
    ]
    _, warnings = execution_order(["a", "b", "c"], links[:3], feedthrough)
    assert "no order" in warnings[0]
    assert "one step late" in warnings[0]


def test_sink_steps_after_its_sources():
    order, _ = execution_order(
        ["sink", "a"], [Link("a", "y", "sink", "u")], {"sink": {"u": []}, "a": {}}
    )
    assert order == ["a", "sink"]


def test_two_separate_loops_are_both_told():
    feedthrough = {n: {"u": ["y"]} for n in "abcd"}
    links = [
        Link("a", "y", "b", "u"), Link("b", "y", "a", "u"),
        Link("c", "y", "d", "u"), Link("d", "y", "c", "u"),
    ]  # fmt: skip
    order, warnings = execution_order(list("abcd"), links, feedthrough)
    assert sorted(order) == list("abcd")
    assert len(warnings) == 2

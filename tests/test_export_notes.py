"""What is said of an export: steps of instances, and folders that are not there yet."""

from types import SimpleNamespace

import pytest

from cosim.export import portable, writing


@pytest.mark.parametrize(("every", "said"), [({"a": 1, "b": 1}, 0), ({"a": 1, "b": 4}, 1)])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_other_tools_step_otherwise_where_instances_have_longer_steps(
    monkeypatch, every, said, algorithm
):
    for name in ("_check_shape", "_check_texts"):
        monkeypatch.setattr(portable, name, lambda *_: None)
    monkeypatch.setattr(portable, "_left_behind", lambda *_: [])
    system = SimpleNamespace(scenario=SimpleNamespace(algorithm=algorithm), every=every)
    notes = portable.check(system, SimpleNamespace(name="SSP", order=False), False)
    assert sum("longer step" in note for note in notes) == said
    assert len(notes) == said + (algorithm == "gauss_seidel")


def test_folders_on_the_way_are_made(tmp_path):
    path = tmp_path / "a" / "b" / "system.ssp"
    with writing._beside(path) as (scratch, resolved):
        assert scratch.is_dir()
        assert resolved == path
    assert not scratch.exists()
    assert path.parent.is_dir()

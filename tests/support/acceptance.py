"""A model that is judged against criteria."""

import json

import diagnosis

EASY = {"quantity": "position", "horizon": 4.0, "tolerance": 0.5, "unit": "m", "coverage": 0.5}


def validated(comparison, folder, *criteria, **more):
    path = folder / "criteria.json"
    content = {"criteria": [{**EASY, **c} for c in criteria]} | more
    path.write_text(json.dumps(content))
    return diagnosis.validate(comparison, path)

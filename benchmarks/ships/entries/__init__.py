"""The project's own entries, each one module with ``fit(train) -> Predictor``.

An installed package adds an entry by the entry point ``name = module`` of ``cybership.methods``.
"""

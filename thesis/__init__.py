"""The methods and tests of the thesis: PCA, PLS, SysID, replay, ``watch``, and a study for each chapter.

``python -m thesis.pca RUN...`` analyses measured runs. ``python -m thesis.chapter5`` repeats the tests
of a chapter over many seeds and writes ``report.md`` with its figures and ``results.json``. The package
uses public names of ``fmus``, ``cosim`` and ``diagnosis``, which do not import it. See docs/thesis.md.
"""

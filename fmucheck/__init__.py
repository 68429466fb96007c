"""Check FMI 2.0 co-simulation FMUs, ours or anybody's, against the standard: ``python -m fmus.check``.

``registry`` says what a rule is, ``rules`` holds them, ``examine`` runs them on one FMU: those that read
the archive in this process, those that run the FMU each in a process of its own (``trial`` starts it,
``child`` is it).
"""

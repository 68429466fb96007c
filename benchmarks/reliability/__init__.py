"""Whether a run that ends, however it ends, says so: ``python -m benchmarks.reliability``.

``mutations`` breaks scenarios and files and reads them in this process; ``endings`` starts commands and
kills them, interrupts them, leaves them no room on the disk, and runs an FMU that dies in every way in
every function of FMI; ``campaigns`` does so to campaigns and replays, and spoils the cache;
``ship_mutations`` reads and builds broken ships; ``killed_commands`` looks for what compare, learn,
builds and campaigns leave behind; in
``sanitized`` the C files are called at random under sanitizers; ``judgement`` says what was wrong.
"""

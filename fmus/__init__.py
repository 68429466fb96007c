"""The physics and control laws of CyberShip Enterprise 1, each with an FMI 2.0 face.

A component is one module: NamedTuples of parameters, state, inputs and outputs, two pure functions
``init`` and ``step``, and a :class:`~fmus.declare.Component` that names them. Everything an FMU
shows of itself (variables, units, dependencies) comes from that declaration.
"""

"""A table of methods on measured ships that others can join: same runs, windows and start states.

``datasets`` says where the runs are and how they are split, ``predictor`` what an entry is given and
gives, ``same_windows`` predicts windows with any law of motion, ``chosen_settings`` lets a method choose
its settings on its training runs alone. Each module of ``entries`` is one method.
"""

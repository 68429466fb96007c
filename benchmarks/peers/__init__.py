"""Established methods beside this project's, on the same runs, windows and start states.

``same_windows`` predicts the project's windows with any law of motion, ``chosen_settings`` lets a method
choose its settings on the training runs alone, and each other module is one method.
"""

"""Actuators of any ship: their laws, what goes wrong with them, and what each is asked for."""

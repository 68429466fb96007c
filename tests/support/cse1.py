"""CyberShip Enterprise 1, the default ship, as tests need it."""

from fmus.ship import ship

SHIP = ship()
VESSEL, THRUSTERS, EFFECTS = SHIP.vessel, SHIP.thrusters, SHIP.effects
Inputs = THRUSTERS.inputs
THREE, FIVE = (layout.commands for layout in SHIP.layouts)
POWER = SHIP.power_settings
ASIDE = (-0.055, 0.055)  # m; to starboard: where the two VSP sit
BOW = 2  # number of its unit

"""What all steps on a run share: lengths of time, and the chance of a false report.

Seconds are those of CyberShip Enterprise 1, times the scale of the ship.
"""

# s, of predictions, and of the shortest run. Chosen: motions of the unstable nominal hull of CyberShip
# Enterprise 1 grow at up to 0.18 1/s.
HORIZON = 8.0
CHANCE = 0.01  # 1, of a report where nothing is, in all places that are looked at together; contract
# s, or LONG sampling periods if that is longer, of a gap. Chosen: a sixth of a window of the weak form,
# so that a command that is wrong there hardly counts.
HELD, LONG = 0.5, 5.0

"""What all steps on a run share: lengths of time, the chance of a false report, and what is enough.

Seconds are those of CyberShip Enterprise 1, times the scale of the ship.
"""

import math
import sys

# s, of predictions, and of the shortest run. Chosen: motions of the unstable nominal hull of CyberShip
# Enterprise 1 grow at up to 0.18 1/s.
HORIZON = 8.0
# 1, of a report where nothing is, in all places that are looked at together; contract. Share of the
# values of a channel that may be spikes, or of another writer.
CHANCE = 0.01
LEVEL = 0.95  # 1, probability of the intervals of values, and of the sets of ids; contract
# 1, share of a whole that may be left open. Contract, for an axis' first model error and the distance
# from a limit. The same for commands and windows, what must be explained, a command before the run,
# numbers above their limits, and a change of predictions by half the step over the residuals.
NEGLIGIBLE = 0.05
DIGITS = math.sqrt(sys.float_info.epsilon)  # 1, relative size of what rounding may have left
ORDER = 3  # 1, of the derivative with a penalty, and of the differences that noise is estimated by
WIDTH = 3.0  # s, of a window of the weak form: over a longer gap nothing is known of the motion
# s between two windows of the weak form, of the quickest motion, and of a gap. A gap is LONG sampling
# periods if that is longer. Chosen: kernels over six of them average a velocity to 2 %. A command that
# is wrong in one of them hardly counts.
EVERY, LONG = 0.5, 5.0
# 1, standard deviations beyond which a speed is not that of rest, a gain is wrong, and a nominal
# coefficient alone does not explain the data (contract).
FAR_OFF = 3.0
# 1, times what is usual, or a limit, from which on a step or a sample is none of a ship's motion, and a
# cell no command (chosen).
FAR = 8.0
# 1, samples, windows or parts of a run by which a correlation, a noise or a standard deviation is
# estimated (chosen).
FEWEST = 20
# 1, samples that noise neither repeats nor leaves on a line, and windows in which two channels do not
# agree by chance (chosen).
IN_A_ROW = 8
# 1, correlation of two signals that are one. Copies of a motion have 0.9995 and more in the median, two
# zig-zags of a tanker's model 0.9975 and less (tests/test_independence.py).
SAME = 0.999
# s, of a stretch by itself, or more where a run would have more than BLOCKS of them. Chosen: Gram
# matrices of more take memory, and no fold needs them.
BLOCK, BLOCKS = 15.0, 64
STEPS = 6  # 1, of whatever is iterated, and halvings of a step, at the most; two or three are usual
# 1, least number of parts that are compared, or left out in turn: stretches of fewer runs. Each stretch
# of a single run is as long as the shortest that can be learned from; chosen.
PARTS = 4
